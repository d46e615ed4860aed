"""Depth and class of what each camera sees, at an eighth of the picture's size: extra targets for training."""

from __future__ import annotations

import numba
import numpy as np

from appocc.checks import ByteArray, Float32Array
from appocc.nuscenes.view_targets import BLOCK_PX, ViewTargets


def reduce_view(depth_m: Float32Array, kind: ByteArray, factor: int = BLOCK_PX) -> ViewTargets:
    """Reduce each block of factor x factor pixels to its most frequent class and the median depth of that class.

    A mean across the edge of a car would be a depth at which nothing is. Among equally frequent classes the nearest
    one wins. Blocks at the right and lower edge may be incomplete.

    Args:
        depth_m: (H, W) float32, infinite in the sky.
        kind: (H, W) uint8.
        factor: side length of a block in pixels.
    """
    depth, common = _reduce(depth_m, kind, factor)
    with np.errstate(over="ignore"):
        return ViewTargets(depth.astype(np.float16), common)


def reduce_classes(kind: ByteArray) -> ViewTargets:
    """Reduce each block of 8 x 8 pixels of (H, W) uint8 classes to the most frequent one; depth is unknown.

    Pixels that are not labelled count as a class. Among equally frequent classes the first one wins.
    """
    return ViewTargets(None, _reduce(np.zeros(kind.shape, np.float32), kind, BLOCK_PX)[1])


@numba.njit(cache=True, nogil=True)
def _reduce(depth: Float32Array, kind: ByteArray, factor: int) -> tuple[Float32Array, ByteArray]:
    """Return the median depth of the most frequent class of each block, and that class."""
    high, wide = depth.shape
    rows, columns = (high + factor - 1) // factor, (wide + factor - 1) // factor
    median, common = np.empty((rows, columns), np.float32), np.empty((rows, columns), np.uint8)
    count, nearest = np.zeros(256, np.int64), np.empty(256, np.float32)
    chosen = np.empty(factor * factor, np.float32)
    for i in range(rows):
        for j in range(columns):
            bottom, right = min((i + 1) * factor, high), min((j + 1) * factor, wide)
            best = kind[i * factor, j * factor]
            for r in range(i * factor, bottom):
                for c in range(j * factor, right):
                    k = kind[r, c]
                    nearest[k] = depth[r, c] if count[k] == 0 else min(nearest[k], depth[r, c])
                    count[k] += 1
            for r in range(i * factor, bottom):
                for c in range(j * factor, right):
                    k = kind[r, c]
                    if count[k] > count[best] or (count[k] == count[best] and nearest[k] < nearest[best]):
                        best = k
            n = 0
            for r in range(i * factor, bottom):
                for c in range(j * factor, right):
                    count[kind[r, c]] = 0
                    if kind[r, c] == best:
                        at = n
                        while at > 0 and chosen[at - 1] > depth[r, c]:
                            chosen[at] = chosen[at - 1]
                            at -= 1
                        chosen[at] = depth[r, c]
                        n += 1
            # The lower of the two middle values: a depth that occurs.
            median[i, j] = chosen[(n - 1) // 2]
            common[i, j] = best
    return median, common
