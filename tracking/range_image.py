"""Range image: which objects are hidden from the ego by nearer ones."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray
from tracking.compiled import compiled

# Number of bearings: at 70 m, a car is eight of them wide.
_BEARINGS = 2048
# A box hides what is farther from the ego than its centre by at least this distance.
_BEHIND_M = 2.0


class RangeImage:
    """Distance from the ego to the nearest box at each bearing."""

    def __init__(self, xy_m: FloatArray, yaw_rad: FloatArray, size_m: FloatArray, solid: BoolArray) -> None:
        """Draw boxes.

        Args:
            xy_m: (M, 2 or more) positions in the ego frame.
            yaw_rad: (M,) headings.
            size_m: (M, 2 or more) widths and lengths.
            solid: (M,) boxes that hide others.
        """
        self._range_m = np.full(_BEARINGS, np.inf)
        _draw(self._range_m, xy_m, yaw_rad, size_m, solid)

    def hidden(self, xy_m: FloatArray, size_m: FloatArray) -> FloatArray:
        """Return the shares (N,), 0..1, of the widths of objects that nearer boxes hide.

        Args:
            xy_m: (N, 2 or more) positions in the ego frame.
            size_m: (N, 2 or more) widths and lengths.
        """
        share = np.empty(len(xy_m))
        _measure(self._range_m, xy_m.copy(), size_m.copy(), share)
        return share


@compiled
def _draw(range_m: FloatArray, xy_m: FloatArray, yaw_rad: FloatArray, size_m: FloatArray, solid: BoolArray) -> None:
    """Write the distances of the nearest boxes to `range_m` (B,)."""
    per_rad = _BEARINGS / (2 * np.pi)
    for m in range(len(yaw_rad)):
        if not solid[m]:
            continue
        bearing, distance_m = np.arctan2(xy_m[m, 1], xy_m[m, 0]), np.hypot(xy_m[m, 0], xy_m[m, 1])
        ahead, aside = abs(np.cos(yaw_rad[m] - bearing)), abs(np.sin(yaw_rad[m] - bearing))
        half = np.arctan2((ahead * size_m[m, 0] + aside * size_m[m, 1]) / 2, distance_m)
        for k in range(round((bearing - half) * per_rad), round((bearing + half) * per_rad)):
            range_m[k % _BEARINGS] = min(range_m[k % _BEARINGS], distance_m)


@compiled
def _measure(range_m: FloatArray, xy_m: FloatArray, size_m: FloatArray, share: FloatArray) -> None:
    """See `RangeImage.hidden`; written to `share` (N,)."""
    per_rad = _BEARINGS / (2 * np.pi)
    for n in range(len(share)):
        bearing, distance_m = np.arctan2(xy_m[n, 1], xy_m[n, 0]), np.hypot(xy_m[n, 0], xy_m[n, 1])
        half = np.arctan2(size_m[n, 0] / 2, distance_m)
        first, end = round((bearing - half) * per_rad), round((bearing + half) * per_rad)
        count = 0
        for k in range(first, end):
            count += range_m[k % _BEARINGS] <= distance_m - _BEHIND_M
        share[n] = count / max(end - first, 1)
