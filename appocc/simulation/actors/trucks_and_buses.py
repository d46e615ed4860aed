"""Box trucks and buses: hulls with flat sides."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.actors.materials import (
    CHROME,
    GLASS,
    GREY_TRIM,
    GRILLE,
    HEAD_LAMP,
    INDICATOR,
    PAINT,
    PLATE,
    TAIL_LAMP,
    TRIM,
    UNDERSIDE,
    Finish,
    plain,
)
from appocc.simulation.actors.modelling import Modeller
from appocc.simulation.actors.wheels import add_wheels

_RAIL = plain(150, 152, 155)
_COLUMNS = ((0.0, 0.55, 0.86, 1.0), (0.0, 0.86, 1.0), (0.0, 1.0))
_FALL_M = ((0.0, 0.03, 0.10, 0.22), (0.0, 0.10, 0.22), (0.0, 0.12))


class _Hull:
    """A hull in rows from the lower edge to the roof's edge: height, half width, x of the front and of the rear."""

    def __init__(self, model: Modeller, rows: Sequence[tuple[float, float, float, float]], detail: int) -> None:
        self.model, self.detail = model, detail
        self.z, self.half, self.front_x, self.rear_x = (np.array(column) for column in zip(*rows, strict=True))

    def end_grid(self, front: bool) -> FloatArray:
        """Return (rows, columns, 3) of the left half of the front or the rear."""
        shares, fall = np.array(_COLUMNS[self.detail]), np.array(_FALL_M[self.detail])
        x = self.front_x[:, None] - fall if front else self.rear_x[:, None] + 0.6 * fall
        return np.stack(np.broadcast_arrays(x, self.half[:, None] * shares, self.z[:, None]), axis=-1)

    def add_end(self, front: bool, finishes: Sequence[Sequence[Finish]]) -> None:
        """Add front or rear; a row lists finishes from the centre to the corner and repeats the last one."""
        columns = len(_COLUMNS[self.detail]) - 1
        filled = [[row[min(k, len(row) - 1)] for k in range(columns)] for row in finishes]
        x = float(np.mean(self.front_x + self.rear_x)) / 2
        self.model.add_sheet(self.end_grid(front), filled, [x, 0.0, float(self.z.mean())])

    def side_grid(self, stations_x_m: Sequence[float | FloatArray]) -> FloatArray:
        """Return (rows, stations + 2, 3) of the left side, front to rear; a station has one x, or one per row."""
        front, rear = self.end_grid(True)[:, -1], self.end_grid(False)[:, -1]
        middle = [np.stack([np.broadcast_to(x, self.z.shape), self.half, self.z], axis=-1) for x in stations_x_m]
        return np.stack([front, *middle, rear], axis=1)

    def add_roof(self, crown_m: float, finish: Finish, stations_x_m: Sequence[float]) -> None:
        """Add the roof above the uppermost row."""
        shares = np.array(_COLUMNS[self.detail])
        middle = [
            np.stack(
                [np.full(len(shares), x), self.half[-1] * shares, self.z[-1] + crown_m * (1 - shares**4)], axis=-1
            )
            for x in stations_x_m
        ]
        grid = np.stack([self.end_grid(True)[-1], *middle, self.end_grid(False)[-1]])
        self.model.add_sheet(grid, finish)

    def add_floor(self, low_m: float) -> None:
        """Add the underside."""
        low, high = [self.rear_x[0] + 0.1, -0.9 * self.half[0]], [self.front_x[0] - 0.1, 0.9 * self.half[0]]
        floor = [[[x, y, low_m] for y in (low[1], high[1])] for x in (low[0], high[0])]
        self.model.add_sheet(floor, UNDERSIDE, mirror=False)


def model_bus(variant: int, detail: int) -> Modeller:
    """Model a city bus: window band, doors on the right side, a sign above the windscreen."""
    model = Modeller((12.0, 2.55, 3.1))
    high = (
        *((0.30, 1.23, 5.94, -5.97), (0.58, 1.25, 5.985, -5.985), (0.98, 1.26, 5.985, -5.985)),
        *((2.30, 1.25, 5.93, -5.96), (2.78, 1.22, 5.88, -5.93), (2.93, 1.10, 5.76, -5.85)),
    )
    keep = ((0, 1, 2, 3, 4, 5), (0, 2, 3, 5), (0, 2, 3, 5))[detail]
    hull = _Hull(model, [high[k] for k in keep], detail)
    axles = (3.25, -2.85)
    _bus_sides(hull, axles, variant)
    _bus_ends(hull)
    hull.add_roof(0.05, PAINT, [] if detail else [2.0, -2.0])
    hull.add_floor(0.3)
    if detail < 2:
        model.add_box([-3.6, -0.75, 2.9], [-1.2, 0.75, 3.1], plain(196, 198, 198), skip="b")
        add_wheels(model, axles, 0.47, 1.235 if detail == 0 else 1.27, 0.3, hub=CHROME, detail=detail)
    else:
        model.add_box([-3.6, -0.75, 3.09], [-1.2, 0.75, 3.1], plain(196, 198, 198), skip="bfrs")
        add_wheels(model, axles, 0.47, 1.27, 0.3, hub=CHROME, detail=detail)
    return model


def _bus_sides(hull: _Hull, axles: tuple[float, float], variant: int) -> None:
    skirt = (PAINT, GREY_TRIM, PAINT)[variant]
    if hull.detail:
        finishes: list[list[Finish | None]] = [[skirt], [GLASS], [PAINT]]
        hull.model.add_sheet(hull.side_grid([]), finishes)
        return
    arches = [x for axle in axles for x in (axle + 0.60, axle - 0.60)]
    windows = [5.5, 4.4, 2.2, 1.2, 0.2, -0.8, -1.8, -4.4, -5.4]
    stations = sorted({*arches, *windows}, reverse=True)
    edges = [5.8, *stations, -5.9]
    for left in (True, False):
        grid = hull.side_grid(stations) * (1.0 if left else np.array([1.0, -1.0, 1.0]))
        rows: list[list[Finish | None]] = [[], [], [], [], []]
        for front, rear in pairwise(edges):
            middle = (front + rear) / 2
            arch = any(abs(middle - axle) < 0.6 for axle in axles)
            door = not left and (4.4 < middle < 5.5 or -0.8 < middle < 1.2)
            end = middle > 5.5 or middle < -5.4
            panel = None if arch else GLASS if door else skirt
            for row, finish in zip(rows, (panel, None if arch else panel, GLASS, PAINT, PAINT), strict=True):
                row.append(PAINT if end and finish is GLASS and middle < 0 else finish)
        hull.model.add_sheet(grid, rows, mirror=False)
    for x in (x for x in windows if -5.0 < x < 5.0):
        post = [[[x + d, 1.268, 0.98], [x + d, 1.258, 2.30]] for d in (-0.05, 0.05)]
        hull.model.add_sheet(post, TRIM)
    _arch_walls(hull.model, axles, 0.62, 1.16, (0.30, 0.98))


def _bus_ends(hull: _Hull) -> None:
    sign = plain(40, 40, 30)
    if hull.detail:
        hull.add_end(True, [[PAINT, HEAD_LAMP], [GLASS], [sign]])
        hull.add_end(False, [[PAINT, TAIL_LAMP], [GLASS, PAINT], [PAINT]])
        return
    hull.add_end(True, [[GRILLE], [PAINT, HEAD_LAMP, INDICATOR], [GLASS], [sign], [PAINT]])
    hull.add_end(False, [[TRIM], [PAINT, TAIL_LAMP, TAIL_LAMP], [PAINT], [PAINT], [PAINT]])
    window = [[[-5.995 + (z - 1.3) * 0.02, y, z] for y in (0.0, 0.95)] for z in (1.35, 2.25)]
    hull.model.add_sheet(window, GLASS)
    for low, high, finish in ((0.70, 0.82, INDICATOR), (1.05, 1.3, TAIL_LAMP)):
        hull.model.add_sheet([[[-5.985, y, z] for y in (0.86, 1.06)] for z in (low, high)], finish)
    letters = [[[5.925 - (z - 2.3) * 0.1, y, z] for y in (-0.7, 0.7)] for z in (2.46, 2.64)]
    hull.model.add_sheet(letters, plain(240, 178, 40), mirror=False)
    for x in (5.995, -5.998):
        hull.model.add_sheet([[[x, y, z] for y in (-0.26, 0.26)] for z in (0.60, 0.72)], PLATE, mirror=False)


def _arch_walls(
    model: Modeller, axles: Sequence[float], half_m: float, y: float, z: tuple[float, float], closed: bool = True
) -> None:
    """Add dark walls behind the wheels, and a ceiling above them."""
    for axle in axles:
        wall = [[[axle + d, y, h] for h in z] for d in (-half_m, half_m)]
        model.add_sheet(wall, UNDERSIDE, anchor_m=axle)
        if closed:
            for d in (-half_m, half_m):
                jamb = [[[axle + d, b, h] for h in z] for b in (y, y + 0.1)]
                model.add_sheet(jamb, UNDERSIDE, [axle + 2 * d, y, z[0]], anchor_m=axle)


def model_box_truck(variant: int, detail: int) -> Modeller:
    """Model a truck whose cab has its own colour; the box takes the actor's paint."""
    model = Modeller((7.2, 2.4, 3.2))
    cab = (plain(228, 229, 228), plain(30, 62, 124), plain(146, 28, 32))[variant]
    _cab(model, cab, detail)
    model.add_box([-3.58, -1.2, 0.98], [1.52, 1.2, 3.2], PAINT, skip="" if detail < 2 else "b")
    axles = (2.68, -2.05)
    if detail == 2:
        model.add_box([-3.3, -0.9, 0.55], [1.8, 0.9, 1.0], TRIM, skip="tfr")
    else:
        model.add_box([-3.45, -0.55, 0.55], [1.8, 0.55, 1.0], TRIM, skip="t")
        guard = [[[x, 1.12, z] for z in (0.45, 0.85)] for x in (-1.45, 1.5)]
        model.add_sheet(guard, GREY_TRIM)
    add_wheels(model, axles, 0.46, 1.15, 0.34, hub=plain(150, 152, 154), detail=detail)
    _truck_rear(model, variant, detail)
    return model


def _cab(model: Modeller, finish: Finish, detail: int) -> None:
    rows = (
        *((0.42, 1.08, 3.56, 1.66), (0.72, 1.12, 3.59, 1.66), (1.00, 1.12, 3.58, 1.66), (1.40, 1.12, 3.56, 1.66)),
        *((2.25, 1.07, 3.30, 1.66), (2.42, 1.00, 3.14, 1.66)),
    )
    keep = ((0, 1, 2, 3, 4, 5), (0, 2, 3, 5), (0, 3, 5))[detail]
    hull = _Hull(model, [rows[k] for k in keep], detail)
    if detail == 2:
        hull.add_end(True, [[finish], [GLASS]])
        model.add_sheet(hull.side_grid([]), [[finish], [GLASS]])
    elif detail == 1:
        hull.add_end(True, [[TRIM, HEAD_LAMP], [finish], [GLASS]])
        model.add_sheet(hull.side_grid([2.2]), [[finish, TRIM], [finish, finish], [GLASS, finish]])
    else:
        hull.add_end(True, [[TRIM], [GRILLE, HEAD_LAMP, INDICATOR], [finish], [GLASS], [finish]])
        front = np.array([3.22, 3.22, 3.22, 3.16, 2.96, 2.80])
        arch: list[Finish | None] = [finish, None, TRIM, TRIM]
        door: list[Finish | None] = [finish, GLASS, finish, finish]
        model.add_sheet(hull.side_grid([front, 2.14, 2.0]), [arch, arch, [finish] * 4, door, [finish] * 4])
        _arch_walls(model, [2.68], 0.54, 0.98, (0.42, 1.0))
        model.add_sheet([[[3.602, y, z] for y in (-0.26, 0.26)] for z in (0.50, 0.62)], PLATE, mirror=False)
        model.add_box([3.16, 1.07, 1.5], [3.26, 1.19, 1.95], TRIM, mirror=True)
    hull.add_end(False, [[finish]] * (len(keep) - 1))
    hull.add_roof(0.06, finish, [])
    if detail == 0:
        # A wind deflector connects the cab to the top of the box.
        shield = [[[2.7, y, 2.46] for y in (0.0, 0.75)], [[1.75, y, 3.0] for y in (0.0, 0.85)]]
        model.add_sheet(shield, finish)
        model.add_sheet(
            [[[1.75, y, 3.0] for y in (0.0, 0.85)], [[1.75, y, 2.4] for y in (0.0, 0.85)]], finish, [2.4, 0, 2.5]
        )
        side = [[[2.7, 0.75, 2.46], [1.75, 0.85, 2.46]], [[2.7, 0.75, 2.461], [1.75, 0.85, 3.0]]]
        model.add_sheet(side, finish, [2.2, 0.0, 2.5])


def _truck_rear(model: Modeller, variant: int, detail: int) -> None:
    x = -3.595
    if detail < 2:
        model.add_box([x, -1.15, 0.5], [x + 0.2, 1.15, 0.8], TRIM)
    lamp = [[[x - 0.005, y, z] for y in (0.78, 1.08)] for z in (0.56, 0.74)]
    model.add_sheet(lamp, TAIL_LAMP)
    if detail:
        return
    model.add_sheet([[[x - 0.006, y, z] for y in (1.08, 1.15)] for z in (0.56, 0.74)], INDICATOR)
    model.add_sheet([[[x - 0.005, y, z] for y in (-0.26, 0.26)] for z in (0.60, 0.72)], PLATE, mirror=False)
    for low, high in (((-0.012, 1.0), (0.012, 3.16)), ((1.14, 1.0), (1.17, 3.16)), ((-1.17, 1.0), (-1.14, 3.16))):
        gap = [[[-3.586, y, z] for y in (low[0], high[0])] for z in (low[1], high[1])]
        model.add_sheet(gap, GREY_TRIM, mirror=False)
    for z in (1.0, 3.15):
        rail = [[[a, 1.204, z + h] for h in (0.0, 0.05)] for a in (-3.58, 1.52)]
        model.add_sheet(rail, _RAIL)
    if variant == 1:
        sign = [[[a, 1.205, h] for h in (1.7, 2.4)] for a in (-2.6, 0.4)]
        model.add_sheet(sign, plain(36, 92, 150))
