"""A tiny dataset with maps: two vehicles that touch, one without an owner, a lane on a road, and unknown cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tiny_dataset import TinyDataset

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap, bev_path
from appocc.grid import BEVGrid
from appocc.nuscenes import Dataset
from appocc.packing.frames import PackSource

GRID = BEVGrid(-8.0, 8.0, -8.0, 8.0, 1.0)
INSTANCES = ["first", "second"]


def made_map() -> tuple[BEVMap, np.ndarray]:
    """The map and the vehicle of each cell: two in cells 1..4 x 2..3; in 10..11 x 10 is one without an owner."""
    occupancy = np.zeros((3, *GRID.shape), np.float32)
    valid = np.ones((3, *GRID.shape), np.bool_)
    occupancy[ROAD, :, :8], occupancy[LANE, :, 6] = 1, 1
    occupancy[VEHICLE, 1:5, 2:4] = occupancy[VEHICLE, 10:12, 10] = 1
    valid[:, :, 14:] = False
    valid[LANE, :, 13] = False
    instance = np.full(GRID.shape, -1, np.int16)
    instance[1:3, 2:4], instance[3:5, 2] = 0, 1  # cells 3..4 x 3 have no owner: the nearest is the second
    colour = np.full((3, *GRID.shape), 90, np.uint8)
    colour[0, 15, 15] = 200  # ahead and to the left
    meta = {"source": "simulated", "instances": INSTANCES}
    return BEVMap(GRID, occupancy, valid, colour, np.ones(GRID.shape, np.bool_), meta), instance


def made_source(tiny: TinyDataset, with_instance: bool = True) -> PackSource:
    """The key frames of the tiny dataset with this map each."""
    dataset = Dataset(tiny.write())
    bev, instance = made_map()
    for sample in dataset.samples(dataset.scenes[0]):
        path = bev_path(dataset.root, "exact", sample.token)
        path.parent.mkdir(parents=True, exist_ok=True)
        bev.save(path, {"instance": instance} if with_instance else {})
    return PackSource(dataset, dataset.scenes, "exact")


def contents(folder: Path) -> dict[str, bytes]:
    """All visible files of a folder."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith("."))
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}
