"""Weights on disk: one safetensors file with a card that says what they are; nothing in it is ever executed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from appocc.errors import AppoccError, DataError
from appocc.files import write_bytes
from appocc.grid import BEVGrid
from appocc.models.base import BEVModel
from appocc.models.model_spec import SETTINGS, Setting
from appocc.models.registry import NETWORKS, build

# Come with the package.
PACKAGED = Path(__file__).parent / "data" / "appocc.safetensors"
VERSION = "1"
# Safetensors writes several entries in an order that differs from run to run; one entry makes the same file.
_ENTRY = "card"
# A file that asks for more would only fill the memory.
_MOST_CELLS, _MOST_PIXELS = 4_000_000, 16_000_000
Card = Mapping[str, str]


def save_weights(path: Path, model: BEVModel, card: Card, half: bool = False) -> None:
    """Write what a network needs to answer, whole or not at all; the same weights give the same bytes.

    Heads that only training uses are left out.

    Args:
        path: ends in .safetensors.
        model: network of `build`.
        card: what people and programs should know; `network` is its name. `thresholds` (JSON, one per class) are 0.5
            where not given. `setting`, `view` (JSON: cameras, grid, size), `appearance` and `version` are set here.
        half: write matrices as float16, half the size; statistics and biases stay as they are.

    Raises:
        DataError: if weights are not finite or not those of the network, if thresholds are none, or the file cannot
            be written.
        NotFoundError: if there is no network of the card's name.
    """
    state = model.state_dict()
    name = card.get("network", "")
    appearance, wanted = _kind_of(name, model.setting, state)
    tensors = {key: _packed(state[key], half) for key in sorted(wanted)}
    for key, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise DataError(f"{path}: expected finite weights, got some in '{key}' that are not")
    full = {
        "thresholds": "[0.5, 0.5, 0.5]",
        **card,
        "setting": model.setting.name,
        "view": _view_text(model.setting),
        "appearance": json.dumps(appearance),
        "version": VERSION,
    }
    thresholds_of(full)
    data = save(tensors, {_ENTRY: json.dumps(full, sort_keys=True)})
    write_bytes(path, data)


def load_model(path: Path) -> tuple[BEVModel, dict[str, str]]:
    """The network of a file in eval mode, float32, and its card.

    Raises:
        DataError: if the file is missing or damaged, or was not written by `save_weights`.
    """
    card, state = _read(path)
    try:
        if card["version"] != VERSION:
            raise ValueError(f"expected weights of version {VERSION}, got {card['version']}")
        setting = _setting_of(card["setting"], card["view"])
        model = _bare(card["network"], setting, bool(json.loads(card["appearance"])))
        thresholds_of(card)
    except KeyError as error:
        raise DataError(f"{path}: no weights of this project, the card lacks {error}") from error
    except (AppoccError, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise DataError(f"{path}: the card cannot be true ({_one_line(error)})") from error
    wanted = model.state_dict()
    for key in sorted(wanted.keys() | state.keys()):
        want, got = (_shape(tensors.get(key)) for tensors in (wanted, state))
        if want != got:
            raise DataError(f"{path}: weights of '{key}': expected {want}, got {got}")
        if not torch.isfinite(state[key]).all():
            raise DataError(f"{path}: expected finite weights, got some in '{key}' that are not")
    model.load_state_dict({key: tensor.to(wanted[key].dtype) for key, tensor in state.items()})
    return model.eval(), card


def begin_with(model: BEVModel, path: Path) -> None:
    """Give a network the weights of a file; heads that only training uses stay as they are.

    Raises:
        DataError: as `load_model`, or if the weights are of another network.
    """
    other, card = load_model(path)
    given, own = other.state_dict(), model.state_dict()
    alike = all(_shape(own.get(key)) == tuple(tensor.shape) for key, tensor in given.items())
    if type(other) is not type(model) or other.setting != model.setting or not alike:
        kind = f"{card['network']}, {card['setting']} degrees, appearance {card['appearance']}"
        raise DataError(f"{path}: expected weights of the network to train, got those of {kind}")
    model.load_state_dict(own | given)


def thresholds_of(card: Card) -> tuple[float, float, float]:
    """Probabilities from which a cell is taken to be road, vehicle, lane.

    Raises:
        DataError: if the card holds none.
    """
    try:
        road, vehicle, lane = (float(each) for each in json.loads(card["thresholds"]))
    except (KeyError, ValueError, TypeError) as error:
        raise DataError(f"card: expected three thresholds, got {card.get('thresholds')!r}") from error
    if not all(0 <= each <= 1 for each in (road, vehicle, lane)):
        raise DataError(f"card: expected thresholds of 0 .. 1, got {card['thresholds']}")
    return road, vehicle, lane


def _read(path: Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Card and tensors of a file."""
    if not path.is_file():
        raise DataError(f"{path}: no such file of weights")
    try:
        with safe_open(path, framework="pt") as file:
            entries = file.metadata() or {}
            state = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 - it is no dict
        card = json.loads(entries.get(_ENTRY, "null"))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (SafetensorError, ValueError, RecursionError) as error:
        raise DataError(f"{path}: not a readable file of weights ({_one_line(error)})") from error
    if not isinstance(card, dict) or not all(isinstance(value, str) for value in card.values()):
        raise DataError(f"{path}: no weights of this project, there is no card")
    return card, state


def _kind_of(name: str, setting: Setting, state: Mapping[str, Tensor]) -> tuple[bool, list[str]]:
    """Whether weights are of a network with appearance, and those names of them that are needed to answer."""
    for appearance in (True, False):
        bare = _bare(name, setting, appearance).state_dict()
        if all(_shape(tensor) == _shape(state.get(key)) for key, tensor in bare.items()):
            return appearance and NETWORKS[name].appearance, list(bare)
    raise DataError(f"weights: expected those of the network '{name}', got others")


def _bare(name: str, setting: Setting, appearance: bool) -> BEVModel:
    """A network without heads for training; the caller's random numbers go on as if it had not been made."""
    with torch.random.fork_rng(devices=[]):
        return build(name, setting, appearance=appearance)


def _packed(tensor: Tensor, half: bool) -> Tensor:
    tensor = tensor.detach().cpu().contiguous()
    return tensor.half() if half and tensor.is_floating_point() and tensor.ndim > 1 else tensor


def _shape(tensor: Tensor | None) -> tuple[int, ...] | None:
    return None if tensor is None else tuple(tensor.shape)


def _view_text(setting: Setting) -> str:
    grid = setting.grid.as_array().tolist()
    return json.dumps({"channels": setting.channels, "grid": grid, "size_px": [setting.width_px, setting.height_px]})


def _setting_of(name: str, view: str) -> Setting:
    """The setting that `_view_text` wrote down.

    Raises:
        KeyError, ValueError, TypeError, ShapeError: if it is none.
        DataError: if it is far too large.
    """
    values = json.loads(view)
    grid = BEVGrid.from_array(values["grid"])
    width_px, height_px = (int(value) for value in values["size_px"])
    x, y = grid.shape
    if x * y > _MOST_CELLS or width_px * height_px > _MOST_PIXELS or min(width_px, height_px) < 1:
        raise ValueError(f"a grid of {x} x {y} cells from pictures of {width_px} x {height_px}")
    setting = Setting(name, tuple(map(str, values["channels"])), grid, width_px, height_px)
    if setting != SETTINGS.get(name, setting):
        raise ValueError(f"expected the cameras, grid and size of setting {name}, got {view}")
    return setting


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
