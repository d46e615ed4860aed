"""A tiny dataset with maps, small enough to pack in a moment, and packs of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tiny_dataset import TinyDataset, token

from appocc.bevmap import BEVMap, bev_path
from appocc.grid import BEVGrid
from appocc.models.model_spec import ModelSpec

GRID = BEVGrid(-8, 8, -8, 8, 0.4)
# The tiny dataset has pictures of 32x20: four rows are cut off above and none below.
SETTING = ModelSpec("tiny", ("CAM_BACK", "CAM_FRONT", "CAM_LEFT"), GRID, 32, 16)
TOKENS = tuple(token("sample", i) for i in range(3))


def made_map(number: int, grid: BEVGrid = GRID) -> BEVMap:
    """A map of random cells."""
    rng, (x, y) = np.random.default_rng(number), grid.shape
    valid = rng.random((4, x, y)) < 0.8
    occupancy = (rng.random((3, x, y)) < 0.3).astype(np.float32)
    appearance = rng.integers(0, 256, (3, x, y)).astype(np.uint8)
    return BEVMap(grid, occupancy, valid[:3], appearance * valid[3], valid[3])


def with_maps(tiny: TinyDataset, grid: BEVGrid = GRID) -> Path:
    """The tiny dataset with a map of source `exact` for every sample, and pictures that differ; its root."""
    for number, name in enumerate(TOKENS):
        made_map(number, grid).save(bev_path(tiny.root, "exact", name))
    return tiny.root
