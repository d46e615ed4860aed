"""Fill polygons in rasters of 0.1 m: a cell belongs to a polygon if its centre is inside."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array, FloatArray
from appocc.simulation.surface import CELL_M

Int32Array = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Canvas:
    """A raster (H, W, C) uint8 whose cell (0, 0) has its lower corner at `low_m` (2,), town frame.

    OpenCV's polygons include every cell their outline touches, which doubles the width of a line of 0.15 m; here a
    line has its true area.
    """

    low_m: FloatArray
    raster: ByteArray

    def fill(self, areas_m: Iterable[FloatArray], value: int, channel: int = 0) -> None:
        """Set the cells inside areas (P, 2), or stacks of areas (K, P, 2), town frame."""
        self._draw(list(areas_m), value, channel, False)

    def add(self, areas_m: Iterable[FloatArray], value: int, channel: int = 0) -> None:
        """Add to the cells inside areas (P, 2), or stacks (K, P, 2), town frame; the sum is clipped to 0..255."""
        self._draw(list(areas_m), value, channel, True)

    def _draw(self, areas_m: Sequence[FloatArray], value: int, channel: int, adding: bool) -> None:
        if not areas_m:
            return
        sizes = np.repeat([a.shape[-2] for a in areas_m], [a.shape[0] if a.ndim == 3 else 1 for a in areas_m])
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
        points = ((np.concatenate([a.reshape(-1, 2) for a in areas_m]) - self.low_m) / CELL_M).astype(np.float32)
        _fill(self.raster, channel, points, starts, int(value), adding)  # a `Surface` would compile another variant


@numba.njit(cache=True, nogil=True)
def _fill(
    raster: ByteArray, channel: int, points: Float32Array, starts: Int32Array, value: int, adding: bool
) -> None:
    """Fill polygons by winding number, row by row, through the centres of the cells."""
    height, width = raster.shape[:2]
    for polygon in range(len(starts) - 1):
        first, last = starts[polygon], starts[polygon + 1]
        crossing = np.empty(last - first, np.float32)
        winding = np.empty(last - first, np.int32)
        low, high = np.inf, -np.inf
        for i in range(first, last):
            low, high = min(low, points[i, 1]), max(high, points[i, 1])
        for row in range(max(0, int(np.floor(low))), min(height, int(np.ceil(high)) + 1)):
            y = np.float32(row + 0.5)
            count = 0
            for i in range(first, last):
                j = i + 1 if i + 1 < last else first
                below, next_below = points[i, 1] <= y, points[j, 1] <= y
                if below == next_below:
                    continue
                share = (y - points[i, 1]) / (points[j, 1] - points[i, 1])
                x = points[i, 0] + share * (points[j, 0] - points[i, 0])
                k = count
                while k > 0 and crossing[k - 1] > x:
                    crossing[k], winding[k] = crossing[k - 1], winding[k - 1]
                    k -= 1
                crossing[k], winding[k] = x, 1 if below else -1
                count += 1
            turns = 0
            for k in range(count - 1):
                turns += winding[k]
                if turns == 0:
                    continue
                start = max(0, int(np.ceil(crossing[k] - 0.5)))
                end = min(width, int(np.ceil(crossing[k + 1] - 0.5)))
                for column in range(start, end):
                    new = raster[row, column, channel] + value if adding else value
                    raster[row, column, channel] = min(max(new, 0), 255)
