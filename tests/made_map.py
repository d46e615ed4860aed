"""Made-up maps: rectangles of one colour each on grey ground, cells on at half cover as in ground truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.geometry import quaternion_from_yaw, rotation_from_quaternion
from appocc.grid import BEVGrid
from appocc.rasterise import vehicle_owner

WHITE, RED, BLUE, BLACK = (240, 240, 240), (190, 30, 30), (30, 60, 170), (20, 20, 22)


class Car(NamedTuple):
    """A rectangle in the ego frame; without a colour its cells are unknown."""

    x_m: float
    y_m: float
    yaw_rad: float = 0.0
    rgb: tuple[float, float, float] | None = WHITE
    length_m: float = 4.5
    width_m: float = 1.8


def boxes_of(cars: list[Car]) -> Boxes:
    """The cars as annotated boxes."""
    n = len(cars)
    names = tuple(str(i) for i in range(n))
    return Boxes(
        centre_m=np.array([[car.x_m, car.y_m, 0.8] for car in cars]).reshape(n, 3),
        size_wlh_m=np.array([[car.width_m, car.length_m, 1.6] for car in cars]).reshape(n, 3),
        rotation=rotation_from_quaternion(np.array([quaternion_from_yaw(car.yaw_rad) for car in cars]).reshape(n, 4)),
        category=("vehicle.car",) * n,
        instance=names,
        token=names,
        velocity_mps=np.zeros((n, 2)),
        lidar_points=np.zeros(n, np.int64),
    )


def map_of(cars: list[Car], probability: float = 1.0, grid: BEVGrid | None = None) -> BEVMap:
    """The map of some cars."""
    grid = grid or BEVGrid.surround()
    owner = vehicle_owner(grid, boxes_of(cars))
    occupancy = np.zeros((3, *grid.shape), np.float32)
    occupancy[VEHICLE][owner >= 0] = probability
    appearance = np.full((3, *grid.shape), 90, np.uint8)
    known = np.ones(grid.shape, np.bool_)
    for i, car in enumerate(cars):
        appearance[:, owner == i] = np.array(car.rgb or (0, 0, 0), np.uint8)[:, None]
        known[owner == i] = car.rgb is not None
    return BEVMap(grid, occupancy, np.ones((3, *grid.shape), np.bool_), appearance, known)


def pose(x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0) -> FloatArray:
    """world_from_ego of an ego on flat ground."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]]
    matrix[:2, 3] = x_m, y_m
    return matrix
