"""The exact map of a key frame: roads and lines of the map, boxes, and colours seen from far above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.boxes import is_vehicle
from appocc.carla.frames import BODY_FROM_CAM, pose_of
from appocc.carla.roads import Roads
from appocc.carla.sensors import Sensors, depth_of, picture_of
from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import apply, footprints, inverse, transform, yaw_of
from appocc.grid import BEVGrid
from appocc.groundtruth.occupancy import mask_road, vector_lane
from appocc.nuscenes.writer import Annotation
from appocc.rasterise import VEHICLE_SHARE, polygon_owner

ABOVE_RGB, ABOVE_DEPTH = "above/rgb", "above/depth"
_HEIGHT_M, _PIXELS, _WIDE_M = 250.0, 1024, 90.0
# Higher things, such as crowns of trees and bridges, hide the road.
_TALLEST_M = 4.5
_REACH_M = 60.0
_SUBSAMPLES = 4


@dataclass(eq=False)
class Above:
    """A camera far above the ego vehicle that looks down, with its depth: nearly an orthographic one.

    It is moved before every key frame; where it was is told by its picture.
    """

    actors: Sequence[Any]

    @classmethod
    def added(cls, sensors: Sensors) -> Above:
        """Add the camera to the sensors."""
        fov = float(np.degrees(2 * np.arctan(_WIDE_M / 2 / _HEIGHT_M)))
        size = {"image_size_x": _PIXELS, "image_size_y": _PIXELS, "fov": fov, "motion_blur_intensity": 0.0}
        start = _above(np.eye(4))
        kinds = ((ABOVE_RGB, "sensor.camera.rgb"), (ABOVE_DEPTH, "sensor.camera.depth"))
        return cls([sensors.add(name, kind, size, start) for name, kind in kinds])

    def move(self, world_from_ego: FloatArray, to_carla: Any) -> None:
        """Move it above the ego vehicle; `to_carla` makes a carla.Transform of a pose."""
        for actor in self.actors:
            actor.set_transform(to_carla(_above(world_from_ego)))


def exact_map(
    world_from_ego: FloatArray,
    roads: Roads,
    boxes: Sequence[Annotation],
    instances: Sequence[str],
    body: EgoVehicle,
    data: Mapping[str, Any],
) -> tuple[BEVMap, dict[str, Any]]:
    """Return the map of a key frame, and the further array `instance` (X, Y) that is stored with it.

    Args:
        world_from_ego: (4, 4) pose of the ego vehicle.
        roads: roads of the map.
        boxes: objects around the ego vehicle.
        instances: their tokens.
        body: ego vehicle, whose own colours are left out.
        data: of the sensors, with those of `Above`.
    """
    grid = BEVGrid.surround()
    centre = world_from_ego[:2, 3]
    low, high = np.floor(centre - _REACH_M), np.ceil(centre + _REACH_M)
    near = roads.near(low, high)
    owner = _vehicles(grid, world_from_ego, boxes)
    occupancy = np.zeros((3, *grid.shape), np.float32)
    occupancy[ROAD] = mask_road(grid, world_from_ego, near.mask(low, high)).on
    occupancy[LANE] = vector_lane(grid, world_from_ego, tuple(line for line, _ in near.lines)).on
    occupancy[VEHICLE] = owner >= 0
    appearance, valid = _colours(grid, world_from_ego, data)
    meta = {"source": "simulated", "simulator": "CARLA", "instances": list(instances)}
    everywhere = np.ones((3, *grid.shape), np.bool_)
    made = BEVMap(grid, occupancy, everywhere, appearance, valid & ~body.body_cells(grid), meta)
    return made, {"instance": owner.astype(np.int32)}


def _above(world_from_ego: FloatArray) -> FloatArray:
    """Return the pose of the sensor's body: it looks down, with the ego's front above in its picture."""
    yaw = float(yaw_of(world_from_ego))
    cos, sin = np.cos(yaw), np.sin(yaw)
    ahead, left = np.array([cos, sin, 0.0]), np.array([-sin, cos, 0.0])
    return transform(np.stack([[0.0, 0.0, -1.0], left, ahead], axis=1), world_from_ego[:3, 3] + [0, 0, _HEIGHT_M])


def _vehicles(grid: BEVGrid, world_from_ego: FloatArray, boxes: Sequence[Annotation]) -> IntArray:
    """Return (X, Y) index of the box of a vehicle that covers most of a cell, at least half; -1 for none."""
    rows = [index for index, box in enumerate(boxes) if is_vehicle(box.category)]
    poses = np.array([inverse(world_from_ego) @ boxes[row].world_from_box for row in rows]).reshape(-1, 4, 4)
    sizes = np.array([boxes[row].size_wlh_m[1::-1] for row in rows]).reshape(-1, 2)
    outlines = footprints(poses[:, :2, 3], yaw_of(poses), sizes)
    owner = polygon_owner(grid, outlines, VEHICLE_SHARE)
    return np.append(np.array(rows, np.int64), -1)[owner]


def _colours(grid: BEVGrid, world_from_ego: FloatArray, data: Mapping[str, Any]) -> tuple[ByteArray, BoolArray]:
    """Return the colours (3, X, Y) of the ground and what is on it, and which (X, Y) are known."""
    rgb, depth = picture_of(data[ABOVE_RGB]), depth_of(data[ABOVE_DEPTH])
    ego_from_cam = inverse(world_from_ego) @ pose_of(data[ABOVE_RGB].transform) @ BODY_FROM_CAM
    part = (np.arange(_SUBSAMPLES) + 0.5) / _SUBSAMPLES - 0.5
    offset = np.stack(np.meshgrid(part, part, indexing="ij"), axis=-1).reshape(-1, 2) * grid.cell_m
    ground = np.pad(grid.centres()[:, :, None] + offset, ((0, 0), (0, 0), (0, 0), (0, 1)))
    places = apply(inverse(ego_from_cam), ground)
    focal = _PIXELS / 2 * _HEIGHT_M / (_WIDE_M / 2)
    pixel = np.rint(places[..., :2] / places[..., 2:] * focal + (_PIXELS - 1) / 2).astype(int)
    inside = ((pixel >= 0) & (pixel < _PIXELS)).all(axis=-1)
    column, row = np.clip(np.moveaxis(pixel, -1, 0), 0, _PIXELS - 1)
    free = inside & _is_low(depth[row, column], places[..., 2])
    count = free.sum(axis=2)
    total = (rgb[row, column].astype(np.float64) * free[..., None]).sum(axis=2)
    colours = np.rint(total / np.maximum(count, 1)[..., None]).astype(np.uint8)
    return np.moveaxis(colours, -1, 0).copy(), count >= _SUBSAMPLES**2 / 2


def _is_low(depth_m: Float32Array, ground_m: FloatArray) -> BoolArray:
    """Return whether what is seen is not much higher than the ground."""
    return np.asarray(ground_m - depth_m < _TALLEST_M)
