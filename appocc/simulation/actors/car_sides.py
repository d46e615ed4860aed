"""Sides of a car: wheel arches, sills and underbody."""

from __future__ import annotations

import numpy as np

from appocc.simulation.actors.car_frame import SHARE_LOW, CarFrame, points
from appocc.simulation.actors.materials import GREY_TRIM, PAINT, UNDERSIDE

_ARCH_GAP_M = 0.045
_CLEARANCE_M = 0.06
_INSET_M = 0.08


class CarSides(CarFrame):
    """The part of a car between sill and shoulder."""

    def build(self) -> None:
        """Build both sides from the sill to the shoulder, the arch linings and the underbody."""
        x = self.line[:, 0]
        half, shoulder, waist = self.half_width(x), self.shoulder(x), self.waist(x)
        if self.detail < 2:
            upper = np.stack([points(x, half, waist), points(x, self.shoulder_half_width(x), shoulder)], axis=1)
            self.model.add_sheet(upper, PAINT)
            self._arches() if self.detail == 0 else self._sides()
        else:
            low = points(x, half * SHARE_LOW, np.full(len(x), self.profile.sill_m))
            self.model.add_sheet(np.stack([low, points(x, half, shoulder)], axis=1), PAINT)
        self._underbody()

    def _sides(self) -> None:
        """Add the sides below the waist, without arches."""
        x = self.line[:, 0]
        low = points(x, self.half_width(x) * SHARE_LOW, np.full(len(x), self.profile.sill_m))
        self.model.add_sheet(np.stack([low, points(x, self.half_width(x), self.waist(x))], axis=1), PAINT)

    def _arches(self) -> None:
        """Add the sides below the waist, cut out around the wheels."""
        profile = self.profile
        radius, sill = profile.wheel_m + _ARCH_GAP_M, profile.sill_m
        start = np.arcsin((sill - profile.wheel_m) / radius)
        angles = np.linspace(start, np.pi - start, 8)
        low: list[list[float]] = []
        high: list[list[float]] = []
        anchor: list[list[float]] = []
        ends = [self.full_line[0, 0], self.full_line[-1, 0]]
        waist = self.half_width(self.line[:, 0]), self.waist(self.line[:, 0])

        def station(x_low: float, x_high: float, z: float, fixed: float) -> None:
            at = np.array([x_low, x_high])
            low.append([x_low, float(self.half_width(at)[0]) * SHARE_LOW, z])
            # Interpolated along the stations of the upper part; otherwise there are cracks.
            high.append([x_high, *(float(np.interp(-x_high, -self.line[:, 0], column)) for column in waist)])
            anchor.append([fixed, x_high])

        station(ends[0], ends[0], sill, ends[0])
        for axle in profile.axles_x_m:
            for angle, share in zip(angles, np.linspace(1, -1, len(angles)), strict=True):
                up = profile.wheel_m + radius * np.sin(angle)
                station(axle + radius * np.cos(angle), axle + radius * share, up, axle)
        station(ends[1], ends[1], sill, ends[1])
        finishes = [[PAINT]] * (len(low) - 1)
        self.model.add_sheet(np.stack([np.array(low), np.array(high)], axis=1), finishes, anchor_m=np.array(anchor))
        self._shadows(radius)
        if profile.cladding:
            self._cladding()

    def _shadows(self, radius: float) -> None:
        """Add dark walls behind the wheels, slightly longer than the arches, which hide the inside of the body."""
        for axle in self.profile.axles_x_m:
            x = axle + (radius + 0.14) * np.array([1.0, 0.0, -1.0])
            y = self.half_width(x) * SHARE_LOW - 0.05
            z = (self.profile.sill_m, self.profile.wheel_m + radius + 0.01)
            wall = np.stack([points(x, y, np.full(3, height)) for height in z], axis=1)
            self.model.add_sheet(wall, UNDERSIDE, anchor_m=axle)

    def _cladding(self) -> None:
        """Add a dark band above the sill between the wheels."""
        reach = self.profile.wheel_m + _ARCH_GAP_M
        x = np.array([self.profile.axles_x_m[0] - reach, self.profile.axles_x_m[1] + reach])
        sill, waist = self.profile.sill_m, self.profile.waist_m
        share = 0.14 / (waist - sill)
        y = self.half_width(x) * np.array([[SHARE_LOW], [SHARE_LOW + share * (1 - SHARE_LOW)]]) + 0.006
        band = np.stack([points(x, y[k], np.full(2, z)) for k, z in enumerate((sill, sill + 0.14))], axis=1)
        self.model.add_sheet(band, GREY_TRIM)

    def _underbody(self) -> None:
        """Add dark panels below sills and bumpers, nearly down to the road, which look like the car's shadow."""
        inset = _INSET_M + 0.2 * (self.profile.sill_m - 0.2)
        reach = [self.length / 2 - inset, self.width / 2 - inset]
        low, high = [-reach[0], -reach[1], _CLEARANCE_M], [*reach, self.profile.sill_m + 0.01]
        self.model.add_box(low, high, UNDERSIDE, skip="tb")
