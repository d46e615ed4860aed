"""Fixed-radius neighbour search in the plane."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from appocc.checks import FloatArray, IntArray

# Up to this many pairs, computing all distances is fastest.
_MAX_ALL_PAIRS = 5000


def find_neighbours(points: FloatArray, others: FloatArray, radius_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Find all pairs of points (N, 2) and others (M, 2) within the radius (N,) of the point.

    Large inputs are sorted by x, searched along x, and then filtered by y. Up to 500 points this is two to three
    times faster than scipy's `cKDTree`, which also takes only one radius.

    Returns:
        (P,), (P,) indices of points, ascending, and of others.
    """
    if len(points) * len(others) <= _MAX_ALL_PAIRS:
        inside = cdist(points, others, "sqeuclidean") <= (radius_m * radius_m)[:, None]
        (flat,) = inside.reshape(-1).nonzero()  # faster than nonzero of a 2D array
        rows = flat // len(others)
        return rows, flat - rows * len(others)
    order = others[:, 0].argsort(kind="stable")
    x, y = others[order].T
    first = x.searchsorted(points[:, 0] - radius_m)
    count = x.searchsorted(points[:, 0] + radius_m, side="right") - first
    rows = np.arange(len(points)).repeat(count)
    sorted_columns = np.arange(len(rows)) + (first + count - count.cumsum()).repeat(count)
    close_in_y = np.abs(y[sorted_columns] - points[:, 1].repeat(count)) <= radius_m.repeat(count)
    rows, columns = rows[close_in_y], order[sorted_columns[close_in_y]]
    offset = others[columns] - points[rows]
    inside = np.hypot(offset[:, 0], offset[:, 1]) <= radius_m[rows]
    return rows[inside], columns[inside]
