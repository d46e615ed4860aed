"""Cabin of a car: windows, pillars, roof, doors."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.actors.car_frame import SHARE_LOW, CarFrame, points
from appocc.simulation.actors.materials import GLASS, GRILLE, PAINT, RAIL, TRIM

_PANES = {"g": GLASS, "t": TRIM, "p": PAINT}
_BED_M = 0.42


class Cabin(CarFrame):
    """The part of a car above the shoulder line, and the door details."""

    def build(self) -> None:
        """Build windows, pillars and roof."""
        profile = self.profile
        base, top, edge = (np.array(column) for column in zip(*profile.pillars, strict=True))
        if self.detail == 2:
            ends = [0, len(base) - 1]
            base, top, edge = base[ends], top[ends], edge[ends]
        # At the lowest level of detail the windows begin at the shoulder itself.
        belt_y = self.half_width(base) * profile.widths[0] if self.detail < 2 else self.shoulder_half_width(base)
        roof_y = np.full(len(top), self.width / 2 * profile.widths[1])
        lower = points(base, belt_y, self.shoulder(base) + (0.03 if self.detail < 2 else 0.0))
        upper = points(top, roof_y, edge)
        if self.detail == 0:
            head = lower + 0.86 * (upper - lower)
            head[1:-1, 1] += 0.012  # curved side windows; the corners also belong to the windscreen and rear window
            rows, shares = np.stack([lower, head, upper], axis=1), np.array([0.0, 0.55, 1.0])
        else:
            rows, shares = np.stack([lower, upper], axis=1), np.array([0.0, 1.0])
        panes = profile.panes if self.detail < 2 else ("p" if profile.panes.count("p") > 2 else "g")
        self.model.add_sheet(rows, [[_PANES[pane], PAINT][: rows.shape[1] - 1] for pane in panes])
        if self.detail < 2:
            self._belt(base, lower)
        self._roof(upper, shares)
        self._screens(lower, upper, shares)
        if profile.rails and self.detail == 0:
            self._rails(upper)
        if self.detail == 0:
            self._mirror(lower)
            self._doors()
        if profile.panes.count("p") > 2 and self.detail < 2:
            self._rear_doors()

    def _belt(self, base: FloatArray, lower: FloatArray) -> None:
        """Add the ledge between the shoulder and the side windows."""
        bends = self.line[:, 0]
        pillars = base if self.detail == 0 else base[[0, -1]]
        x = np.unique(np.concatenate([pillars, bends[(bends < base[0]) & (bends > base[-1])]]))[::-1]
        edge = points(x, self.shoulder_half_width(x), self.shoulder(x))
        inner = points(x, *(np.interp(-x, -base, lower[:, axis]) for axis in (1, 2)))
        self.model.add_sheet(np.stack([edge, inner], axis=1), PAINT)

    def _roof_grid(self, upper: FloatArray, shares: FloatArray) -> FloatArray:
        _, front, rear, _ = self.profile.screens_x_m
        grid = upper[:, None] * np.stack([np.ones(len(shares)), shares, np.ones(len(shares))], axis=1)
        grid[..., 2] += self.profile.crown_m[1] * (1 - shares**2)
        grid[0, :, 0] = front + (upper[0, 0] - front) * shares**2
        grid[-1, :, 0] = rear + (upper[-1, 0] - rear) * shares**2
        return grid

    def _roof(self, upper: FloatArray, shares: FloatArray) -> None:
        self.model.add_sheet(self._roof_grid(upper, shares), PAINT)

    def _screens(self, lower: FloatArray, upper: FloatArray, shares: FloatArray) -> None:
        """Add windscreen and rear window, curved along the centre line."""
        roof = self._roof_grid(upper, shares)
        front_foot, _, _, rear_foot = self.profile.screens_x_m
        closed = self.profile.panes.count("p") > 2
        for index, foot in ((0, front_foot), (-1, rear_foot)):
            corner = lower[index]
            rise = 0.0 if index else 0.02
            bent_x, z = foot + (corner[0] - foot) * shares**2, corner[2] + rise * (1 - shares**2)
            base = points(bent_x, corner[1] * shares, z)
            pane = PAINT if closed and index else GLASS
            in_bed = bool(index) and self.profile.bed
            if self.detail == 0 or in_bed:
                foot_row = base - [0.0, 0.0, _BED_M if in_bed else 0.07]
                skirt = PAINT if pane == PAINT or in_bed else TRIM
                columns = len(shares) - 1
                self.model.add_sheet(np.stack([foot_row, base, roof[index]]), [[skirt] * columns, [pane] * columns])
            else:
                self.model.add_sheet(np.stack([base, roof[index]]), pane)

    def _rails(self, upper: FloatArray) -> None:
        front, rear = upper[1, 0] - 0.1, upper[-2, 0]
        z = np.interp([-front, -rear], -upper[:, 0], upper[:, 2])
        y = float(upper[0, 1]) * 0.96
        low, high = [rear, y - 0.02, z.min() - 0.02], [front, y + 0.02, z.max() + 0.035]
        self.model.add_box(low, high, RAIL, mirror=True, skip="b")

    def _doors(self) -> None:
        """Add the gaps between the doors, and their handles."""
        front_x = [x for x, _, _ in self.profile.pillars]
        doors = [front_x[1] - 0.12, 0.5 * (front_x[2] + front_x[3])]
        doors += [front_x[4] + 0.10] if self.profile.panes[3] == "g" else []
        for x in doors:
            at = np.full(3, x) + np.array([-0.008, 0.008, 0.0])
            z = np.array([self.profile.sill_m + 0.10, float(self.waist(at)[2]), float(self.shoulder(at)[2])])
            share = 1 - (1 - SHARE_LOW) * (z[1] - z[0]) / (z[1] - self.profile.sill_m)
            half = float(self.half_width(at)[2])
            y = np.array([share * half, half, float(self.shoulder_half_width(at)[2])]) + 0.004
            self.model.add_sheet(np.stack([points(np.full(3, a), y, z) for a in at[:2]]), GRILLE)
        for x in doors[1:]:
            z = np.array([-0.07, -0.04]) + float(self.shoulder(np.array(x)))
            side = float(self.half_width(np.array(x))) * 0.966 + 0.012
            self.model.add_sheet([[[a, side, b] for b in z] for a in (x + 0.06, x + 0.24)], GRILLE)

    def _rear_doors(self) -> None:
        """Add the windows in the rear doors of a van, and the gap between the doors."""
        _, _, top, foot = self.profile.screens_x_m
        low, high = float(self.shoulder(np.array(foot))) + 0.03, self.profile.pillars[-1][2]
        z = low + (high - low) * np.array([0.12, 0.72])
        x = foot + (top - foot) * np.array([0.12, 0.72]) - 0.012
        for wide, finish in (((0.12, 0.70), GLASS), ((-0.008, 0.008), GRILLE)):
            self.model.add_sheet(
                np.stack([points(x, np.full(2, y), z) for y in wide]), finish, mirror=finish is GLASS
            )

    def _mirror(self, lower: FloatArray) -> None:
        x, y, z = lower[1]
        outer = self.width / 2 * 0.998
        self.model.add_box([x - 0.12, y, z + 0.02], [x - 0.02, outer, z + 0.14], PAINT, mirror=True)
