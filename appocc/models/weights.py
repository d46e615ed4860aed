"""Weights files: safetensors with a model card; loading executes no code."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from appocc.bevmap import CLASSES
from appocc.errors import AppoccError, DataError
from appocc.files import local_copy, path_of, write_bytes
from appocc.grid import BEVGrid
from appocc.models.base import BEVModel
from appocc.models.model_spec import MODEL_SPECS, ModelSpec, Parts
from appocc.models.registry import NETWORKS, build
from appocc.models.shipped import shipped_weights
from appocc.probability_calibration import Calibration
from appocc.typing import PathLike

VERSION = "1"
# Safetensors writes several entries in random order; a single entry keeps files reproducible.
_ENTRY = "card"
# Limits against files that exhaust the memory.
_MOST_CELLS, _MOST_PIXELS = 4_000_000, 16_000_000
Card = Mapping[str, str]


def save_weights(path: PathLike, model: BEVModel, card: Card, half: bool = False) -> None:
    """Write the weights of a network for inference, atomically; the same weights give the same bytes.

    Heads for training only are left out.

    Args:
        path: file name that ends in .safetensors.
        model: network made by `build`.
        card: model card; `network` is the name of the network. `thresholds` (JSON, one per class) are 0.5 by default.
            `setting`, `view` (JSON: cameras, grid, size), `appearance`, `parts` and `version` are set here.
        half: write matrices as float16, half the size; statistics and biases keep their type.

    Raises:
        DataError: if weights are not finite or not those of the network, if thresholds are invalid, or the file
            cannot be written.
        NotFoundError: if there is no network with the name on the card.
    """
    state = model.state_dict()
    name = card.get("network", "")
    appearance, wanted = _inference_weights(name, model.spec, model.parts, state)
    tensors = {key: _packed(state[key], half) for key in sorted(wanted)}
    for key, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise DataError(f"{path}: expected finite weights, got some in '{key}' that are not")
    full = {
        "thresholds": "[0.5, 0.5, 0.5]",
        **card,
        "setting": model.spec.name,
        "view": _view_json(model.spec),
        "appearance": json.dumps(appearance),
        "parts": json.dumps(model.parts.names),
        "version": VERSION,
    }
    read_thresholds(full)
    data = save(tensors, {_ENTRY: json.dumps(full, sort_keys=True)})
    write_bytes(path, data)


def load_model(path: PathLike) -> tuple[BEVModel, dict[str, str]]:
    """Load the network of a weights file, float32 and in eval mode, and its model card.

    Raises:
        DataError: if the file is missing or damaged, or was not written by `save_weights`.
    """
    card, state = _read(path)
    try:
        if card["version"] != VERSION:
            raise ValueError(f"expected weights of version {VERSION}, got {card['version']}")
        spec = _parse_spec(card["setting"], card["view"])
        parts = Parts.of(json.loads(card.get("parts", "[]")))  # older weights have none
        model = _bare(card["network"], spec, bool(json.loads(card["appearance"])), parts)
        read_thresholds(card)
    except KeyError as error:
        raise DataError(f"{path}: not weights of this project, the card lacks {error}") from error
    except (AppoccError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise DataError(f"{path}: invalid model card ({_one_line(error)})") from error
    wanted = model.state_dict()
    for key in sorted(wanted.keys() | state.keys()):
        want, got = (_shape(tensors.get(key)) for tensors in (wanted, state))
        if want != got:
            raise DataError(f"{path}: weights of '{key}': expected {want}, got {got}")
        if not torch.isfinite(state[key]).all():
            raise DataError(f"{path}: expected finite weights, got some in '{key}' that are not")
    model.load_state_dict({key: tensor.to(wanted[key].dtype) for key, tensor in state.items()})
    return model.eval(), card


def load_weights_into(model: BEVModel, path: PathLike) -> dict[str, str]:
    """Load the weights of a file into a network and return its model card; heads for training only are unchanged.

    The file may have fewer optional parts than the network: layers of new parts are unchanged, and new inputs of a
    layer start with weight 0.

    Raises:
        DataError: as `load_model`, or if the weights belong to another network.
    """
    other, card = load_model(path)
    given, own = other.state_dict(), model.state_dict()
    fewer = set(other.parts.names) <= set(model.parts.names)
    fitted = {key: _widened(tensor, own.get(key)) for key, tensor in given.items()}
    if type(other) is not type(model) or other.spec != model.spec or not fewer or None in fitted.values():
        kind = f"{card['network']}, {card['setting']} degrees, appearance {card['appearance']}"
        raise DataError(f"{path}: expected weights of the network to train, got those of {kind}")
    model.load_state_dict(own | fitted)
    return card


def _widened(tensor: Tensor, like: Tensor | None) -> Tensor | None:
    """Return a tensor with zeros for the further inputs (axis 1) of another; None if it differs otherwise."""
    if like is None or tensor.shape == like.shape:
        return None if like is None else tensor
    if tensor.ndim < 2 or tensor.shape[:1] + tensor.shape[2:] != like.shape[:1] + like.shape[2:]:
        return None
    if tensor.shape[1] > like.shape[1]:
        return None
    wide = torch.zeros_like(like)
    wide[:, : tensor.shape[1]] = tensor
    return wide


def read_thresholds(card: Card) -> tuple[float, float, float]:
    """Read the decision thresholds of road, vehicle and lane from a model card.

    Raises:
        DataError: if they are missing or invalid.
    """
    try:
        road, vehicle, lane = (float(each) for each in json.loads(card["thresholds"]))
    except (KeyError, ValueError, TypeError) as error:
        raise DataError(f"card: expected three thresholds, got {card.get('thresholds')!r}") from error
    if not all(0 <= each <= 1 for each in (road, vehicle, lane)):
        raise DataError(f"card: expected thresholds of 0 .. 1, got {card['thresholds']}")
    return road, vehicle, lane


def read_calibrations(card: Card) -> tuple[list[Calibration], Calibration | None]:
    """Read the calibrations that are part of the weights from a model card: of road, vehicle, lane, and of objects.

    Raises:
        DataError: if they are invalid.
    """
    try:
        found = json.loads(card.get("validation", "{}"))
        classes = [_calibration(found["calibration"][name]) for name in CLASSES if "calibration" in found]
        objects = found.get("object_calibration")
        return classes, None if objects is None else _calibration(objects)
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise DataError(f"card: invalid calibration ({_one_line(error)})") from error


def _calibration(values: Iterable[float]) -> Calibration:
    temperature, bias = map(float, values)
    if not (math.isfinite(bias) and 0 < temperature < math.inf):
        raise ValueError(f"expected a positive temperature and a finite bias, got {temperature} and {bias}")
    return Calibration(temperature, bias)


def _read(path: PathLike) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Read the model card and the tensors of a file."""
    path = path_of(path)
    if not path.is_file():
        raise DataError(f"{path}: no such file of weights (shipped are {', '.join(sorted(shipped_weights()))})")
    try:
        with safe_open(local_copy(path), framework="pt") as file:
            entries = file.metadata() or {}
            state = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 - it is no dict
        card = json.loads(entries.get(_ENTRY, "null"))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (SafetensorError, ValueError, RecursionError) as error:
        raise DataError(f"{path}: not a readable file of weights ({_one_line(error)})") from error
    if not isinstance(card, dict) or not all(isinstance(value, str) for value in card.values()):
        raise DataError(f"{path}: not weights of this project, there is no card")
    return card, state


def _inference_weights(
    name: str, spec: ModelSpec, parts: Parts, state: Mapping[str, Tensor]
) -> tuple[bool, list[str]]:
    """Return whether weights are of a network with appearance, and the names of the weights for inference."""
    for appearance in (True, False):
        bare = _bare(name, spec, appearance, parts).state_dict()
        if all(_shape(tensor) == _shape(state.get(key)) for key, tensor in bare.items()):
            return appearance and NETWORKS[name].appearance, list(bare)
    raise DataError(f"weights: expected those of the network '{name}', got others")


def _bare(name: str, spec: ModelSpec, appearance: bool, parts: Parts) -> BEVModel:
    """Build a network without heads for training; the caller's random state is unchanged."""
    with torch.random.fork_rng(devices=[]):
        return build(name, spec, appearance=appearance, parts=parts)


def _packed(tensor: Tensor, half: bool) -> Tensor:
    tensor = tensor.detach().cpu().contiguous()
    return tensor.half() if half and tensor.is_floating_point() and tensor.ndim > 1 else tensor


def _shape(tensor: Tensor | None) -> tuple[int, ...] | None:
    return None if tensor is None else tuple(tensor.shape)


def _view_json(spec: ModelSpec) -> str:
    grid = spec.grid.as_array().tolist()
    return json.dumps({"channels": spec.channels, "grid": grid, "size_px": [spec.width_px, spec.height_px]})


def _parse_spec(name: str, view: str) -> ModelSpec:
    """Parse the model spec that `_view_json` wrote.

    Raises:
        KeyError, ValueError, TypeError, ShapeError: if it is invalid or too large.
    """
    values = json.loads(view)
    grid = BEVGrid.from_array(values["grid"])
    width_px, height_px = (int(value) for value in values["size_px"])
    x, y = grid.shape
    if x * y > _MOST_CELLS or width_px * height_px > _MOST_PIXELS or min(width_px, height_px) < 1:
        raise ValueError(f"a grid of {x} x {y} cells from images of {width_px} x {height_px}")
    spec = ModelSpec(name, tuple(map(str, values["channels"])), grid, width_px, height_px)
    if spec != MODEL_SPECS.get(name, spec):
        raise ValueError(f"expected the cameras, grid and size of setting {name}, got {view}")
    return spec


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
