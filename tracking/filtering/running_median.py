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
        self._last = np.zeros((0, values, window))
        self.count = np.zeros(0, dtype=np.int64)
        self.median = np.zeros((0, values))
        self.known = np.zeros((0, values))
        self.squared_deviation = np.zeros((0, values))

    def add(self, values: FloatArray) -> None:
        """Add tracks with the values (M, K) of their first detections; NaN if unknown."""
        fresh = np.full((*values.shape, self._last.shape[2]), np.nan)
        fresh[..., 0] = values
        self._last = np.concatenate([self._last, fresh])
        self.count = np.concatenate([self.count, np.ones(len(values), np.int64)])
        self.median = np.concatenate([self.median, values])
        self.known = np.concatenate([self.known, np.isfinite(values)])
        self.squared_deviation = np.concatenate([self.squared_deviation, np.zeros_like(values)])

    def keep(self, mask: BoolArray) -> None:
        """Keep the tracks of a mask (N,)."""
        self.count = self.count[mask]
        self._last, self.median, self.known, self.squared_deviation = (
            each.compress(mask, axis=0) for each in (self._last, self.median, self.known, self.squared_deviation)
        )

    def update(self, rows: IntArray, values: FloatArray) -> None:
        """Append values (M, K) of new detections to tracks (M,)."""
        _append(self._last, self.count, self.median, self.known, self.squared_deviation, rows, values)


@compiled
def _append(
    last: FloatArray,
    count: IntArray,
    median: FloatArray,
    known: FloatArray,
    squared_deviation: FloatArray,
    rows: IntArray,
    values: FloatArray,
) -> None:
    """See `RunningMedian.update`; all but the last two arguments are changed in place."""
    window = last.shape[2]
    ordered = np.empty(window)
    for m, n in enumerate(rows):
        slot = count[n] % window
        count[n] += 1
        for k in range(values.shape[1]):
            last[n, k, slot] = values[m, k]
            size = 0
            for value in last[n, k]:  # insertion sort
                if not np.isnan(value):
                    place = size
                    while place and ordered[place - 1] > value:
                        ordered[place] = ordered[place - 1]
                        place -= 1
                    ordered[place] = value
                    size += 1
            known[n, k], squared_deviation[n, k] = size, 0.0
            median[n, k] = (ordered[(size - 1) // 2] + ordered[size // 2]) / 2 if size else np.nan
            for value in ordered[:size]:
                squared_deviation[n, k] += (value - median[n, k]) ** 2
