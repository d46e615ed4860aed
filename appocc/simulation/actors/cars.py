"""Cars, pickups and vans: a lower body with wheel arches, and a cabin on it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.actors.looks import (
    CHROME,
    DARK_HUB,
    GLASS,
    GREY_TRIM,
    GRILLE,
    HEAD_LAMP,
    INDICATOR,
    PAINT,
    PLATE,
    RAIL,
    TAIL_LAMP,
    TRIM,
    UNDERSIDE,
    Look,
)
from appocc.simulation.actors.modelling import Modeller
from appocc.simulation.actors.profiles import CarProfile, car_profile
from appocc.simulation.actors.wheels import add_wheels

_PANES = {"g": GLASS, "t": TRIM, "p": PAINT}
# Columns from the centre line to the corner as shares of the half width; how far the rounded ends fall back there.
_COLUMNS = ((0.0, 0.36, 0.64, 0.87, 1.0), (0.0, 0.64, 1.0), (0.0, 1.0))
_FALL = ((0.0, 0.05, 0.22, 0.55, 1.0), (0.0, 0.22, 1.0), (0.0, 0.5))
_ROWS = ((0, 1, 3, 4, 5), (0, 1, 3, 5), (0, 3, 5))
_ARCH_GAP_M = 0.045
_BED_M = 0.42
_SHARE_LOW, _SHARE_SHOULDER = 0.965, 0.955


def car(body: str, variant: int, detail: int) -> Modeller:
    """A car, pickup or van."""
    profile = car_profile(body, variant)
    model = Modeller(profile.size_lwh_m)
    builder = _Car(model, profile, detail)
    builder.flanks()
    builder.end(front=True, grille=(GRILLE, CHROME, GREY_TRIM)[variant])
    builder.end(front=False, grille=PAINT)
    builder.bonnet()
    builder.cabin()
    if profile.bed:
        builder.bed()
    else:
        builder.boot()
    half = profile.size_lwh_m[1] / 2
    hub = (CHROME, DARK_HUB, CHROME)[variant]
    outer = half * _SHARE_LOW - 0.012 if detail == 0 else half - 0.006
    add_wheels(model, profile.axles_x_m, profile.wheel_m, outer, 0.21, hub, detail)
    return model


class _Car:
    """Shapes of one car; all lines run from front to rear and from the centre to the left."""

    def __init__(self, model: Modeller, profile: CarProfile, detail: int) -> None:
        self.model, self.profile, self.detail = model, profile, detail
        self.length, self.width, _ = profile.size_lwh_m
        line = np.array(profile.shoulder)
        keep = ((0, 1, 2, 3, 4, 5, 6), (0, 2, 5, 6), (0, 2, 5, 6))[detail]
        self.line = line[list(keep)]
        self.full_line = line

    def half(self, x: FloatArray) -> FloatArray:
        """Half width at the waist; straight between the stations, so that parts with more points leave no cracks."""
        nose, tail = self.full_line[0, 0], self.full_line[-1, 0]
        knots = [tail, tail + 0.22, tail + 0.75, nose - 0.85, nose - 0.25, nose]
        stations = self.line[::-1, 0]
        rounded = np.interp(stations, knots, np.array([0.915, 0.972, 1.0, 1.0, 0.968, 0.895]) * self.width / 2)
        return np.asarray(np.interp(x, stations, rounded))

    def shoulder(self, x: FloatArray) -> FloatArray:
        """Height of the shoulder."""
        return np.asarray(np.interp(-x, -self.line[:, 0], self.line[:, 1]))

    def waist(self, x: FloatArray) -> FloatArray:
        """Height of the widest line, below the shoulder everywhere."""
        return np.minimum(self.profile.waist_m, self.shoulder(x) - 0.11)

    def flanks(self) -> None:
        """Both sides from the sill to the shoulder, the arches' shadow and the floor."""
        x = self.line[:, 0]
        half, shoulder, waist = self.half(x), self.shoulder(x), self.waist(x)
        if self.detail < 2:
            upper = np.stack([_points(x, half, waist), _points(x, half * _SHARE_SHOULDER, shoulder)], axis=1)
            self.model.sheet(upper, PAINT)
            self._arches() if self.detail == 0 else self._sides()
        else:
            low = _points(x, half * _SHARE_LOW, np.full(len(x), self.profile.sill_m))
            self.model.sheet(np.stack([low, _points(x, half, shoulder)], axis=1), PAINT)
        if self.detail < 2:
            self._floor()

    def _sides(self) -> None:
        """The flanks below the waist, without arches."""
        x = self.line[:, 0]
        low = _points(x, self.half(x) * _SHARE_LOW, np.full(len(x), self.profile.sill_m))
        self.model.sheet(np.stack([low, _points(x, self.half(x), self.waist(x))], axis=1), PAINT)

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
            low.append([x_low, float(self.half(at)[0]) * _SHARE_LOW, z])
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
            y = self.half(x) * _SHARE_LOW - 0.05
            z = (self.profile.sill_m, self.profile.wheel_m + radius + 0.01)
            wall = np.stack([_points(x, y, np.full(3, height)) for height in z], axis=1)
            self.model.sheet(wall, UNDERSIDE, anchor_m=axle)

    def _cladding(self) -> None:
        """A dark band over the sill between the wheels."""
        reach = self.profile.wheel_m + _ARCH_GAP_M
        x = np.array([self.profile.axles_x_m[0] - reach, self.profile.axles_x_m[1] + reach])
        sill, waist = self.profile.sill_m, self.profile.waist_m
        share = 0.14 / (waist - sill)
        y = self.half(x) * np.array([[_SHARE_LOW], [_SHARE_LOW + share * (1 - _SHARE_LOW)]]) + 0.006
        band = np.stack([_points(x, y[k], np.full(2, z)) for k, z in enumerate((sill, sill + 0.14))], axis=1)
        self.model.sheet(band, GREY_TRIM)

    def _floor(self) -> None:
        nose, tail = self.full_line[0, 0], self.full_line[-1, 0]
        x = np.array([nose, nose - 0.85, tail + 0.75, tail] if self.detail == 0 else [nose, tail])
        inner = self.half(x) * _SHARE_LOW - 0.05
        z = np.full(len(x), self.profile.sill_m)
        floor = np.stack([_points(x, -inner, z), _points(x, inner, z)], axis=1)
        self.model.sheet(floor, UNDERSIDE, mirror=False)

    def _end_grid(self, front: bool) -> FloatArray:
        """(rows, columns, 3) of the nose or the tail; its last column is the corner of the flank."""
        sign = 1.0 if front else -1.0
        rows = np.array(self.profile.nose if front else self.profile.tail)[list(_ROWS[self.detail])]
        corner_x = float(self.full_line[0 if front else -1, 0])
        at = np.array(corner_x)
        corner_z = np.array([self.profile.sill_m, float(self.waist(at)), float(self.shoulder(at))])
        corner_y = float(self.half(at)) * np.array([_SHARE_LOW, 1.0, _SHARE_SHOULDER])
        low, high = rows[0, 0], rows[-1, 0]
        z_corner = corner_z[0] + (rows[:, 0] - low) / (high - low) * (corner_z[-1] - corner_z[0])
        # The flank's edge bends at the waist: a row of this end meets it there.
        z_corner[1 + int(np.argmin(np.abs(z_corner[1:-1] - corner_z[1])))] = corner_z[1]
        y_corner = np.interp(z_corner, corner_z, corner_y)
        depth = self.length / 2 - abs(corner_x)
        grid = []
        for share, fall in zip(_COLUMNS[self.detail], _FALL[self.detail], strict=True):
            back = rows[:, 1] * (1 - share**4) + fall * depth
            z = rows[:, 0] * (1 - share) + z_corner * share
            grid.append(np.stack([sign * (self.length / 2 - back), share * y_corner, z], axis=1))
        return np.stack(grid, axis=1)

    def end(self, front: bool, grille: Look) -> None:
        """Nose or tail: bumper, lamps, grille and plate."""
        grid = self._end_grid(front)
        lamp = self.profile.lamps[0 if front else 1]
        rows = _ROWS[self.detail]
        columns = len(_COLUMNS[self.detail]) - 1
        looks = [[PAINT] * columns for _ in range(len(rows) - 1)]
        looks[0] = [TRIM if self.detail < 2 else PAINT] * columns
        shine = HEAD_LAMP if front else TAIL_LAMP
        row = next((i for i, (a, b) in enumerate(pairwise(rows)) if a <= lamp < b), 0)
        if self.detail == 2:
            self._patch(grid[row : row + 2], (0.60, 0.98), (0.15, 0.75), shine, front)
        else:
            looks[row][-1] = shine
        if self.detail == 0:
            looks[row][-2:] = [shine, shine]
            if front:
                looks[row][:2] = [grille, grille]
            self._patch(grid[row : row + 2, -2:], (0.08, 0.92), (0.04, 0.40), INDICATOR, front)
        self.model.sheet(grid, looks, inside_m=[0.0, 0.0, float(grid[..., 2].mean())])
        if self.detail == 0:
            self._plate(front)

    def _patch(
        self, cell: FloatArray, across: tuple[float, float], up: tuple[float, float], look: Look, front: bool
    ) -> None:
        """A part of a cell (2, 2, 3) of the nose or the tail, just in front of it."""
        v, u = np.meshgrid(up, across, indexing="ij")
        weights = np.stack([(1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u], axis=-1)
        patch = weights @ cell.reshape(4, 3) + [0.007 if front else -0.007, 0.005, 0.0]
        self.model.sheet(patch, look)

    def _plate(self, front: bool) -> None:
        rows = np.array(self.profile.nose if front else self.profile.tail)[list(_ROWS[0])]
        middle = rows[1, 0] + (0.07 if front else 0.21)
        z = np.array([middle - 0.06, middle + 0.06])
        x = (1.0 if front else -1.0) * (self.length / 2 - np.interp(z, rows[:, 0], rows[:, 1]) + 0.009)
        plate = np.stack([_points(x, np.full(2, y), z) for y in (-0.26, 0.26)])
        self.model.sheet(plate, PLATE, mirror=False)

    def _deck(self, x: FloatArray, edge: FloatArray, crown_m: float, first: FloatArray) -> FloatArray:
        """(stations, columns, 3): rows from the end's upper edge `first` (columns, 3) to stations at x."""
        shares = np.array(_COLUMNS[self.detail])
        half = self.half(x) * (_SHARE_SHOULDER if self.detail < 2 else 1.0)
        y = half[:, None] * shares
        z = edge[:, None] + crown_m * (1 - shares**4)
        rest = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)
        return np.concatenate([first[None], rest])

    def bonnet(self) -> None:
        """From the nose to the windscreen."""
        x = self.full_line[1:3, 0] if self.detail == 0 else self.full_line[2:3, 0]
        grid = self._deck(x, self.shoulder(x), self.profile.crown_m[0], self._end_grid(front=True)[-1])
        self.model.sheet(grid, PAINT)

    def boot(self) -> None:
        """From the tail to the rear window."""
        x = self.full_line[5:6, 0]
        grid = self._deck(x, self.shoulder(x), 0.03, self._end_grid(front=False)[-1])
        self.model.sheet(grid, PAINT)

    def bed(self) -> None:
        """An open load bed: rim, inner walls and floor."""
        tail = self._end_grid(front=False)[-1]
        rear, front = self.full_line[-1, 0], self.full_line[4, 0]
        z = float(self.shoulder(np.array(front)))
        floor = self.profile.waist_m - 0.08
        x = np.array([rear, front])
        outer, inner = self.half(x) * _SHARE_SHOULDER, np.full(2, self.width / 2 * 0.80)
        rim = np.stack([_points(x, outer, np.full(2, z)), _points(x, inner, np.full(2, z))], axis=1)
        self.model.sheet(rim, PAINT)
        hollow = [(rear + 0.04, z), (rear + 0.04, floor), (front, floor), (front, z)]
        inside = [(rear + front) / 2, 0.0, z + 3.0]
        bottom = [[[a, y, b] for y in (0.0, inner[0])] for a, b in hollow]
        self.model.sheet(bottom[:2], TRIM, [rear - 1.0, 0.0, floor])
        self.model.sheet(bottom[1:3], TRIM)
        wall = [[[a, inner[0], h] for h in (floor, z)] for a in (rear + 0.04, front)]
        self.model.sheet(wall, TRIM, [inside[0], self.width, floor])
        top = np.stack([tail, tail * [0.0, 1.0, 1.0] + [rear + 0.04, 0.0, 0.0]])
        self.model.sheet(top, PAINT)

    def cabin(self) -> None:
        """Windows, pillars and roof."""
        profile = self.profile
        base, top, edge = (np.array(column) for column in zip(*profile.pillars, strict=True))
        if self.detail == 2:
            ends = [0, len(base) - 1]
            base, top, edge = base[ends], top[ends], edge[ends]
        # Far away the windows begin at the shoulder itself.
        belt_y = self.half(base) * (profile.widths[0] if self.detail < 2 else _SHARE_SHOULDER)
        roof_y = np.full(len(top), self.width / 2 * profile.widths[1])
        lower, upper = (
            _points(base, belt_y, self.shoulder(base) + (0.03 if self.detail < 2 else 0.0)),
            _points(top, roof_y, edge),
        )
        if self.detail == 0:
            head = lower + 0.86 * (upper - lower)
            head[1:-1, 1] += 0.012  # the windows are bent; the corners belong to the screens, too
            rows, shares = np.stack([lower, head, upper], axis=1), np.array([0.0, 0.55, 1.0])
        else:
            rows, shares = np.stack([lower, upper], axis=1), np.array([0.0, 1.0])
        panes = profile.panes if self.detail < 2 else ("p" if profile.panes.count("p") > 2 else "g")
        self.model.sheet(rows, [[_PANES[pane], PAINT][: rows.shape[1] - 1] for pane in panes])
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
        """The ledge between the shoulder and the side windows."""
        bends = self.line[:, 0]
        pillars = base if self.detail == 0 else base[[0, -1]]
        x = np.unique(np.concatenate([pillars, bends[(bends < base[0]) & (bends > base[-1])]]))[::-1]
        edge = _points(x, self.half(x) * _SHARE_SHOULDER, self.shoulder(x))
        inner = _points(x, *(np.interp(-x, -base, lower[:, axis]) for axis in (1, 2)))
        self.model.sheet(np.stack([edge, inner], axis=1), PAINT)

    def _roof_grid(self, upper: FloatArray, shares: FloatArray) -> FloatArray:
        _, front, rear, _ = self.profile.screens_x_m
        grid = upper[:, None] * np.stack([np.ones(len(shares)), shares, np.ones(len(shares))], axis=1)
        grid[..., 2] += self.profile.crown_m[1] * (1 - shares**2)
        grid[0, :, 0] = front + (upper[0, 0] - front) * shares**2
        grid[-1, :, 0] = rear + (upper[-1, 0] - rear) * shares**2
        return grid

    def _roof(self, upper: FloatArray, shares: FloatArray) -> None:
        self.model.sheet(self._roof_grid(upper, shares), PAINT)

    def _screens(self, lower: FloatArray, upper: FloatArray, shares: FloatArray) -> None:
        """Windscreen and rear window, bent forward and back in the middle."""
        roof = self._roof_grid(upper, shares)
        front_foot, _, _, rear_foot = self.profile.screens_x_m
        closed = self.profile.panes.count("p") > 2
        for index, foot, look in ((0, front_foot, GLASS), (-1, rear_foot, GLASS)):
            corner = lower[index]
            rise = 0.0 if index else 0.02
            base = np.stack(
                [
                    foot + (corner[0] - foot) * shares**2,
                    corner[1] * shares,
                    corner[2] + rise * (1 - shares**2),
                ],
                axis=1,
            )
            pane = PAINT if closed and index else look
            in_bed = bool(index) and self.profile.bed
            if self.detail == 0 or in_bed:
                foot_row = base - [0.0, 0.0, _BED_M if in_bed else 0.07]
                skirt = PAINT if pane == PAINT or in_bed else TRIM
                columns = len(shares) - 1
                self.model.sheet(np.stack([foot_row, base, roof[index]]), [[skirt] * columns, [pane] * columns])
            else:
                self.model.sheet(np.stack([base, roof[index]]), pane)

    def _rails(self, upper: FloatArray) -> None:
        front, rear = upper[1, 0] - 0.1, upper[-2, 0]
        z = np.interp([-front, -rear], -upper[:, 0], upper[:, 2])
        y = float(upper[0, 1]) * 0.96
        low, high = [rear, y - 0.02, z.min() - 0.02], [front, y + 0.02, z.max() + 0.035]
        self.model.box(low, high, RAIL, mirror=True, skip="b")

    def _doors(self) -> None:
        """Gaps between the doors, and their handles."""
        front_x = [x for x, _, _ in self.profile.pillars]
        doors = [front_x[1] - 0.12, 0.5 * (front_x[2] + front_x[3])]
        doors += [front_x[4] + 0.10] if self.profile.panes[3] == "g" else []
        for x in doors:
            at = np.full(3, x) + np.array([-0.008, 0.008, 0.0])
            z = np.array([self.profile.sill_m + 0.10, float(self.waist(at)[2]), float(self.shoulder(at)[2])])
            share = 1 - (1 - _SHARE_LOW) * (z[1] - z[0]) / (z[1] - self.profile.sill_m)
            y = float(self.half(at)[2]) * np.array([share, 1.0, _SHARE_SHOULDER]) + 0.004
            self.model.sheet(np.stack([_points(np.full(3, a), y, z) for a in at[:2]]), GRILLE)
        for x in doors[1:]:
            z = np.array([-0.07, -0.04]) + float(self.shoulder(np.array(x)))
            side = float(self.half(np.array(x))) * 0.966 + 0.012
            self.model.sheet([[[a, side, b] for b in z] for a in (x + 0.06, x + 0.24)], GRILLE)

    def _rear_doors(self) -> None:
        """Windows in the rear doors of a van, and the gap between the doors."""
        _, _, top, foot = self.profile.screens_x_m
        low, high = float(self.shoulder(np.array(foot))) + 0.03, self.profile.pillars[-1][2]
        z = low + (high - low) * np.array([0.12, 0.72])
        x = foot + (top - foot) * np.array([0.12, 0.72]) - 0.012
        for wide, look in (((0.12, 0.70), GLASS), ((-0.008, 0.008), GRILLE)):
            self.model.sheet(np.stack([_points(x, np.full(2, y), z) for y in wide]), look, mirror=look is GLASS)

    def _mirror(self, lower: FloatArray) -> None:
        x, y, z = lower[1]
        outer = self.width / 2 * 0.998
        self.model.box([x - 0.12, y, z + 0.02], [x - 0.02, outer, z + 0.14], PAINT, mirror=True)


def _points(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    return np.stack([x, y, z], axis=-1)
