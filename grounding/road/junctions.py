"""Find junctions on a map: where the middle lines of three or more roads meet."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage
from skimage.morphology import skeletonize

from appocc.checks import BoolArray, FloatArray
from appocc.grid import BEVGrid

# A narrower arm is a driveway. An arm is followed this far beyond the kerbs of the junction.
_LEAST_ARM_M, _ARM_M = 4.4, 9.0
# A junction reaches this far beyond the circle that touches its kerbs: the kerbs are rounded.
_BEYOND_M = 5.0
_EIGHT = np.ones((3, 3), np.uint8)


def find_junctions(grid: BEVGrid, drivable: BoolArray, edge_m: FloatArray) -> BoolArray:
    """Return the cells (X, Y) in junctions, driveways not included.

    Args:
        grid: cells.
        drivable: (X, Y) road cells, with or without vehicles.
        edge_m: (X, Y) distance to the road edge.
    """
    middle = skeletonize(drivable & (edge_m > _LEAST_ARM_M / 2))
    neighbours = cv2.filter2D(middle.astype(np.uint8), -1, _EIGHT, borderType=cv2.BORDER_CONSTANT) - 1
    forks, count = ndimage.label(middle & (neighbours >= 3), _EIGHT)
    found = np.zeros(grid.shape, np.bool_)
    i, j = np.indices(grid.shape)
    for a, b in ndimage.center_of_mass(forks > 0, forks, range(1, count + 1)):
        radius_m = float(edge_m[round(a), round(b)])
        away_m = np.hypot(i - a, j - b) * grid.cell_m
        if _count_arms(middle, away_m, radius_m, grid.cell_m) >= 3:
            found |= away_m < radius_m + _BEYOND_M
    return np.asarray(found & drivable)


def _count_arms(middle: BoolArray, away_m: FloatArray, radius_m: float, cell_m: float) -> int:
    """Return how many arms of the middle line lead from a fork as far as beyond its kerbs, or off the map."""
    far_m = radius_m + _ARM_M
    near, _ = ndimage.label(middle & (away_m < far_m), _EIGHT)
    at_fork = np.unique(near[middle & (away_m < 2 * cell_m)])
    connected = np.isin(near, at_fork[at_fork > 0])
    arms, count = ndimage.label(connected & (away_m > radius_m), _EIGHT)
    if not count:
        return 0
    ends = np.asarray(ndimage.maximum(away_m, arms, range(1, count + 1))) > far_m - 2 * cell_m
    border = np.zeros_like(middle)
    border[:3], border[-3:], border[:, :3], border[:, -3:] = True, True, True, True
    return int((ends | np.asarray(ndimage.maximum(border, arms, range(1, count + 1)), dtype=np.bool_)).sum())
