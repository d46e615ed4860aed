"""Running medians of track attributes, such as size and colour."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.compiled import compiled


class RunningMedian:
    """Medians of K values over the last detections of N tracks: robust against merged and partial detections.

    Attributes:
        count: (N,) number of detections so far, including those outside the window.
        median: (N, K) medians over the window; NaN if unknown.
        known: (N, K) number of known values in the window.
        squared_deviation: (N, K) sum of squared deviations from the median over known values.
    """

    def __init__(self, window: int, values: int) -> None:
        """Start with no tracks, for a window of detections and a number of values K."""
        self.count = np.zeros(0, dtype=np.int64)
        self._statistics = np.zeros((3, 0, values))
        self._window = np.zeros((0, values, window))

    @property
    def median(self) -> FloatArray:
        """See `RunningMedian`."""
        return self._statistics[0, ...]

    @property
    def known(self) -> FloatArray:
        """See `RunningMedian`."""
        return self._statistics[1, ...]

    @property
    def squared_deviation(self) -> FloatArray:
        """See `RunningMedian`."""
        return self._statistics[2, ...]

    def add(self, values: FloatArray) -> None:
        """Add tracks with the values (M, K) of their first detections; NaN if unknown."""
        window = np.full((*values.shape, self._window.shape[2]), np.nan)
        window[..., 0] = values
        statistics = np.zeros((3, *values.shape))
        statistics[0], statistics[1] = values, np.isfinite(values)
        self._window = np.concatenate([self._window, window])
        self._statistics = np.concatenate([self._statistics, statistics], axis=1)
        self.count = np.concatenate([self.count, np.ones(len(values), np.int64)])

    def keep(self, mask: BoolArray) -> None:
        """Keep the tracks of a mask (N,)."""
        self.count, self._window = self.count.compress(mask), self._window.compress(mask, axis=0)
        self._statistics = self._statistics.compress(mask, axis=1)

    def update(self, rows: IntArray, values: FloatArray) -> None:
        """Append values (M, K) of new detections to tracks (M,)."""
        _append(self._statistics, self._window, self.count, rows, values, np.empty(self._window.shape[2]))


@compiled
def _append(
    statistics: FloatArray,
    window: FloatArray,
    count: IntArray,
    rows: IntArray,
    values: FloatArray,
    ordered: FloatArray,
) -> None:
    """See `RunningMedian.update`; statistics (3, N, K), windows (N, K, W) and counts (N,) are changed in place.

    `ordered` (W,) is room for the values of a window.
    """
    for m, n in enumerate(rows):
        slot = count[n] % len(ordered)
        count[n] += 1
        for k in range(values.shape[1]):
            window[n, k, slot] = values[m, k]
            size = 0
            for index in range(len(ordered)):  # insertion sort
                value = window[n, k, index]
                if not np.isnan(value):
                    place = size
                    while place and ordered[place - 1] > value:
                        ordered[place] = ordered[place - 1]
                        place -= 1
                    ordered[place] = value
                    size += 1
            median = (ordered[(size - 1) // 2] + ordered[size // 2]) / 2 if size else np.nan
            squared_deviation = 0.0
            for index in range(size):
                squared_deviation += (ordered[index] - median) ** 2
            statistics[0, n, k], statistics[1, n, k], statistics[2, n, k] = median, size, squared_deviation
