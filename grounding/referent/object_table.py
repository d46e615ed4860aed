"""The objects of a scene as arrays: predicates apply to all objects in one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import footprints, wrap_angle
from appocc.motion_state import MOVING_MPS, STANDING_MPS
from grounding.road.lane_model import LaneModel, LaneTraffic, lanes_from_map, lanes_from_vehicles
from grounding.scene_object import SceneObject
from tracking.vehicle_classes import HEIGHT_M

if TYPE_CHECKING:
    from grounding.road.road_map import RoadMap

# The driver's eye in the ego frame, and where rays from it cross an object, as fractions of its angular width.
_DRIVER_EYE_M = np.array([1.7, 0.0])
_RAY_FRACTIONS = np.linspace(0.1, 0.9, 5)
# A driver sees over vehicles that are lower than the object by at least this.
_SEEN_OVER_M = 0.5
_SIGHT_LINE_SAMPLES = 60
# Standard deviation of vehicle lengths on binary maps and on predicted ones.
_BINARY_LENGTH_STD_M, _PREDICTED_LENGTH_STD_M = 0.15, 0.5


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjectTable:
    """N objects in the ego frame, in metres, seconds and radians; NaN where a value is unknown.

    Attributes:
        items: the objects.
        is_vehicle: (N,) False for people and bicycles.
        xy_m: (N, 2) centres.
        yaw_rad: (N,) directions of the long axes.
        front_known: (N,) whether `yaw_rad` is the heading.
        size_m: (N, 3) length, width, height.
        velocity_mps: (N, 2) over ground.
        yaw_rate_radps: (N,) positive to the left.
        acceleration_mps2: (N,) along the heading.
        rgb: (N, 3) sRGB 0..255.
        lanes: lane model of the road.
        along_m: (N,) arc length along the ego lane.
        lateral_m: (N,) offset from the centre of the ego lane, positive to the left.
        relative_heading_rad: (N,) headings relative to the road direction at each object, in [-pi, pi).
        off_road_sight_m: (N,) length of the line of sight from the ego that crosses known off-road cells.
        length_std_m: standard deviation of the lengths, larger on predicted maps.
        ego: size of the ego vehicle.
    """

    items: tuple[SceneObject, ...]
    is_vehicle: BoolArray
    xy_m: FloatArray
    yaw_rad: FloatArray
    front_known: BoolArray
    size_m: FloatArray
    velocity_mps: FloatArray
    yaw_rate_radps: FloatArray
    acceleration_mps2: FloatArray
    rgb: FloatArray
    lanes: LaneModel
    along_m: FloatArray
    lateral_m: FloatArray
    relative_heading_rad: FloatArray
    off_road_sight_m: FloatArray
    length_std_m: float
    ego: EgoVehicle

    @classmethod
    def from_objects(
        cls,
        items: Sequence[SceneObject],
        num_vehicles: int,
        bev: BEVMap | None,
        road: RoadMap | None,
        ego: EgoVehicle,
    ) -> ObjectTable:
        """Build the table and the lane model of objects; the first `num_vehicles` are vehicles, the rest are not."""
        xy_m = np.array([item.centre_m for item in items]).reshape(-1, 2)
        yaw_rad = np.array([item.yaw_rad for item in items])
        front_known = np.array([item.front_known for item in items], np.bool_)
        velocity_mps = _stack([item.velocity_mps for item in items], 2)
        # A vehicle of unknown speed counts neither as moving nor as standing.
        speed = np.nan_to_num(np.hypot(*velocity_mps.T), nan=0.7)
        moving, standing = speed > MOVING_MPS, speed < STANDING_MPS
        first = slice(num_vehicles)
        traffic = LaneTraffic(xy_m[first], yaw_rad[first], front_known[first], moving[first], standing[first])
        if bev is None or road is None:
            lanes = lanes_from_vehicles(traffic)
        else:
            lanes = lanes_from_map(traffic, bev, road.ego_lane, road.traffic_side > 0, ego)
        along_m, lateral_m = lanes.project(xy_m)
        return cls(
            items=tuple(items),
            is_vehicle=np.arange(len(items)) < num_vehicles,
            xy_m=xy_m,
            yaw_rad=yaw_rad,
            front_known=front_known,
            size_m=np.array([(i.length_m, i.width_m, _or_nan(i.height_m)) for i in items]).reshape(-1, 3),
            velocity_mps=velocity_mps,
            yaw_rate_radps=np.array([_or_nan(item.yaw_rate_radps) for item in items]),
            acceleration_mps2=np.array([_or_nan(item.acceleration_mps2) for item in items]),
            rgb=_stack([item.rgb for item in items], 3),
            lanes=lanes,
            along_m=along_m,
            lateral_m=lateral_m,
            relative_heading_rad=np.asarray(wrap_angle(yaw_rad - lanes.direction_rad(xy_m))),
            off_road_sight_m=np.zeros(len(items)) if bev is None else _off_road_sight_m(xy_m, bev),
            length_std_m=_BINARY_LENGTH_STD_M if bev is None or _is_binary(bev) else _PREDICTED_LENGTH_STD_M,
            ego=ego,
        )

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.items)

    @property
    def is_exact(self) -> bool:
        """Whether shapes are true ones, not those of a network."""
        return self.length_std_m <= _BINARY_LENGTH_STD_M

    @cached_property
    def class_names(self) -> tuple[str, ...]:
        """Class of each object as a plain noun; "vehicle" where only the shape is known."""
        return tuple(item.class_name for item in self.items)

    @cached_property
    def speed_mps(self) -> FloatArray:
        """(N,) speeds."""
        return np.asarray(np.hypot(*self.velocity_mps.T))

    @cached_property
    def distance_m(self) -> FloatArray:
        """(N,) distances from the ego centre to the object centres."""
        return np.asarray(np.hypot(self.xy_m[:, 0] - self.ego.centre_m, self.xy_m[:, 1]))

    @cached_property
    def corners_m(self) -> FloatArray:
        """(N, 4, 2) footprint corners."""
        return footprints(self.xy_m, self.yaw_rad, self.size_m[:, :2])

    @cached_property
    def visible_share(self) -> FloatArray:
        """(N,) share of each object that no nearer vehicle occludes for the driver."""
        return _visible_share(self)


def _stack(vectors: Sequence[FloatArray | None], size: int) -> FloatArray:
    """Stack vectors into (N, size) with rows of NaN for None."""
    unknown = (np.nan,) * size
    return np.array([unknown if vector is None else vector for vector in vectors]).reshape(-1, size)


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _off_road_sight_m(xy_m: FloatArray, bev: BEVMap) -> FloatArray:
    """Return the metres (N,) of the lines of sight to points (N, 2) that cross known off-road cells."""
    share = np.linspace(0, 1, _SIGHT_LINE_SAMPLES)
    cells = bev.grid.cell_of(_DRIVER_EYE_M + share[:, None] * (xy_m - _DRIVER_EYE_M)[:, None])
    inside = bev.grid.contains(cells)
    i, j = np.moveaxis(np.where(inside[..., None], cells, 0), -1, 0)
    off = inside & bev.occupancy_valid[ROAD][i, j] & ~bev.on[ROAD][i, j]
    return np.asarray(off.mean(axis=1) * np.hypot(*(xy_m - _DRIVER_EYE_M).T))


def _is_binary(bev: BEVMap) -> bool:
    """Whether all vehicle probabilities are 0 or 1, as on ground truth."""
    probability = bev.occupancy[VEHICLE]
    return bool(((probability == 0) | (probability == 1)).all())


def _visible_share(table: ObjectTable) -> FloatArray:
    """Return the share (N,) of rays from the driver's eye that reach each object before any occluder."""
    n = len(table)
    if not n:
        return np.zeros(0)
    sight = table.corners_m - _DRIVER_EYE_M
    middle = table.xy_m - _DRIVER_EYE_M
    towards = np.arctan2(middle[:, 1], middle[:, 0])
    off = wrap_angle(np.arctan2(sight[..., 1], sight[..., 0]) - towards[:, None])
    low, high = off.min(axis=1), off.max(axis=1)
    bearing = (towards + low)[:, None] + (high - low)[:, None] * _RAY_FRACTIONS
    hit_m = _hit_distance_m(table, bearing.ravel()).reshape(n, len(_RAY_FRACTIONS), n)
    own_hit_m = hit_m[np.arange(n), :, np.arange(n)]
    height = np.where(np.isnan(table.size_m[:, 2]), HEIGHT_M["car"], table.size_m[:, 2])
    occludes = table.is_vehicle & (height[:, None] < height + _SEEN_OVER_M) & ~np.eye(n, dtype=np.bool_)
    blocked = ((hit_m < own_hit_m[..., None] - 0.3) & occludes[:, None]).any(axis=2)
    return np.asarray(1 - blocked.mean(axis=1))


def _hit_distance_m(table: ObjectTable, bearing_rad: FloatArray) -> FloatArray:
    """Return the distance (R, N) at which each ray from the eye enters each footprint; infinity for a miss."""
    cos, sin = np.cos(table.yaw_rad), np.sin(table.yaw_rad)
    turn = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    origin = np.einsum("nij,nj->ni", turn, _DRIVER_EYE_M - table.xy_m)
    ray = np.stack([np.cos(bearing_rad), np.sin(bearing_rad)], axis=1)
    ray = np.einsum("nij,rj->rni", turn, ray)
    ray = np.where(np.abs(ray) < 1e-9, 1e-9, ray)
    half = table.size_m[:, :2] / 2
    first, second = (-half - origin) / ray, (half - origin) / ray
    near, far = np.minimum(first, second).max(axis=2), np.maximum(first, second).min(axis=2)
    return np.where((near <= far) & (far > 0), np.maximum(near, 0), np.inf)
