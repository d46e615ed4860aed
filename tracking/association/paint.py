"""Vehicles' colours: the robust one of cells, and how frequent colours are."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray

# Vehicles' paints: what they spread about, and how far; the white, grey and black ones, and all others.
_MIDDLE = np.array([55.0, 0.0, 0.0])
_SPREADS = np.array([[30.0, 4.0, 5.0], [30.0, 25.0, 25.0]])
_PEAKS = np.array([0.7, 0.3]) / _SPREADS.prod(axis=1)
_SHARPNESS = (1 / _SPREADS**2).T / 2
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


def paint_density(lab: FloatArray) -> FloatArray:
    """(N,) how frequent colours (N, 3) are among vehicles: densities, but for a Gaussian's factors of 2 pi."""
    return np.asarray(np.exp(-((lab - _MIDDLE) ** 2 @ _SHARPNESS)) @ _PEAKS)
