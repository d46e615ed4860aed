"""Export of a weights file and a rig to a verified file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.camera import CameraRig
from appocc.checks import Float32Array
from appocc.errors import DataError
from appocc.export.card import card_text, make_card
from appocc.export.convert import to_onnx, write_onnx, write_openvino
from appocc.export.extras import import_package
from appocc.export.graph import ExportGraph
from appocc.export.parity import Parity, ParityError, measure_parity, parity_limit, synthetic_inputs, torch_runner
from appocc.export.runtimes import Runner, open_onnx, open_openvino
from appocc.files import digest_of, whole_file
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput
from appocc.inference.loading import weights_file
from appocc.inference.predictor import select_cameras
from appocc.models.input_images import fit_camera, fit_image
from appocc.models.model_spec import ModelSpec
from appocc.models.registry import COLOURINGS
from appocc.models.weights import load_model
from appocc.typing import PathLike

_ONNX, _OPENVINO = ".onnx", ".xml"
_PACKAGES = {_ONNX: ("onnx", "onnxscript", "onnxruntime"), _OPENVINO: ("onnx", "onnxscript", "openvino")}
# Number of real frames that the file is verified with.
_MOST_FRAMES = 3


class ExportSource(NamedTuple):
    """Rig that a file is exported for.

    Attributes:
        rig: all its cameras.
        name: name of the rig, for the card.
        frames: frames of the rig, for verification.
    """

    rig: CameraRig
    name: str
    frames: Sequence[Frame] = ()


class Exported(NamedTuple):
    """An exported network.

    Attributes:
        files: written files; the first is the one to open.
        card: model card in the file.
        parity: differences from the network.
    """

    files: tuple[Path, ...]
    card: dict[str, Any]
    parity: Parity


def source_from_inputs(inputs: Sequence[InferenceInput], name: str) -> ExportSource:
    """Return the rig of the first input, and a few frames evenly spaced over the inputs."""
    picked = sorted({round(i) for i in np.linspace(0, len(inputs) - 1, _MOST_FRAMES)})
    frames = [inputs[i].read().frame for i in picked]
    return ExportSource(frames[0].rig, name, frames)


def export(
    weights: PathLike | None,
    source: ExportSource,
    out: PathLike,
    runs: int,
    advance: Callable[[float], None] = lambda _: None,
) -> Exported:
    """Export a network for one rig and verify the file; it is kept only if its outputs match the network.

    Args:
        weights: weights file; None: the weights of the package.
        source: rig and frames.
        out: file name that ends in .onnx, or in .xml for OpenVINO, which adds a .bin and a .json file.
        runs: number of runs of each input with each number of threads.
        advance: called with the number of finished steps, of five in total.

    Raises:
        ParityError: if an output differs from the network by more than rounding explains.
        DataError: if there are no weights, no camera that they use, or `out` cannot be written.
        AppoccError: if the extra is not installed.
    """
    out = Path(out)
    ending = out.suffix.lower()
    if ending not in _PACKAGES:
        raise DataError(f"{out}: expected a name that ends in {_ONNX} or {_OPENVINO}")
    for name in _PACKAGES[ending]:
        import_package(name)
    if weights is not None and str(weights) in COLOURINGS:
        raise DataError(f"{weights}: this network has no weights, there is nothing to export")
    path = weights_file(weights)
    model, weights_card = load_model(path)
    spec = model.spec
    cameras = source.rig.with_cameras(select_cameras(spec, source.rig))
    if not len(cameras):
        raise DataError(f"rig {source.name}: expected a camera of {', '.join(spec.channels)}, got none")
    fit = cameras.with_cameras(fit_camera(camera, spec) for camera in cameras)
    shape = (1, len(fit), 3, spec.height_px, spec.width_px)
    identity = {"file": path.name, "sha256": digest_of(path)}
    card = make_card(weights_card, identity, spec, cameras, source.name, _PACKAGES[ending])
    inputs = {**synthetic_inputs(shape), **_frame_inputs(source.frames, cameras, spec)}
    with ExitStack() as kept:
        # First, so that an unwritable path fails at once.
        places = [kept.enter_context(whole_file(file)) for file in _files(out)]
        proto = to_onnx(ExportGraph(model, fit), shape, card_text(card))
        advance(1)
        open_file = _written(proto, card_text(card), places)
        advance(1)
        parity = measure_parity(torch_runner(model, fit), open_file, inputs, parity_limit(model), runs, advance)
        if not parity.holds:
            far = ", ".join(f"{name} {value:.2g}" for name, value in parity.largest.items())
            raise ParityError(
                f"{out}: not written: its outputs differ from those of the network by {far}, over {parity.limit:.1e}"
            )
    return Exported(_files(out), card, parity)


def _files(out: Path) -> tuple[Path, ...]:
    """Return the files to write; the first refers to the others, and is renamed last because it is entered first."""
    more = (".bin", ".json") if out.suffix.lower() == _OPENVINO else ()
    return (out, *map(out.with_suffix, more))


def _written(proto: Any, card: str, places: Sequence[Path]) -> Callable[[int], Runner]:
    """Write the files of `_files`; return a function that opens them with a number of threads."""
    first = places[0]
    if len(places) == 1:
        write_onnx(proto, first)
        return lambda threads: open_onnx(first, threads)
    _, values, card_file = places
    write_openvino(proto, card, first, values)
    card_file.write_text(card + "\n", encoding="utf-8")
    return lambda threads: open_openvino(first, values, threads)


def _frame_inputs(frames: Sequence[Frame], rig: CameraRig, spec: ModelSpec) -> dict[str, Float32Array]:
    """Return network inputs (1, N, 3, H, W) of the frames in which every camera works, by name."""
    found = {}
    for frame in frames:
        if all(camera.channel in frame.images for camera in rig):
            pairs = [fit_image(frame.images[c.channel], frame.rig[c.channel], spec) for c in rig]
            stacked = np.stack([image for image, _ in pairs]).transpose(0, 3, 1, 2)[None]
            found[f"frame {frame.token}"] = np.ascontiguousarray(stacked, np.float32) / np.float32(255)
    return found
