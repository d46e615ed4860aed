"""How good the maps of `appocc groundtruth` are: against the exact truth of a simulated dataset.

    python -m benchmarks.simulated_maps ROOT

ROOT is a folder that `appocc simulate` made, with LiDAR. The maps are made from pictures, LiDAR, boxes and the street
map only, as on a recording (source `groundtruth`), and compared with what the simulator knows (source `exact`).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.bevmap import CLASSES, VEHICLE, BEVMap, load_map
from appocc.checks import BoolArray, FloatArray
from appocc.environment import cores
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import Settings
from appocc.groundtruth.pipeline import generate
from appocc.nuscenes import Dataset

WHERE = ("all cells", "road, lane, vehicle", "vehicle")


def main(root: Path) -> None:
    dataset = Dataset(root)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        generate(dataset, dataset.scenes, out, Settings(BEVGrid.surround(), "robust"), cores(), lambda done: None)
        pairs = [
            (load_map(out, "groundtruth", sample.token), load_map(root, "exact", sample.token), scene.description)
            for scene in dataset.scenes
            for sample in dataset.samples(scene)
        ]
    table = Table(title=f"groundtruth against exact, {len(pairs)} samples")
    for title in (
        "weather",
        "samples",
        *(f"IoU {name}" for name in CLASSES),
        *(f"L1 {name}" for name in WHERE),
        "seen",
    ):
        table.add_column(title, justify="right")
    weathers = sorted({text.split(", ")[1] for *_, text in pairs})
    for weather in ("all", *weathers):
        chosen = [(made, exact) for made, exact, text in pairs if weather in ("all", text.split(", ")[1])]
        counts = np.sum([overlap(made, exact) for made, exact in chosen], axis=0)
        error = np.sum([difference(made, exact) for made, exact in chosen], axis=0)
        ious = (f"{inter / union:.3f}" if union else "-" for inter, union in counts)
        l1 = (f"{total / count:.1f}" if count else "-" for total, count in error)
        seen = np.mean([made.appearance_valid.mean() for made, _ in chosen])
        table.add_row(weather, str(len(chosen)), *ious, *l1, f"{seen:.2f}")
    Console(width=150).print(table)


def overlap(made: BEVMap, exact: BEVMap) -> FloatArray:
    """(3, 2) cells that are on in both, and in either, of those known in both."""
    known = made.occupancy_valid & exact.occupancy_valid
    a, b = made.occupancy >= 0.5, exact.occupancy >= 0.5
    return np.stack([(a & b & known).sum(axis=(1, 2)), ((a | b) & known).sum(axis=(1, 2))], axis=1).astype(float)


def difference(made: BEVMap, exact: BEVMap) -> FloatArray:
    """(3, 2) sum of |RGB| (0..255, mean of the channels) and number of cells with a colour in both, by `WHERE`."""
    known = made.appearance_valid & exact.appearance_valid
    error = np.abs(made.appearance.astype(float) - exact.appearance).mean(axis=0)
    on: BoolArray = exact.occupancy >= 0.5
    masks = (known, known & on.any(axis=0), known & on[VEHICLE])
    return np.array([[error[mask].sum(), mask.sum()] for mask in masks])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
