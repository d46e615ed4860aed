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
        # Median, number of known values, sum of squared deviations, and the values in the window.
        self._state = np.zeros((0, values, 3 + window))

    @property
    def median(self) -> FloatArray:
        """See `RunningMedian`."""
        return self._state[..., 0]

    @property
    def known(self) -> FloatArray:
        """See `RunningMedian`."""
        return self._state[..., 1]

    @property
    def squared_deviation(self) -> FloatArray:
        """See `RunningMedian`."""
        return self._state[..., 2]

    def add(self, values: FloatArray) -> None:
        """Add tracks with the values (M, K) of their first detections; NaN if unknown."""
        fresh = np.full((*values.shape, self._state.shape[2]), np.nan)
        fresh[..., 0] = fresh[..., 3] = values
        fresh[..., 1], fresh[..., 2] = np.isfinite(values), 0.0
        self._state = np.concatenate([self._state, fresh])
        self.count = np.concatenate([self.count, np.ones(len(values), np.int64)])

    def keep(self, mask: BoolArray) -> None:
        """Keep the tracks of a mask (N,)."""
        self.count, self._state = self.count[mask], self._state.compress(mask, axis=0)

    def update(self, rows: IntArray, values: FloatArray) -> None:
        """Append values (M, K) of new detections to tracks (M,)."""
        _append(self._state, self.count, rows, values, np.empty(self._state.shape[2]))


@compiled
def _append(state: FloatArray, count: IntArray, rows: IntArray, values: FloatArray, ordered: FloatArray) -> None:
    """See `RunningMedian.update`; states (N, K, 3 + window) and counts (N,) are changed in place.

    `ordered` is room for the values of a window.
    """
    window = state.shape[2] - 3
    for m, n in enumerate(rows):
        slot = count[n] % window
        count[n] += 1
        for k in range(values.shape[1]):
            state[n, k, 3 + slot] = values[m, k]
            size = 0
            for index in range(window):  # insertion sort
                value = state[n, k, 3 + index]
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
            state[n, k, 0], state[n, k, 1], state[n, k, 2] = median, size, squared_deviation
