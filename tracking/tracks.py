"""Tracks: what the tracker knows of a vehicle at one moment, and the memory behind its size and colour."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from appocc.checks import FloatArray, check_finite, check_shape, frozen
from appocc.errors import ShapeError


@dataclass(frozen=True)
class Track:
    """One vehicle at one moment, in the world frame.

    Attributes:
        id: whole number from 1, the same for the vehicle over time.
        position_world_m: (3,) point on the ground below its centre.
        velocity_world_mps: (2,) horizontal velocity.
        yaw_world_rad: heading in [-pi, pi); if not `heading_known`, the rear may be where the front is said to be.
        heading_known: whether motion has told front from rear.
        length_m: median over the last sightings.
        width_m: the same.
        rgb: (3,) median mean sRGB 0..255 over the last sightings, NaN if never seen.
        score: mean vehicle probability of its blobs.
        seen: whether a blob was matched at this moment; otherwise the place is predicted.
    """

    id: int
    position_world_m: FloatArray
    velocity_world_mps: FloatArray
    yaw_world_rad: float
    heading_known: bool
    length_m: float
    width_m: float
    rgb: FloatArray
    score: float
    seen: bool

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit, place or velocity are not finite, or the size is not positive.
        """
        for name, size in (("position_world_m", 3), ("velocity_world_mps", 2), ("rgb", 3)):
            array = getattr(self, name)
            check_shape(f"track {name}", array, (size,))
            if name != "rgb":
                check_finite(f"track {name}", array)
            frozen(array)
        if not (self.length_m > 0 and self.width_m > 0):
            raise ShapeError(f"track {self.id}: expected a positive size, got {self.length_m} x {self.width_m} m")

    @property
    def speed_mps(self) -> float:
        """Speed over ground."""
        return float(np.hypot(*self.velocity_world_mps))


class Memory:
    """Medians over the last sightings: one that saw two vehicles as one, or half a vehicle, does not count."""

    def __init__(self, sightings: int) -> None:
        """Start with nothing known."""
        self._rows: deque[FloatArray] = deque(maxlen=sightings)

    def add(self, values: FloatArray) -> None:
        """Remember one sighting (K,), NaN where it shows nothing of a value."""
        self._rows.append(values)

    def median(self) -> FloatArray:
        """(K,) median of each value, NaN where no sighting showed it."""
        rows = np.stack(self._rows)
        result = np.full(rows.shape[1], np.nan)
        known = np.isfinite(rows).any(axis=0)
        result[known] = np.nanmedian(rows[:, known], axis=0)
        return result
