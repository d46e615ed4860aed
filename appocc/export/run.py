"""Export of a weights file and a rig to a verified file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.camera import CameraRig
from appocc.errors import DataError
from appocc.export.card import card_text, make_card
from appocc.export.clips import FRAMES, frame_clips, synthetic_clips
from appocc.export.convert import to_onnx, write_onnx, write_openvino
from appocc.export.extras import import_package
from appocc.export.graph import ExportGraph, input_shapes
from appocc.export.parity import Parity, ParityError, measure_parity, parity_limit, torch_runner
from appocc.export.runtimes import Runner, open_onnx, open_openvino
from appocc.files import digest_of, whole_file
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput
from appocc.inference.loading import weights_file
from appocc.inference.predictor import select_cameras
from appocc.models.input_images import fit_camera
from appocc.models.registry import COLOURINGS
from appocc.models.weights import load_model
from appocc.typing import PathLike

_ONNX, _OPENVINO = ".onnx", ".xml"
_PACKAGES = {_ONNX: ("onnx", "onnxscript", "onnxruntime"), _OPENVINO: ("onnx", "onnxscript", "openvino")}


class ExportSource(NamedTuple):
    """Rig that a file is exported for.

    Attributes:
        rig: all its cameras.
        name: name of the rig, for the card.
        inputs: key frames of a drive with the rig, for verification; a few are read.
    """

    rig: CameraRig
    name: str
    inputs: Sequence[InferenceInput] = ()

    def frames(self, consecutive: bool) -> list[Frame]:
        """Read a few frames: consecutive ones from the middle of the drive, or evenly spaced ones."""
        last = len(self.inputs) - 1
        first = max(0, last // 2 - 1)
        spaced = {round(i) for i in np.linspace(0, last, FRAMES)}
        picked = range(first, first + FRAMES) if consecutive else sorted(spaced)
        return [self.inputs[i].read().frame for i in picked if 0 <= i <= last]


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
    """Return the rig of the first of the key frames of a drive."""
    return ExportSource(inputs[0].read().frame.rig, name, inputs)


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
    shapes = input_shapes(spec, model.parts, len(fit))
    identity = {"file": path.name, "sha256": digest_of(path)}
    card = make_card(weights_card, identity, spec, cameras, source.name, _PACKAGES[ending])
    frames = source.frames(consecutive=model.parts.memory)
    clips = {**synthetic_clips(shapes), **frame_clips(frames, cameras, spec, shapes)}
    limit = parity_limit(model, max(map(len, clips.values())))
    with ExitStack() as kept:
        # First, so that an unwritable path fails at once.
        places = [kept.enter_context(whole_file(file)) for file in _files(out)]
        proto = to_onnx(ExportGraph(model, fit), card_text(card))
        advance(1)
        open_file = _written(proto, card_text(card), places)
        advance(1)
        parity = measure_parity(torch_runner(model, fit), open_file, clips, limit, runs, advance)
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
