"""Export of a weights file and a rig to a verified file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.camera import CameraRig
from appocc.errors import DataError
from appocc.export.card import card_text, make_card
from appocc.export.clips import FRAMES, Clip, frame_clips, synthetic_clips
from appocc.export.convert import to_onnx, to_openvino, write_onnx, write_openvino
from appocc.export.extras import import_package
from appocc.export.graph import ExportGraph, input_shapes
from appocc.export.parity import Parity, ParityError, measure_parity, parity_limit, torch_runner
from appocc.export.quantize import Agreement, calibration_inputs, measure_agreement, quantize
from appocc.export.runtimes import Runner, open_onnx, open_openvino
from appocc.files import digest_of, whole_file
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput
from appocc.inference.loading import weights_file
from appocc.inference.predictor import select_cameras
from appocc.models.base import BEVModel
from appocc.models.input_images import fit_camera
from appocc.models.registry import COLOURINGS
from appocc.models.weights import load_model
from appocc.typing import PathLike

_ONNX, _OPENVINO = ".onnx", ".xml"
_PACKAGES = {_ONNX: ("onnx", "onnxscript", "onnxruntime"), _OPENVINO: ("onnx", "onnxscript", "openvino")}
# Clips for INT8, spread evenly over the dataset: every other one for calibration, the rest for the check.
_MOST_CLIPS = 32


class ExportSource(NamedTuple):
    """Rig that a file is exported for.

    Attributes:
        rig: all its cameras.
        name: name of the rig, for the card.
        inputs: key frames with the rig, in the order of time; a few are read, for calibration and verification.
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

    def windows(self) -> list[Sequence[InferenceInput]]:
        """Return runs of consecutive key frames, spread evenly over all of them."""
        length = max(1, min(FRAMES, len(self.inputs) // 2))
        starts = range(0, len(self.inputs), length)
        chosen = {round(i) for i in np.linspace(0, len(starts) - 1, min(len(starts), _MOST_CLIPS))}
        return [self.inputs[starts[i] : starts[i] + length] for i in sorted(chosen)]


class Exported(NamedTuple):
    """An exported network.

    Attributes:
        files: written files; the first is the one to open.
        card: model card in the file.
        check: comparison with the network: differences, or for INT8 the agreement.
    """

    files: tuple[Path, ...]
    card: dict[str, Any]
    check: Parity | Agreement


@dataclass(frozen=True, eq=False)
class _Job:
    """A network with a rig, ready for export.

    Attributes:
        model: network.
        cameras: used cameras of the rig.
        fit: the same cameras after `fit_camera`.
        shapes: shapes of the inputs.
        card: model card of the exported file.
    """

    model: BEVModel
    cameras: CameraRig
    fit: CameraRig
    shapes: dict[str, tuple[int, ...]]
    card: dict[str, Any]

    def clips(self, frames: Sequence[Frame]) -> dict[str, Clip]:
        """Return clips of frames."""
        return frame_clips(frames, self.cameras, self.model.spec, self.shapes)

    def read_clips(self, windows: Sequence[Sequence[InferenceInput]]) -> Iterator[Clip]:
        """Read the clips of runs of consecutive key frames, one run at a time."""
        for window in windows:
            yield from self.clips([each.read().frame for each in window]).values()


def source_from_inputs(inputs: Sequence[InferenceInput], name: str) -> ExportSource:
    """Return the rig of the first of the key frames."""
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
    job = _prepare(weights, source, out)
    clips = {**synthetic_clips(job.shapes), **job.clips(source.frames(consecutive=job.model.parts.memory))}
    limit = parity_limit(job.model, max(map(len, clips.values())))
    with ExitStack() as kept:
        # First, so that an unwritable path fails at once.
        places = [kept.enter_context(whole_file(file)) for file in _files(out)]
        proto = to_onnx(ExportGraph(job.model, job.fit), card_text(job.card))
        advance(1)
        open_file = _written(proto, card_text(job.card), places)
        advance(1)
        parity = measure_parity(torch_runner(job.model, job.fit), open_file, clips, limit, runs, advance)
        if not parity.holds:
            far = ", ".join(f"{name} {value:.2g}" for name, value in parity.largest.items())
            raise ParityError(
                f"{out}: not written: its outputs differ from those of the network by {far}, over {parity.limit:.1e}"
            )
    return Exported(_files(out), job.card, parity)


def export_int8(
    weights: PathLike | None,
    source: ExportSource,
    out: PathLike,
    advance: Callable[[float], None] = lambda _: None,
) -> Exported:
    """Export a network for one rig with INT8 convolutions, calibrated and checked on frames.

    Args:
        weights: weights file; None: the weights of the package.
        source: rig and frames.
        out: file name that ends in .xml; a .bin and a .json file are added.
        advance: called with the number of finished steps, of five in total.

    Raises:
        ParityError: if the predictions differ too much from those of the network.
        DataError: if there are no weights, no camera that they use, too few frames, or `out` cannot be written.
        AppoccError: if the extra is not installed.
    """
    out = Path(out)
    if out.suffix.lower() != _OPENVINO:
        raise DataError(f"{out}: expected a name that ends in {_OPENVINO} for INT8")
    import_package("nncf")
    windows = source.windows()
    if len(windows) < 2:
        raise DataError(f"{source.name}: expected two or more key frames to calibrate INT8, got {len(source.inputs)}")
    job = _prepare(weights, source, out)
    network = torch_runner(job.model, job.fit)
    with ExitStack() as kept:
        places = [kept.enter_context(whole_file(file)) for file in _files(out)]
        found = to_openvino(to_onnx(ExportGraph(job.model, job.fit), card_text(job.card)))
        advance(1)
        inputs = calibration_inputs(network, job.read_clips(windows[::2]))
        advance(1)
        open_file = _written_openvino(quantize(found, inputs), card_text(job.card), places)
        advance(1)
        thresholds = list(job.card["thresholds"].values())
        agreement = measure_agreement(network, open_file(1), job.read_clips(windows[1::2]), thresholds, len(inputs))
        advance(2)
        if not agreement.holds:
            raise ParityError(f"{out}: not written: {'; '.join(agreement.lines())}")
    return Exported(_files(out), job.card, agreement)


def _prepare(weights: PathLike | None, source: ExportSource, out: Path) -> _Job:
    """Load the network and fit the rig to it."""
    ending = out.suffix.lower()
    if ending not in _PACKAGES:
        raise DataError(f"{out}: expected a name that ends in {_ONNX} or {_OPENVINO}")
    for name in _PACKAGES[ending]:
        import_package(name)
    if weights is not None and str(weights) in COLOURINGS:
        raise DataError(f"{weights}: this network has no weights, there is nothing to export")
    path = weights_file(weights)
    model, weights_card = load_model(path)
    cameras = source.rig.with_cameras(select_cameras(model.spec, source.rig))
    if not len(cameras):
        raise DataError(f"rig {source.name}: expected a camera of {', '.join(model.spec.channels)}, got none")
    fit = cameras.with_cameras(fit_camera(camera, model.spec) for camera in cameras)
    identity = {"file": path.name, "sha256": digest_of(path)}
    card = make_card(weights_card, identity, model.spec, cameras, source.name, _PACKAGES[ending])
    return _Job(model, cameras, fit, input_shapes(model.spec, model.parts, len(fit)), card)


def _files(out: Path) -> tuple[Path, ...]:
    """Return the files to write; the first refers to the others, and is renamed last because it is entered first."""
    more = (".bin", ".json") if out.suffix.lower() == _OPENVINO else ()
    return (out, *map(out.with_suffix, more))


def _written(proto: Any, card: str, places: Sequence[Path]) -> Callable[[int], Runner]:
    """Write the files of `_files`; return a function that opens them with a number of threads."""
    if len(places) == 1:
        write_onnx(proto, places[0])
        return lambda threads: open_onnx(places[0], threads)
    return _written_openvino(to_openvino(proto), card, places)


def _written_openvino(model: Any, card: str, places: Sequence[Path]) -> Callable[[int], Runner]:
    """Write an OpenVINO model and its card; return a function that opens them with a number of threads."""
    first, values, card_file = places
    write_openvino(model, card, first, values)
    card_file.write_text(card + "\n", encoding="utf-8")
    return lambda threads: open_openvino(first, values, threads)
