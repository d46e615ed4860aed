"""Reference lines of a car that its parts share."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.actors.modelling import Modeller
from appocc.simulation.actors.profiles import CarProfile

# Half widths at the sill and at the shoulder as shares of the half width at the waist, away from the ends.
SHARE_LOW, SHARE_SHOULDER = 0.98, 0.955
# Stations of the profile's shoulder that each level of detail uses.
_STATIONS = ((0, 1, 2, 3, 4, 5, 6), (0, 2, 6), (0, 2, 6))


class CarFrame:
    """A car under construction; lines run from front to rear and from the centre to the left."""

    def __init__(self, model: Modeller, profile: CarProfile, detail: int) -> None:
        """Store the model, the profile and the level of detail."""
        self.model, self.profile, self.detail = model, profile, detail
        self.length, self.width, _ = profile.size_lwh_m
        self.full_line = np.array(profile.shoulder)
        self.line = self.full_line[list(_STATIONS[detail])]

    def half_width(self, x: FloatArray) -> FloatArray:
        """Return the half width at the waist; linear between the stations, so that finer parts leave no cracks."""
        return self._tapered(x, (0.97, 1.0, 1.0, 0.965))

    def shoulder_half_width(self, x: FloatArray) -> FloatArray:
        """Return the half width at the shoulder, where the ends are rounder than at the bumpers."""
        return self._tapered(x, (0.91, SHARE_SHOULDER, SHARE_SHOULDER, 0.88))

    def _tapered(self, x: FloatArray, shares: tuple[float, float, float, float]) -> FloatArray:
        front, rear = self.full_line[0, 0], self.full_line[-1, 0]
        stations = self.line[::-1, 0]
        rounded = np.interp(stations, [rear, rear + 0.35, front - 0.40, front], shares)
        return np.asarray(np.interp(x, stations, rounded) * self.width / 2)

    def shoulder(self, x: FloatArray) -> FloatArray:
        """Return the height of the shoulder."""
        return np.asarray(np.interp(-x, -self.line[:, 0], self.line[:, 1]))

    def waist(self, x: FloatArray) -> FloatArray:
        """Return the height of the widest line, which is below the shoulder everywhere."""
        return np.minimum(self.profile.waist_m, self.shoulder(x) - 0.11)


def points(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Stack coordinates into points (..., 3)."""
    return np.stack([x, y, z], axis=-1)
