"""Distances to the road edge, compiled."""

from __future__ import annotations

import numba
import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray


@numba.njit(cache=True, nogil=True)
def cells_to_edge(drivable: BoolArray, cells: IntArray, angle_rad: FloatArray, most: float) -> FloatArray:
    """Return how many cells the road goes on (N,), to half a cell, from cells (N, 2) in directions (N,), at most."""
    found = np.zeros(len(cells))
    steps = int(most * 2)
    for n in range(len(cells)):
        i0, j0 = cells[n, 0], cells[n, 1]
        if not drivable[i0, j0]:
            continue
        di, dj = np.cos(angle_rad[n]) / 2, np.sin(angle_rad[n]) / 2
        count = 0
        while count < steps:
            i, j = int(np.rint(i0 + (count + 1) * di)), int(np.rint(j0 + (count + 1) * dj))
            if i < 0 or j < 0 or i >= drivable.shape[0] or j >= drivable.shape[1] or not drivable[i, j]:
                break
            count += 1
        found[n] = count / 2
    return found
