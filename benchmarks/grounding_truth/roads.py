"""Road geometry from the road layer of a true map: our lane, widths, kerbs.

Ego frame; `road` is (X, Y), the known road cells of a grid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.grid import BEVGrid

EGO = EgoVehicle()
# Range ahead in which kerbs define the lane, and its largest extension; tolerance of the kerbs from a parabola, and
# the share of the range that one of them and both together must cover.
LANE_X_M, KERB_OFF_M, KERB_SHARE, BOTH_SHARES = (2.0, 28.0, 39.0), 0.35, 0.65, 1.0
# Candidate slopes and curvatures (1/m); a straight line is preferred if a curve fits only slightly better.
SLOPES, BENDS = np.linspace(-0.1, 0.1, 21), np.linspace(-0.005, 0.005, 11)
BEND_COST = 15.0
# A longer stretch without a kerb is a crossing, where our lane ends.
KERB_GAP_M = 3.0
# Cross-sections within this distance must agree, and no other roadway may be this close behind the kerb.
SECTIONS_M, SECTIONS_AGREE_M, OTHER_ROAD_M = (-3.0, -1.5, 0.0, 1.5, 3.0), 1.5, 8.0
ROAD_WIDTHS_M, FAR_M, STEP_M = (6.0, 24.0), 30.0, 0.2
# Distance to follow a road when testing for a street, and the least ratio of length to width.
LONG_M, LONGER = 25.0, 1.2


class Lane(NamedTuple):
    """Our lane ahead: y = bend[0] + bend[1] x + bend[2] x^2, as far as there is a kerb."""

    bend: FloatArray
    far_m: float

    def y(self, x_m: FloatArray | float) -> FloatArray:
        """Return the lateral position at places ahead."""
        x = np.asarray(x_m)
        return np.asarray(self.bend[0] + (self.bend[1] + self.bend[2] * x) * x)

    def yaw_rad(self, x_m: float) -> float:
        """Return the direction at a place; beyond the end, that of the end."""
        return float(np.arctan(self.bend[1] + 2 * self.bend[2] * np.clip(x_m, 0.0, self.far_m)))


def own_path(grid: BEVGrid, road: BoolArray) -> Lane | None:
    """Return our lane ahead, parallel to the kerbs; None without clear kerbs."""
    first, last = (int(grid.cell_of([x, 0.0])[0]) for x in (LANE_X_M[0], LANE_X_M[2]))
    middle = int(grid.cell_of([0.0, 0.0])[1])
    x = grid.centre_of(np.stack([np.arange(first, last), np.zeros(last - first)], axis=-1))[:, 0]
    tried = x < LANE_X_M[1]
    slope, bend = (each.ravel()[:, None] for each in np.meshgrid(SLOPES, BENDS))
    near = []
    for sign, rows in ((1, road[first:last, middle:]), (-1, road[first:last, middle::-1])):
        kerb = np.where(rows.all(axis=1), 1e3, np.argmin(rows, axis=1) * grid.cell_m)  # far if there is none
        flat = sign * kerb - slope * x - bend * x**2
        off_m = np.abs(flat - np.median(flat[:, tried], axis=1, keepdims=True))
        near.append(np.maximum(1 - off_m / KERB_OFF_M, 0.0))
    left, right = (one[:, tried].mean(axis=1) for one in near)
    best = int(np.argmax(left + right + np.maximum(left, right) - BEND_COST * np.abs(bend[:, 0])))
    shares = [float((one[best, tried] > 0).mean()) for one in near]
    if max(shares) < KERB_SHARE or sum(shares) < BOTH_SHARES:
        return None
    along = x[(near[0][best] > 0) | (near[1][best] > 0)]
    end = int(np.argmax(np.append(np.diff(along) > KERB_GAP_M, True)))
    b, c = float(slope[best, 0]), float(bend[best, 0])
    lane = Lane(np.array([-b * EGO.centre_m - c * EGO.centre_m**2, b, c]), float(along[end]))
    x = x[x <= lane.far_m]
    for aside in (EGO.width_m / 2, -EGO.width_m / 2):
        if not _on(grid, road, np.stack([x, lane.y(x) + aside], axis=-1))[0].all():
            return None
    return lane


def is_street(grid: BEVGrid, road: BoolArray, at_m: FloatArray, yaw_rad: float) -> bool:
    """Return whether the road at a place is longer along a direction than wide, unlike a car park."""
    runs = []
    for turn in np.arange(4) * np.pi / 2:
        on, inside = _ray(grid, road, at_m, yaw_rad + turn, LONG_M)
        on = on | ~inside
        runs.append(LONG_M if on.all() else STEP_M * int(np.argmin(on)))
    return runs[0] + runs[2] > LONGER * (runs[1] + runs[3])


def kerbs(grid: BEVGrid, road: BoolArray, at_m: FloatArray, yaw_rad: float) -> tuple[float, float] | None:
    """Return the distances of the kerbs to the left (+) and right (-) of a pose; None without two clear kerbs."""
    ends = []
    for side in (1, -1):
        found = []
        for along in SECTIONS_M:
            start = at_m + along * np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
            on, inside = _ray(grid, road, start, yaw_rad + side * np.pi / 2, FAR_M)
            end = int(np.argmin(on))
            beyond = slice(end + 3, end + int(OTHER_ROAD_M / STEP_M))
            if on.all() or not inside[: beyond.stop].all() or on[beyond].any():
                return None
            found.append(side * end * STEP_M)
        if max(found) - min(found) > SECTIONS_AGREE_M:
            return None
        ends.append(float(np.median(found)))
    left, right = ends
    return (left, right) if ROAD_WIDTHS_M[0] <= left - right <= ROAD_WIDTHS_M[1] else None


def to_kerb(grid: BEVGrid, road: BoolArray, side: int) -> tuple[FloatArray, FloatArray]:
    """Return the distance (X, Y) of the kerb on a side (1 left, -1 right) from each cell, in metres, and its y."""
    ordered = road[:, ::-side]  # cells nearer to the kerb come first
    columns = np.arange(road.shape[1])
    last_off = np.maximum.accumulate(np.where(ordered, -1, columns), axis=1)
    away_m = np.asarray((columns - last_off - 0.5) * grid.cell_m, dtype=np.float64)[:, ::-side]
    return away_m, grid.centres()[..., 1] + side * away_m


def _ray(
    grid: BEVGrid, road: BoolArray, at_m: FloatArray, yaw_rad: float, far_m: float
) -> tuple[BoolArray, BoolArray]:
    """Return whether (K,) points on a ray are road, and whether they are on the map."""
    steps = np.arange(0.0, far_m, STEP_M)[:, None]
    return _on(grid, road, at_m + steps * np.array([np.cos(yaw_rad), np.sin(yaw_rad)]))


def _on(grid: BEVGrid, road: BoolArray, xy_m: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return whether (K,) points (K, 2) are road, and whether they are on the map."""
    cells = grid.cell_of(xy_m)
    inside = grid.contains(cells)
    i, j = np.where(inside[:, None], cells, 0).T
    return road[i, j] & inside, inside
