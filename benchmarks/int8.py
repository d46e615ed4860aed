"""IoU and time of a network in INT8 against the same network in float32, on a dataset with true maps.

    OMP_NUM_THREADS=1 python -m benchmarks.int8 CALIBRATION ROOT [--weights F] [--scenes 16]

The file is that of `appocc export CALIBRATION --int8`. The file and torch predict the first frames of the scenes of
ROOT, each with its own memory; the rig must be the same. IoU is at the thresholds of the weights, over all cells.
Times are CPU time of a frame with one thread, medians of interleaved runs, with Lift-Splat-Shoot in eager float32 as
the unit.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from appocc.bevmap import CLASSES, load_map
from appocc.camera import CameraRig
from appocc.export.clips import FRAMES, Clip, frame_clips, run_clip
from appocc.export.graph import IMAGES, input_shapes
from appocc.export.parity import torch_runner
from appocc.export.quantize import occupied
from appocc.export.run import export_int8, source_from_inputs
from appocc.export.runtimes import Runner, open_openvino
from appocc.inference.inputs import dataset_inputs
from appocc.inference.loading import weights_file
from appocc.inference.predictor import select_cameras
from appocc.models.base import BEVModel
from appocc.models.input_images import fit_camera
from appocc.models.registry import build
from appocc.models.weights import load_model, read_thresholds
from appocc.nuscenes.dataset import Dataset
from benchmarks.predicted_maps import truth_source

_RUNS = 7


def clips_with_truth(root: Path, model: BEVModel, scenes: int) -> Iterator[tuple[Clip, list[np.ndarray]]]:
    """Yield a clip of each of some scenes with its true occupancies (3, X, Y)."""
    data, against = Dataset(root), truth_source(root, None)
    for scene in data.scenes[:: max(1, len(data.scenes) // scenes)][:scenes]:
        frames = [each.read().frame for each in dataset_inputs(data, [scene])[:FRAMES]]
        cameras = used_cameras(model, frames[0].rig)
        shapes = input_shapes(model.spec, model.parts, len(cameras))
        clip = next(iter(frame_clips(frames, cameras, model.spec, shapes).values()))
        yield clip, [load_map(root, against, frame.token).occupancy >= 0.5 for frame in frames[: len(clip)]]


def used_cameras(model: BEVModel, rig: CameraRig) -> CameraRig:
    """Return the cameras of a rig that the network uses."""
    return rig.with_cameras(select_cameras(model.spec, rig))


def medians_s(ways: Sequence[Callable[[], object]]) -> list[float]:
    """Return the median CPU time of functions that run in turn, after a warm-up."""
    seconds: list[list[float]] = [[] for _ in ways]
    for _ in range(_RUNS + 1):
        for own, way in zip(seconds, ways, strict=True):
            start = time.process_time()
            way()
            own.append(time.process_time() - start)
    return [statistics.median(own[1:]) for own in seconds]


def time_table(model: BEVModel, rig: CameraRig, runners: dict[str, Runner], clip: Clip) -> list[tuple[str, float]]:
    """Return the seconds of a frame by name, Lift-Splat-Shoot first."""
    lss = build("lss", model.spec).eval()
    plan, images = lss.plan([rig]), torch.from_numpy(clip[0][IMAGES])
    ways: dict[str, Callable[[], object]] = {"lss": lambda: lss(images, plan)}
    ways |= {name: (lambda run=run: run(clip[0])) for name, run in runners.items()}  # type: ignore[misc]
    with torch.inference_mode():
        return list(zip(ways, medians_s(list(ways.values())), strict=True))


def main() -> None:
    """Parse arguments, export, compare, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("calibration", type=Path)
    parser.add_argument("root", type=Path)
    parser.add_argument("--weights", type=Path, help="weights file; default: the shipped weights")
    parser.add_argument("--scenes", type=int, default=16, help="number of scenes of ROOT (16)")
    options = parser.parse_args()
    torch.set_num_threads(1)
    model, card = load_model(weights_file(options.weights))
    calibration = Dataset(options.calibration)
    source = source_from_inputs(dataset_inputs(calibration, calibration.scenes), "calibration")
    fit = source.rig.with_cameras(fit_camera(camera, model.spec) for camera in used_cameras(model, source.rig))
    with tempfile.TemporaryDirectory() as folder:
        xml, values, _ = export_int8(options.weights, source, Path(folder) / "int8.xml").files
        runners = {"float32, torch": torch_runner(model, fit), "int8, OpenVINO": open_openvino(xml, values, 1)}
        counts = {name: np.zeros((2, len(CLASSES))) for name in runners}
        for clip, truths in clips_with_truth(options.root, model, options.scenes):
            for name, run in runners.items():
                for outputs, on in zip(run_clip(run, clip), truths, strict=True):
                    mine = occupied(outputs, read_thresholds(card))
                    counts[name] += (mine & on).sum((1, 2)), (mine | on).sum((1, 2))
        times = time_table(model, fit, runners, clip)
    table = Table("network", *(f"IoU {name}" for name in CLASSES), "ms", "times faster")
    for name, seconds in times:
        shares = 100 * counts[name][0] / counts[name][1] if name in counts else []
        cells = [f"{share:.2f}" for share in shares] or [""] * len(CLASSES)
        table.add_row(name, *cells, f"{seconds * 1e3:.0f}", f"{times[0][1] / seconds:.2f}")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
