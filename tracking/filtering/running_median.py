"""Running medians of track attributes, such as size and colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, FloatArray, IntArray


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
        self._last = np.zeros((window, 0, values))  # sums over the window are fastest in this order
        self.count = np.zeros(0, dtype=np.int64)
        self.median = np.zeros((0, values))
        self.known = np.zeros((0, values))
        self.squared_deviation = np.zeros((0, values))

    def add(self, values: FloatArray) -> None:
        """Add tracks with the values (M, K) of their first detections; NaN if unknown."""
        fresh = np.full((len(self._last), *values.shape), np.nan)
        fresh[0] = values
        self._last = np.concatenate([self._last, fresh], axis=1)
        self.count = np.concatenate([self.count, np.ones(len(values), np.int64)])
        self.median = np.concatenate([self.median, values])
        self.known = np.concatenate([self.known, np.isfinite(values)])
        self.squared_deviation = np.concatenate([self.squared_deviation, np.zeros_like(values)])

    def keep(self, mask: BoolArray) -> None:
        """Keep the tracks of a mask (N,)."""
        self._last, self.count = self._last.compress(mask, axis=1), self.count[mask]
        self.median, self.known, self.squared_deviation = (
            each.compress(mask, axis=0) for each in (self.median, self.known, self.squared_deviation)
        )

    def update(self, rows: IntArray, values: FloatArray) -> None:
        """Append values (M, K) of new detections to tracks (M,)."""
        self._last[self.count[rows] % len(self._last), rows] = values
        self.count[rows] += 1
        last = self._last.take(rows, axis=1)
        is_known = np.isfinite(last)
        self.known[rows] = known = is_known.sum(axis=0, dtype=np.int32)
        self.median[rows] = median = _nan_median(last, known)
        deviation = last - median
        deviation[~is_known] = 0.0
        deviation *= deviation
        self.squared_deviation[rows] = deviation.sum(axis=0)


def _nan_median(last: FloatArray, known: NDArray[np.int32]) -> FloatArray:
    """(M, K) medians over the first axis of (S, M, K), given the number of known values (M, K); NaN if it is 0."""
    ordered = last.reshape(len(last), -1).T.copy()
    ordered.sort(axis=1)  # NaN come last
    first = np.arange(0, ordered.size, len(last)).reshape(known.shape)
    # With no known value, the second operand is NaN.
    return np.asarray((ordered.take(first + (known - 1) // 2) + ordered.take(first + known // 2)) / 2)
