"""Exact BEV layers road, vehicle and lane on a grid around the ego; amodal: nothing is occluded."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.bevmap import LANE, ROAD, VEHICLE
from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, frozen
from appocc.geometry import inverse
from appocc.grid import BEVGrid
from appocc.rasterise import LANE_SHARE, ROAD_SHARE, ROUNDING, VEHICLE_SHARE, polygon_owner
from appocc.simulation.surface import CELL_M, LANE_SURFACES, ROAD_SURFACES, Ground, surface_table
from appocc.simulation.truth.objects import ActorBoxes

_FINE = 12
_FLAGS = surface_table(ROAD_SURFACES).astype(np.uint8) + 2 * surface_table(LANE_SURFACES).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class ExactOccupancy:
    """Exact occupancy of a grid.

    Attributes:
        occupancy: (3, X, Y) float32, 0 or 1: road, vehicle, lane.
        valid: (3, X, Y) bool; road and lane are unknown where a cell extends beyond the town's ground.
        vehicle: (X, Y) int32 index of the actor that covers the cell, -1 for none.
    """

    occupancy: Float32Array
    valid: BoolArray
    vehicle: NDArray[np.int32]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.occupancy, self.valid, self.vehicle):
            frozen(array)


def exact_occupancy(ground: Ground, grid: BEVGrid, town_from_ego: FloatArray, objects: ActorBoxes) -> ExactOccupancy:
    """Compute the layers of a frame.

    Args:
        ground: labels of the town's ground.
        grid: cells in the ego frame.
        town_from_ego: (4, 4) pose; the ego is upright on z = 0.
        objects: actors around the ego, without the ego; those of the class vehicle count.
    """
    road, lane, known = ground_shares(ground, grid, town_from_ego)
    vehicle = vehicle_cells(grid, town_from_ego, objects)
    layers, valid = np.zeros((3, *grid.shape), np.float32), np.ones((3, *grid.shape), np.bool_)
    layers[ROAD] = (road >= ROAD_SHARE - ROUNDING) & known
    layers[LANE] = (lane >= LANE_SHARE - ROUNDING) & known
    layers[VEHICLE] = vehicle >= 0
    valid[[ROAD, LANE]] = known
    return ExactOccupancy(layers, valid, vehicle)


def ground_shares(
    ground: Ground, grid: BEVGrid, town_from_ego: FloatArray, fine: int = _FINE
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return the shares of road and lane markings in each cell, both (X, Y), and whether all of it is on the ground.

    Args:
        ground: labels of the town's ground.
        grid: cells in the ego frame.
        town_from_ego: (4, 4) pose.
        fine: samples along each side of a cell with mixed labels.
    """
    turn = town_from_ego[:2, :2]
    corner = turn @ np.array([grid.x_min_m, grid.y_min_m]) + town_from_ego[:2, 3] - ground.low_m
    cell = np.ascontiguousarray(turn * (grid.cell_m / CELL_M))
    # Coarse samples must not skip a line: they are denser than the labels.
    coarse = max(math.ceil(grid.cell_m / CELL_M) + 1, 2)
    return _shares(ground.label, _FLAGS, corner / CELL_M, cell, *grid.shape, coarse, max(fine, coarse))


@numba.njit(cache=True, nogil=True)
def _shares(
    label: ByteArray, flags: ByteArray, corner: FloatArray, cell: FloatArray, x: int, y: int, coarse: int, fine: int
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return shares of flags 1 and 2 in cells; `corner` (2,), `cell` (2, 2; a column an axis) in units of labels."""
    road, lane = np.zeros((x, y), np.float64), np.zeros((x, y), np.float64)
    known = np.ones((x, y), np.bool_)
    for i in range(x):
        for j in range(y):
            count = coarse * coarse
            on_road, on_lane, inside = _count(label, flags, corner, cell, i, j, coarse)
            if inside and (0 < on_road < count or 0 < on_lane < count):
                count = fine * fine
                on_road, on_lane, inside = _count(label, flags, corner, cell, i, j, fine)
            road[i, j], lane[i, j], known[i, j] = on_road / count, on_lane / count, inside
    return road, lane, known


@numba.njit(cache=True, nogil=True)
def _count(
    label: ByteArray, flags: ByteArray, corner: FloatArray, cell: FloatArray, i: int, j: int, samples: int
) -> tuple[int, int, bool]:
    """Count the samples x samples points of a cell with flag 1 and flag 2, and whether all are on the ground."""
    high, wide = label.shape
    on_road, on_lane, inside = 0, 0, True
    for k in range(samples):
        ahead = i + (k + 0.5) / samples
        for m in range(samples):
            left = j + (m + 0.5) / samples
            east = corner[0] + cell[0, 0] * ahead + cell[0, 1] * left
            north = corner[1] + cell[1, 0] * ahead + cell[1, 1] * left
            if 0 <= east < wide and 0 <= north < high:
                flag = flags[label[int(north), int(east)]]
                on_road += flag & 1
                on_lane += flag >> 1
            else:
                inside = False
    return on_road, on_lane, inside


def vehicle_cells(grid: BEVGrid, town_from_ego: FloatArray, objects: ActorBoxes) -> NDArray[np.int32]:
    """Return (X, Y) int32 index of the vehicle that covers most, and at least half, of a cell; -1 for none."""
    ego_from_town = inverse(town_from_ego)
    vehicles = objects.select(objects.are_vehicles())
    outlines = vehicles.footprints() @ ego_from_town[:2, :2].T + ego_from_town[:2, 3]
    owner = polygon_owner(grid, outlines, VEHICLE_SHARE)
    return np.append(vehicles.number, -1)[owner].astype(np.int32)
