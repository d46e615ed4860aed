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


@numba.njit(cache=True, nogil=True)
def cells_to_marking(
    marking: BoolArray, cells: IntArray, angle_rad: FloatArray, wanted: FloatArray, reach: float
) -> FloatArray:
    """Return how far the marking nearest to a wanted distance (N,) is from cells (N, 2) in directions (N,), in cells.

    Where no marking lies within `reach` of the wanted distance, that itself is returned.
    """
    found = wanted.copy()
    for n in range(len(cells)):
        least = reach
        di, dj = np.cos(angle_rad[n]), np.sin(angle_rad[n])
        far = wanted[n] - reach
        while far <= wanted[n] + reach:
            i, j = int(np.rint(cells[n, 0] + far * di)), int(np.rint(cells[n, 1] + far * dj))
            on_map = 0 <= i < marking.shape[0] and 0 <= j < marking.shape[1]
            if on_map and marking[i, j] and abs(far - wanted[n]) < least:
                least, found[n] = abs(far - wanted[n]), far
            far += 0.5
    return found
