"""Fixed-radius neighbour search in the plane."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray, IntArray
from tracking.compiled import compiled


def find_neighbours(points: FloatArray, others: FloatArray, radius_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Find all pairs of points (N, 2) and others (M, 2) within the radius (N,) of the point.

    Returns:
        (P,), (P,) indices of points, ascending, and of others.
    """
    if not (len(points) and len(others)):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    # Sorted by x, only a few others have to be looked at. Copies, because each memory layout is compiled for itself.
    order = others[:, 0].argsort(kind="stable")
    given = points.copy(), others.take(order, axis=0), order, radius_m
    pairs = np.empty((2, 2 * len(points) + 8), np.int64)
    count = _search(*given, pairs)
    if count > pairs.shape[1]:
        pairs = np.empty((2, count), np.int64)
        _search(*given, pairs)
    rows, columns = pairs[:, :count]
    return rows, columns


@compiled
def _search(points: FloatArray, others: FloatArray, order: IntArray, radius_m: FloatArray, pairs: IntArray) -> int:
    """Write the pairs of `find_neighbours` to `pairs` (2, K) as far as there is room, and return their number.

    The others (M, 2) are sorted by x; `order` (M,) are their indices.
    """
    size = 0
    for n in range(len(points)):
        x, y, radius = points[n, 0], points[n, 1], radius_m[n]
        low, high = 0, len(others)
        while low < high:  # bisection
            middle = (low + high) // 2
            if others[middle, 0] < x - radius:
                low = middle + 1
            else:
                high = middle
        while low < len(others) and others[low, 0] <= x + radius:
            if (others[low, 0] - x) ** 2 + (others[low, 1] - y) ** 2 <= radius * radius:
                if size < pairs.shape[1]:
                    pairs[0, size], pairs[1, size] = n, order[low]
                size += 1
            low += 1
    return size
