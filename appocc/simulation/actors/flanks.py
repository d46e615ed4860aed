"""Sides of a car: wheel arches, sills and the floor."""

from __future__ import annotations

import numpy as np

from appocc.simulation.actors.car_frame import SHARE_LOW, SHARE_SHOULDER, CarFrame, points
from appocc.simulation.actors.looks import GREY_TRIM, PAINT, UNDERSIDE

_ARCH_GAP_M = 0.045


class Flanks(CarFrame):
    """What lies between the sill and the shoulder."""

    def build(self) -> None:
        """Both sides from the sill to the shoulder, the arches' shadow and the floor."""
        x = self.line[:, 0]
        half, shoulder, waist = self.half(x), self.shoulder(x), self.waist(x)
        if self.detail < 2:
            upper = np.stack([points(x, half, waist), points(x, half * SHARE_SHOULDER, shoulder)], axis=1)
            self.model.sheet(upper, PAINT)
            self._arches() if self.detail == 0 else self._sides()
        else:
            low = points(x, half * SHARE_LOW, np.full(len(x), self.profile.sill_m))
            self.model.sheet(np.stack([low, points(x, half, shoulder)], axis=1), PAINT)
        if self.detail < 2:
            self._floor()

    def _sides(self) -> None:
        """The flanks below the waist, without arches."""
        x = self.line[:, 0]
        low = points(x, self.half(x) * SHARE_LOW, np.full(len(x), self.profile.sill_m))
        self.model.sheet(np.stack([low, points(x, self.half(x), self.waist(x))], axis=1), PAINT)

    def _arches(self) -> None:
        """The flanks below the waist, cut out around the wheels."""
        profile = self.profile
        radius, sill = profile.wheel_m + _ARCH_GAP_M, profile.sill_m
        start = np.arcsin((sill - profile.wheel_m) / radius)
        angles = np.linspace(start, np.pi - start, 8)
        low: list[list[float]] = []
        high: list[list[float]] = []
        anchor: list[list[float]] = []
        ends = [self.full_line[0, 0], self.full_line[-1, 0]]
        waist = self.half(self.line[:, 0]), self.waist(self.line[:, 0])

        def station(x_low: float, x_high: float, z: float, fixed: float) -> None:
            at = np.array([x_low, x_high])
            low.append([x_low, float(self.half(at)[0]) * SHARE_LOW, z])
            # On the straight lines between the upper part's stations, else there were cracks.
            high.append([x_high, *(float(np.interp(-x_high, -self.line[:, 0], column)) for column in waist)])
            anchor.append([fixed, x_high])

        station(ends[0], ends[0], sill, ends[0])
        for axle in profile.axles_x_m:
            for angle, share in zip(angles, np.linspace(1, -1, len(angles)), strict=True):
                up = profile.wheel_m + radius * np.sin(angle)
                station(axle + radius * np.cos(angle), axle + radius * share, up, axle)
        station(ends[1], ends[1], sill, ends[1])
        looks = [[PAINT]] * (len(low) - 1)
        self.model.sheet(np.stack([np.array(low), np.array(high)], axis=1), looks, anchor_m=np.array(anchor))
        self._shadows(radius)
        if profile.cladding:
            self._cladding()

    def _shadows(self, radius: float) -> None:
        """Dark walls just behind the wheels, a little longer than the arches: one does not see into the body."""
        for axle in self.profile.axles_x_m:
            x = axle + (radius + 0.14) * np.array([1.0, 0.0, -1.0])
            y = self.half(x) * SHARE_LOW - 0.05
            z = (self.profile.sill_m, self.profile.wheel_m + radius + 0.01)
            wall = np.stack([points(x, y, np.full(3, height)) for height in z], axis=1)
            self.model.sheet(wall, UNDERSIDE, anchor_m=axle)

    def _cladding(self) -> None:
        """A dark band over the sill between the wheels."""
        reach = self.profile.wheel_m + _ARCH_GAP_M
        x = np.array([self.profile.axles_x_m[0] - reach, self.profile.axles_x_m[1] + reach])
        sill, waist = self.profile.sill_m, self.profile.waist_m
        share = 0.14 / (waist - sill)
        y = self.half(x) * np.array([[SHARE_LOW], [SHARE_LOW + share * (1 - SHARE_LOW)]]) + 0.006
        band = np.stack([points(x, y[k], np.full(2, z)) for k, z in enumerate((sill, sill + 0.14))], axis=1)
        self.model.sheet(band, GREY_TRIM)

    def _floor(self) -> None:
        nose, tail = self.full_line[0, 0], self.full_line[-1, 0]
        x = np.array([nose, nose - 0.85, tail + 0.75, tail] if self.detail == 0 else [nose, tail])
        inner = self.half(x) * SHARE_LOW - 0.05
        z = np.full(len(x), self.profile.sill_m)
        floor = np.stack([points(x, -inner, z), points(x, inner, z)], axis=1)
        self.model.sheet(floor, UNDERSIDE, mirror=False)
