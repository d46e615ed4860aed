"""Robust colour of vehicle instances."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray

# With fewer inner cells than this, all cells of an instance are used.
MIN_INNER_CELLS = 4


def robust_lab(lab: FloatArray, inside: BoolArray, member: IntArray, count: int) -> FloatArray:
    """Return the colour (N, 3) of `count` groups: the mean of the lighter half without the lightest tenth.

    Windows and shadows are darker than paint; lamps and highlights are lighter and few. Cells at the boundary mix
    with the surroundings, so only `inside` cells are used if there are at least MIN_INNER_CELLS.

    Args:
        lab: (C, 3) CIELAB colours of cells.
        inside: (C,) cells whose four neighbours belong to the same group.
        member: (C,) group of each cell, 0..count - 1.
        count: number of groups.

    Returns:
        CIELAB; NaN for groups without cells.
    """
    enough = np.bincount(member[inside], minlength=count) >= MIN_INNER_CELLS
    used = inside | ~enough[member]
    lab, member = lab[used], member[used]
    order = np.lexsort((lab[:, 0], member))
    lab, member = lab[order], member[order]
    size = np.bincount(member, minlength=count)
    rank = np.arange(len(member)) - (np.cumsum(size) - size)[member]
    dark, highlights = size // 2, size // 10
    paint = (rank >= dark[member]) & (rank < (size - highlights)[member])
    sums = np.stack([np.bincount(member[paint], channel[paint], count) for channel in lab.T], axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(sums / (size - dark - highlights)[:, None])
