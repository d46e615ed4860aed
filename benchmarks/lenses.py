"""The same drives seen by pinholes, by distorting lenses and by fisheyes: IoU of the maps predicted from each.

    OMP_NUM_THREADS=2 python -m benchmarks.lenses FOLDER [--scenes 8] [--frames 2] [--weights F] [--json]

Simulates drives through the towns that are not in the training data, once for each rig: two of `benchmarks/rigs` and
the shipped fisheyes, below FOLDER; finished datasets are used as they are. The pictures of lenses are taken ray by
ray and go the way of a user's: `raw/SCENE/FRAME/CAMERA.jpg`, read, rectified, predicted. IoU is in percent, at the
thresholds of each map, over all cells of the grid, and over those within 20 m; the true maps are the same for all.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.table import Table

from appocc.bevmap import CLASSES
from appocc.environment import cores
from appocc.errors import AppoccError
from appocc.evaluation.cells import GROUPS, CellCounts, ious
from appocc.frame import Frame
from appocc.inference.inputs import folder_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.predictor import Predictor
from appocc.nuscenes import Dataset
from appocc.rigs import SourceRig, read_source_rig
from appocc.simulation.generate import DatasetSettings, simulate
from appocc.simulation.recording import RAW, RecordingSettings
from appocc.simulation.scenario import WEATHER_SHARES
from appocc.simulation.sources import town_sources
from appocc.workers import worker_pool
from benchmarks.predicted_maps import compare

FOLDER = Path(__file__).parent / "rigs"
RIGS: dict[str, str | Path] = {
    "pinhole": FOLDER / "pinhole.yaml",
    "distorted": FOLDER / "distorted.yaml",
    "fisheye": "fisheye",
}
# Samples are this far apart, so that the frames of a drive differ.
HZ, SEED = 0.2, 0
OVER = {"all": ("all",), "within 20 m": ("0-10 m", "10-20 m")}

Scores = dict[str, dict[str, float]]


def record(root: Path, rig: SourceRig, scenes: int, frames: int) -> Dataset:
    """Return the dataset of a rig; simulate it if it is not there.

    Raises:
        DataError: if the folder holds something else.
    """
    recording = RecordingSettings(frames, HZ, rig.rig, lidar=False, source=None if rig.is_pinhole else rig)
    settings = DatasetSettings(scenes, town_sources("test", ()), tuple(WEATHER_SHARES), SEED, recording)
    console = Console(stderr=True)
    with worker_pool(min(cores(), 2)) as pool:
        simulate(root, settings, pool, lambda count: None, console.print)
    return Dataset(root)


def frames_of(dataset: Dataset, rig: SourceRig) -> Iterator[Frame]:
    """Yield the frames of a dataset; the pictures of lenses are read as they were taken, and rectified."""
    for scene in dataset.scenes:
        samples = dataset.samples(scene)
        if rig.is_pinhole:
            yield from (dataset.frame(sample) for sample in samples)
        else:
            raw = folder_inputs(dataset.root / RAW / scene.name, rig)
            yield from (replace(raw[i].read().frame, token=sample.token) for i, sample in enumerate(samples))


def score(dataset: Dataset, rig: SourceRig, predictor: Predictor) -> Scores:
    """Return the IoU by group of cells and class."""
    counts = CellCounts.zeros(1)
    frames = list(frames_of(dataset, rig))
    for frame in track(frames, dataset.root.name, console=Console(stderr=True), transient=True):
        counts = counts.plus(compare(predictor, frame, dataset.root, "exact").counts)
    rows = {over: [GROUPS.index(name) for name in names] for over, names in OVER.items()}
    return {over: ious(counts.overlap[0, row].sum(axis=0)) for over, row in rows.items()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Simulate, predict and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument("--frames", type=int, default=2, help="frames of each scene (2)")
    parser.add_argument("--weights", type=Path, help="weights file; default: the shipped weights")
    parser.add_argument("--json", action="store_true", help="print JSON; shares are 0..1")
    options = parser.parse_args(arguments)
    predictor = load_predictor(options.weights)
    found: dict[str, Scores] = {}
    try:
        for name, rig_name in RIGS.items():
            rig = read_source_rig(rig_name)
            dataset = record(options.folder / name, rig, options.scenes, options.frames)
            found[name] = score(dataset, rig, predictor)
    except AppoccError as error:
        parser.error(str(error))
    if options.json:
        print(json.dumps(found))
        return
    table = Table("rig", *(f"{name}, {over}" for over in OVER for name in CLASSES))
    for rig_name, scores in found.items():
        table.add_row(rig_name, *(f"{100 * scores[over][name]:.1f}" for over in OVER for name in CLASSES))
    Console().print(table)


if __name__ == "__main__":
    main()
