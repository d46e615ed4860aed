"""The robust colour of a vehicle's cells."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray

# Fewer cells inside a blob than this say less than all of its cells.
LEAST_INSIDE = 4


def robust_lab(lab: FloatArray, inside: BoolArray, member: IntArray, count: int) -> FloatArray:
    """(N, 3) colour of each of `count` groups of cells: the mean of the lighter half without the lightest tenth.

    Windows and shadow are darker than paint; lamps and glints are lighter, and few. The rim of a group is mixed with
    what lies around it: only cells `inside` count where there are LEAST_INSIDE of them.

    Args:
        lab: (C, 3) colours of cells, CIELAB.
        inside: (C,) whether all cells beside a cell are of its group.
        member: (C,) group of each cell, 0..count - 1.
        count: number of groups.

    Returns:
        CIELAB; NaN of groups without cells.
    """
    enough = np.bincount(member[inside], minlength=count) >= LEAST_INSIDE
    taken = inside | ~enough[member]
    lab, member = lab[taken], member[taken]
    order = np.lexsort((lab[:, 0], member))
    lab, member = lab[order], member[order]
    size = np.bincount(member, minlength=count)
    rank = np.arange(len(member)) - (np.cumsum(size) - size)[member]
    dark, glints = size // 2, size // 10
    paint = (rank >= dark[member]) & (rank < (size - glints)[member])
    sums = np.stack([np.bincount(member[paint], channel[paint], count) for channel in lab.T], axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(sums / (size - dark - glints)[:, None])
