"""Front and rear of a car: bumpers, bonnet, boot and load bed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.actors.car_frame import SHARE_LOW, CarFrame, points
from appocc.simulation.actors.materials import HEAD_LAMP, INDICATOR, PAINT, PLATE, TAIL_LAMP, TRIM, Finish

# Columns from the centre line to the corner as shares of the half width; how far the rounded ends recede there.
_COLUMNS = ((0.0, 0.36, 0.64, 0.89, 1.0), (0.0, 0.84, 1.0), (0.0, 1.0))
_FALL = ((0.0, 0.02, 0.06, 0.20, 1.0), (0.0, 0.16, 1.0), (0.0, 0.5))
_ROWS = ((0, 1, 3, 4, 5), (0, 1, 3, 5), (0, 3, 5))
# Row of a profile's front and rear that holds the lamps.
_LAMP_ROW = 3


class CarFrontRear(CarFrame):
    """The parts of a car ahead of and behind the cabin."""

    def _end_grid(self, front: bool) -> FloatArray:
        """Return (rows, columns, 3) of the front or rear; the last column is the corner it shares with the side."""
        sign = 1.0 if front else -1.0
        rows = np.array(self.profile.front_outline if front else self.profile.rear_outline)[list(_ROWS[self.detail])]
        corner_x = float(self.full_line[0 if front else -1, 0])
        at = np.array(corner_x)
        corner_z = np.array([self.profile.sill_m, float(self.waist(at)), float(self.shoulder(at))])
        half = float(self.half_width(at))
        corner_y = np.array([SHARE_LOW * half, half, float(self.shoulder_half_width(at))])
        low, high = rows[0, 0], rows[-1, 0]
        z_corner = corner_z[0] + (rows[:, 0] - low) / (high - low) * (corner_z[-1] - corner_z[0])
        # The edge of the side bends at the waist: a row of this grid meets it there.
        z_corner[1 + int(np.argmin(np.abs(z_corner[1:-1] - corner_z[1])))] = corner_z[1]
        y_corner = np.interp(z_corner, corner_z, corner_y)
        depth = self.length / 2 - abs(corner_x)
        grid = []
        for share, fall in zip(_COLUMNS[self.detail], _FALL[self.detail], strict=True):
            back = rows[:, 1] * (1 - share**4) + fall * depth
            z = rows[:, 0] * (1 - share) + z_corner * share
            grid.append(np.stack([sign * (self.length / 2 - back), share * y_corner, z], axis=1))
        return np.stack(grid, axis=1)

    def add_end(self, front: bool, grille: Finish) -> None:
        """Add front or rear: bumper, lamps, grille and number plate."""
        grid = self._end_grid(front)
        rows = _ROWS[self.detail]
        columns = len(_COLUMNS[self.detail]) - 1
        finishes = [[PAINT] * columns for _ in range(len(rows) - 1)]
        if self.detail < 2:
            finishes[0][:-1] = [TRIM] * (columns - 1)
        shine = HEAD_LAMP if front else TAIL_LAMP
        row = next((i for i, (a, b) in enumerate(pairwise(rows)) if a <= _LAMP_ROW < b), 0)
        if self.detail == 2:
            self._patch(grid[row : row + 2], (0.60, 0.98), (0.15, 0.75), shine, front)
        else:
            finishes[row][-1] = shine
        if self.detail == 0:
            finishes[row][-2:] = [shine, shine]
            if front:
                finishes[row][:2] = [grille, grille]
            self._patch(grid[row : row + 2, -2:], (0.08, 0.92), (0.04, 0.40), INDICATOR, front)
        self.model.add_sheet(grid, finishes, inside_m=[0.0, 0.0, float(grid[..., 2].mean())])
        if self.detail == 0:
            self._plate(front)

    def _patch(
        self, cell: FloatArray, across: tuple[float, float], up: tuple[float, float], finish: Finish, front: bool
    ) -> None:
        """Add a part of a cell (2, 2, 3) of the front or rear, slightly in front of it."""
        v, u = np.meshgrid(up, across, indexing="ij")
        weights = np.stack([(1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u], axis=-1)
        patch = weights @ cell.reshape(4, 3) + [0.007 if front else -0.007, 0.005, 0.0]
        self.model.add_sheet(patch, finish)

    def _plate(self, front: bool) -> None:
        rows = np.array(self.profile.front_outline if front else self.profile.rear_outline)[list(_ROWS[0])]
        middle = rows[1, 0] + (0.07 if front else 0.21)
        z = np.array([middle - 0.06, middle + 0.06])
        x = (1.0 if front else -1.0) * (self.length / 2 - np.interp(z, rows[:, 0], rows[:, 1]) + 0.009)
        plate = np.stack([points(x, np.full(2, y), z) for y in (-0.26, 0.26)])
        self.model.add_sheet(plate, PLATE, mirror=False)

    def _deck(self, x: FloatArray, edge: FloatArray, crown_m: float, first: FloatArray) -> FloatArray:
        """Return (stations, columns, 3): rows from the upper edge `first` (columns, 3) to stations at x."""
        shares = np.array(_COLUMNS[self.detail])
        half = self.shoulder_half_width(x) if self.detail < 2 else self.half_width(x)
        y = half[:, None] * shares
        z = edge[:, None] + crown_m * (1 - shares**4)
        rest = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)
        return np.concatenate([first[None], rest])

    def add_bonnet(self) -> None:
        """Add the bonnet, from the front to the windscreen."""
        x = self.full_line[1:3, 0] if self.detail == 0 else self.full_line[2:3, 0]
        grid = self._deck(x, self.shoulder(x), self.profile.crown_m[0], self._end_grid(front=True)[-1])
        self.model.add_sheet(grid, PAINT)

    def add_boot(self) -> None:
        """Add the boot, from the rear to the rear window."""
        x = self.full_line[5:6, 0]
        grid = self._deck(x, self.shoulder(x), 0.03, self._end_grid(front=False)[-1])
        self.model.add_sheet(grid, PAINT)

    def add_bed(self) -> None:
        """Add an open load bed: rim, inner walls and floor."""
        rear_outline = self._end_grid(front=False)[-1]
        rear, front = self.full_line[-1, 0], self.full_line[4, 0]
        z = float(self.shoulder(np.array(front)))
        floor = self.profile.waist_m - 0.08
        bends = self.line[:, 0]
        x = np.append(front, bends[bends < front])
        outer, inner = self.shoulder_half_width(x), np.full(len(x), self.width / 2 * 0.80)
        rim = np.stack([points(x, outer, self.shoulder(x)), points(x, inner, self.shoulder(x))], axis=1)
        self.model.add_sheet(rim, PAINT, [front, 0.0, 0.0])
        section = [(rear + 0.04, z), (rear + 0.04, floor), (front, floor), (front, z)]
        bottom = [[[a, y, b] for y in (0.0, inner[0])] for a, b in section]
        self.model.add_sheet(bottom[:2], TRIM, [rear - 1.0, 0.0, floor])
        self.model.add_sheet(bottom[1:3], TRIM)
        wall = [[[a, inner[0], h] for h in (floor, z)] for a in (rear + 0.04, front)]
        self.model.add_sheet(wall, TRIM, [(rear + front) / 2, self.width, floor])
        top = np.stack([rear_outline, rear_outline * [0.0, 1.0, 1.0] + [rear + 0.04, 0.0, 0.0]])
        self.model.add_sheet(top, PAINT)
