"""From a file of weights and a rig to an exported file that has been checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.camera import CameraRig
from appocc.checks import Float32Array
from appocc.errors import DataError
from appocc.export.card import card_of, text_of
from appocc.export.convert import to_onnx, write_onnx, write_openvino
from appocc.export.extras import package
from appocc.export.graph import Graph
from appocc.export.parity import Parity, ParityError, compare, eager, limit_of, made_inputs
from appocc.export.runtimes import Run, open_onnx, open_openvino
from appocc.files import digest_of, whole_file
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput
from appocc.inference.loading import weights_file
from appocc.inference.predictor import select_cameras
from appocc.models.input_images import fit_camera, fit_image
from appocc.models.model_spec import ModelSpec
from appocc.models.registry import COLOURINGS
from appocc.models.weights import load_model

_ONNX, _OPENVINO = ".onnx", ".xml"
_PACKAGES = {_ONNX: ("onnx", "onnxscript", "onnxruntime"), _OPENVINO: ("onnx", "onnxscript", "openvino")}
# Real pictures that the file is checked with.
_MOST_FRAMES = 3


class Source(NamedTuple):
    """The rig that a file is made for.

    Attributes:
        rig: all its cameras.
        name: where it comes from.
        frames: with pictures of it, for the check.
    """

    rig: CameraRig
    name: str
    frames: Sequence[Frame] = ()


class Exported(NamedTuple):
    """What was written.

    Attributes:
        files: all of them, the one to open first.
        card: what it says of itself.
        parity: how far it is from the network.
    """

    files: tuple[Path, ...]
    card: dict[str, Any]
    parity: Parity


def source_of(inputs: Sequence[InferenceInput], name: str) -> Source:
    """The rig of the first of some moments, and a few of them, from first to last."""
    picked = sorted({round(i) for i in np.linspace(0, len(inputs) - 1, _MOST_FRAMES)})
    frames = [inputs[i].read().frame for i in picked]
    return Source(frames[0].rig, name, frames)


def export(
    weights: Path | None, source: Source, out: Path, runs: int, advance: Callable[[float], None] = lambda _: None
) -> Exported:
    """Write a network for one rig, check the file, and leave it only if it answers as the network does.

    Args:
        weights: file of weights; None: those of the package.
        source: the rig.
        out: ends in .onnx, or in .xml for OpenVINO, which puts a .bin and a .json beside it.
        runs: of each input with each number of threads.
        advance: called with the number of steps done, of five.

    Raises:
        ParityError: if a probability is farther from the network's than rounding explains.
        DataError: if there are no weights, no camera that they use, or `out` cannot be written.
        AppoccError: if the extra is not installed.
    """
    ending = out.suffix.lower()
    if ending not in _PACKAGES:
        raise DataError(f"{out}: expected a name that ends in {_ONNX} or {_OPENVINO}")
    for name in _PACKAGES[ending]:
        package(name)
    if weights is not None and str(weights) in COLOURINGS:
        raise DataError(f"{weights}: this network learns nothing and has no weights, there is nothing to export")
    path = weights_file(weights)
    model, weights_card = load_model(path)
    spec = model.spec
    cameras = source.rig.with_cameras(select_cameras(spec, source.rig))
    if not len(cameras):
        raise DataError(f"rig {source.name}: expected a camera of {', '.join(spec.channels)}, got none")
    fit = cameras.with_cameras(fit_camera(camera, spec) for camera in cameras)
    shape = (1, len(fit), 3, spec.height_px, spec.width_px)
    told = {"file": path.name, "sha256": digest_of(path)}
    card = card_of(weights_card, told, spec, cameras, source.name, _PACKAGES[ending])
    inputs = {**made_inputs(shape), **_pictures(source.frames, cameras, spec)}
    with ExitStack() as kept:
        # First of all, so that a place that cannot be written is told at once.
        places = [kept.enter_context(whole_file(file)) for file in _files(out)]
        proto = to_onnx(Graph(model, fit), shape, text_of(card))
        advance(1)
        open_file = _written(proto, text_of(card), places)
        advance(1)
        parity = compare(eager(model, fit), open_file, inputs, limit_of(model), runs, advance)
        if not parity.holds:
            far = ", ".join(f"{name} {value:.2g}" for name, value in parity.largest.items())
            raise ParityError(
                f"{out}: not written: its answers differ from the network's by {far}, over {parity.limit:.1e}"
            )
    return Exported(_files(out), card, parity)


def _files(out: Path) -> tuple[Path, ...]:
    """What is written; the first refers to the others, and as the first entered it becomes real last."""
    beside = (".bin", ".json") if out.suffix.lower() == _OPENVINO else ()
    return (out, *map(out.with_suffix, beside))


def _written(proto: Any, card: str, places: Sequence[Path]) -> Callable[[int], Run]:
    """Write what `_files` names; a way to open it, with a number of threads."""
    first = places[0]
    if len(places) == 1:
        write_onnx(proto, first)
        return lambda threads: open_onnx(first, threads)
    _, values, beside = places
    write_openvino(proto, card, first, values)
    beside.write_text(card + "\n", encoding="utf-8")
    return lambda threads: open_openvino(first, values, threads)


def _pictures(frames: Sequence[Frame], rig: CameraRig, spec: ModelSpec) -> dict[str, Float32Array]:
    """Real pictures (1, N, 3, H, W) as the network is given them, of frames in which every camera works."""
    found = {}
    for frame in frames:
        if all(camera.channel in frame.images for camera in rig):
            pairs = [fit_image(frame.images[c.channel], frame.rig[c.channel], spec) for c in rig]
            stacked = np.stack([picture for picture, _ in pairs]).transpose(0, 3, 1, 2)[None]
            found[f"frame {frame.token}"] = np.ascontiguousarray(stacked, np.float32) / np.float32(255)
    return found
