"""Small predicted-up maps to compare."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from appocc.bevmap import BEVMap
from appocc.grid import BEVGrid

GRID = BEVGrid(-20.0, 20.0, -20.0, 20.0, 1.0)
Cells = tuple[int, slice, slice]


def bev(
    on: Mapping[int, tuple[slice, slice]] | None = None,
    value: float = 1.0,
    rgb: tuple[int, int, int] = (100, 100, 100),
    grid: BEVGrid = GRID,
    meta: Mapping[str, Any] | None = None,
) -> BEVMap:
    """A map of one colour; `on` gives each layer a rectangle of cells with a probability."""
    occupancy = np.zeros((3, *grid.shape), np.float32)
    for layer, cells in (on or {}).items():
        occupancy[layer][cells] = value
    colours = np.broadcast_to(np.array(rgb, np.uint8)[:, None, None], (3, *grid.shape)).copy()
    known = np.ones((3, *grid.shape), np.bool_)
    return BEVMap(grid, occupancy, known, colours, known[0].copy(), meta or {})


def without(map_: BEVMap, cells: tuple[slice, slice]) -> BEVMap:
    """The same map with some cells not known, neither what is there nor which colour."""
    valid, coloured = map_.occupancy_valid.copy(), map_.appearance_valid.copy()
    valid[(slice(None), *cells)], coloured[cells] = False, False
    return BEVMap(map_.grid, map_.occupancy, valid, map_.appearance, coloured, map_.meta)
