"""Exact layers road, vehicle and lane on a grid around the ego, amodal: nothing hides what is true."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.bevmap import LANE, ROAD, VEHICLE
from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, frozen
from appocc.geometry import inverse
from appocc.grid import BEVGrid
from appocc.rasterise import polygon_cover
from appocc.simulation.surface import CELL_M, LANE_SURFACES, ROAD_SURFACES, Ground, surface_table
from appocc.simulation.truth.objects import Objects

ROAD_SHARE = VEHICLE_SHARE = 0.5
LANE_SHARE = 0.2
# A box whose side runs along the middle of cells covers half of each, give or take rounding.
_ROUNDING = 1e-9
_FLAGS = surface_table(ROAD_SURFACES).astype(np.uint8) + 2 * surface_table(LANE_SURFACES).astype(np.uint8)


@dataclass(frozen=True)
class Occupancy:
    """What is true of every cell of a grid.

    Attributes:
        occupancy: (3, X, Y) float32, 0 or 1: road, vehicle, lane.
        valid: (3, X, Y) bool; road and lane are unknown where a cell reaches beyond the town's ground.
        vehicle: (X, Y) int32 number of the actor that covers the cell, -1 for none.
    """

    occupancy: Float32Array
    valid: BoolArray
    vehicle: NDArray[np.int32]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.occupancy, self.valid, self.vehicle):
            frozen(array)


def occupancy(
    ground: Ground, grid: BEVGrid, town_from_ego: FloatArray, objects: Objects, samples: int = 5
) -> Occupancy:
    """The layers of a moment.

    Args:
        ground: labels of the town's ground.
        grid: cells in the ego frame.
        town_from_ego: (4, 4) pose; the ego stands upright on z = 0.
        objects: actors around the ego, the ego left out; those of the class vehicle count.
        samples: looks at the ground along each side of a cell.
    """
    road, lane, known = ground_shares(ground, grid, town_from_ego, samples)
    vehicle = vehicle_cells(grid, town_from_ego, objects)
    layers, valid = np.zeros((3, *grid.shape), np.float32), np.ones((3, *grid.shape), np.bool_)
    layers[ROAD] = (road >= ROAD_SHARE) & known
    layers[LANE] = (lane >= LANE_SHARE) & known
    layers[VEHICLE] = vehicle >= 0
    valid[[ROAD, LANE]] = known
    return Occupancy(layers, valid, vehicle)


def ground_shares(
    ground: Ground, grid: BEVGrid, town_from_ego: FloatArray, samples: int = 5
) -> tuple[Float32Array, Float32Array, BoolArray]:
    """Shares of road and of lane markings in each cell, both (X, Y) float32, and whether it lies on the ground."""
    turn, step = town_from_ego[:2, :2], grid.cell_m / samples
    first = turn @ (np.array([grid.x_min_m, grid.y_min_m]) + step / 2) + town_from_ego[:2, 3]
    steps = turn * (step / CELL_M)
    x, y = grid.shape
    return _shares(ground.label, _FLAGS, (first - ground.low_m) / CELL_M, np.ascontiguousarray(steps), x, y, samples)


@numba.njit(cache=True, nogil=True)
def _shares(
    label: ByteArray, flags: ByteArray, first: FloatArray, steps: FloatArray, x: int, y: int, samples: int
) -> tuple[Float32Array, Float32Array, BoolArray]:
    """Count labels at samples x samples points of each cell; `first` and `steps` (2, 2) in units of labels."""
    high, wide = label.shape
    road, lane = np.zeros((x, y), np.float32), np.zeros((x, y), np.float32)
    known = np.ones((x, y), np.bool_)
    share = 1.0 / (samples * samples)
    for i in range(x):
        for j in range(y):
            on_road, on_lane = 0, 0
            for k in range(samples):
                ahead = i * samples + k
                for m in range(samples):
                    left = j * samples + m
                    east = first[0] + steps[0, 0] * ahead + steps[0, 1] * left
                    north = first[1] + steps[1, 0] * ahead + steps[1, 1] * left
                    if 0 <= east < wide and 0 <= north < high:
                        flag = flags[label[int(north), int(east)]]
                        on_road += flag & 1
                        on_lane += flag >> 1
                    else:
                        known[i, j] = False
            road[i, j], lane[i, j] = on_road * share, on_lane * share
    return road, lane, known


def vehicle_cells(grid: BEVGrid, town_from_ego: FloatArray, objects: Objects) -> NDArray[np.int32]:
    """(X, Y) int32 number of the vehicle that covers at least half of a cell, the one that covers most; -1 none."""
    ego_from_town = inverse(town_from_ego)
    vehicles = objects.select(objects.are_vehicles())
    outlines = vehicles.footprints() @ ego_from_town[:2, :2].T + ego_from_town[:2, 3]
    best = np.full(grid.shape, VEHICLE_SHARE - _ROUNDING)
    owner = np.full(grid.shape, -1, np.int32)
    for number, outline in zip(vehicles.number, outlines, strict=True):
        low = np.clip(grid.cell_of(outline.min(axis=0)), 0, grid.shape)
        high = np.clip(grid.cell_of(outline.max(axis=0)) + 1, 0, grid.shape)
        if (high <= low).any():
            continue
        window = np.s_[low[0] : high[0], low[1] : high[1]]
        cover = polygon_cover(_part(grid, low, high), outline)
        more = cover > best[window]
        best[window][more], owner[window][more] = cover[more], number
    return owner


def _part(grid: BEVGrid, low: NDArray[np.int64], high: NDArray[np.int64]) -> BEVGrid:
    """The cells from `low` to before `high` as a grid of its own."""
    c = grid.cell_m
    x0, y0 = float(grid.x_min_m + low[0] * c), float(grid.y_min_m + low[1] * c)
    return BEVGrid(x0, x0 + float(high[0] - low[0]) * c, y0, y0 + float(high[1] - low[1]) * c, c)
