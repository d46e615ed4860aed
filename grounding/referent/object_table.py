"""Everything on the street as arrays, so that each thing that is said is weighed for all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray
from appocc.geometry import footprints, wrap_angle
from grounding.road.lane_model import Lanes, Traffic, lanes_of
from grounding.scene_object import EGO_CENTRE_M, SceneObject
from tracking.vehicle_classes import HEIGHT_M

if TYPE_CHECKING:
    from grounding.road.road_map import Road

# The eye of the driver, in the ego frame; how many rays go to each thing; who looks over whom.
_EYE_M = np.array([1.7, 0.0])
_RAYS = np.linspace(0.1, 0.9, 5)
_TALLER_M = 0.5
# Places on the way of sight that are looked at.
_STEPS = 60
_STANDS_MPS, _MOVES_MPS = 0.4, 1.0
# Lengths of vehicles on a map that is sure of every cell, and on one that is not.
_EXACT_M, _PREDICTED_M = 0.15, 0.5


@dataclass(frozen=True)
class Crowd:
    """N things in the ego frame, metres, seconds and radians; NaN where a value is unknown.

    Attributes:
        items: the things.
        vehicle: (N,) whether it is one, and no person or bicycle.
        xy_m: (N, 2) centres.
        yaw_rad: (N,) directions of the long axes.
        front_known: (N,) whether those are headings.
        size_m: (N, 3) length, width, height.
        velocity_mps: (N, 2) over ground.
        yaw_rate_radps: (N,) how fast headings turn.
        acceleration_mps2: (N,) changes of speed.
        rgb: (N, 3) sRGB 0..255.
        lanes: the road that they are on.
        along_m: (N,) way along our lane to the level of each.
        sideways_m: (N,) distance to the left of the middle of our lane.
        turn_rad: (N,) headings relative to the direction of the road there, in [-pi, pi).
        off_road_m: (N,) how far the view from the ego leads over what the map knows to be no road.
        size_doubt_m: how far lengths may be off: more on predicted maps.
    """

    items: tuple[SceneObject, ...]
    vehicle: BoolArray
    xy_m: FloatArray
    yaw_rad: FloatArray
    front_known: BoolArray
    size_m: FloatArray
    velocity_mps: FloatArray
    yaw_rate_radps: FloatArray
    acceleration_mps2: FloatArray
    rgb: FloatArray
    lanes: Lanes
    along_m: FloatArray
    sideways_m: FloatArray
    turn_rad: FloatArray
    off_road_m: FloatArray
    size_doubt_m: float

    def __len__(self) -> int:
        """How many they are."""
        return len(self.items)

    @cached_property
    def kind(self) -> tuple[str, ...]:
        """Plain words of their classes; "vehicle" where only a shape is known."""
        return tuple(item.noun for item in self.items)

    @cached_property
    def speed_mps(self) -> FloatArray:
        """(N,) speeds."""
        return np.asarray(np.hypot(*self.velocity_mps.T))

    @cached_property
    def distance_m(self) -> FloatArray:
        """(N,) from the middle of the ego."""
        return np.asarray(np.hypot(self.xy_m[:, 0] - EGO_CENTRE_M, self.xy_m[:, 1]))

    @cached_property
    def corners_m(self) -> FloatArray:
        """(N, 4, 2) footprints."""
        return footprints(self.xy_m, self.yaw_rad, self.size_m[:, :2])

    @cached_property
    def visible(self) -> FloatArray:
        """(N,) shares of each that no nearer vehicle hides from the driver; one looks over lower ones."""
        return _visible(self)


def crowd_of(items: Sequence[SceneObject], vehicles: int, bev: BEVMap | None, road: Road | None) -> Crowd:
    """The arrays of things, of which the first so many are vehicles, and the lanes that they and a map show."""
    nothing = (np.nan, np.nan)
    xy_m = np.array([item.centre_m for item in items]).reshape(-1, 2)
    yaw_rad = np.array([item.yaw_rad for item in items])
    front_known = np.array([item.front_known for item in items], np.bool_)
    velocity = np.array([nothing if item.velocity_mps is None else item.velocity_mps for item in items]).reshape(
        -1, 2
    )
    speed = np.nan_to_num(np.hypot(*velocity.T), nan=0.7)
    moving, standing = speed > _MOVES_MPS, speed < _STANDS_MPS
    first = slice(vehicles)
    traffic = Traffic(xy_m[first], yaw_rad[first], front_known[first], moving[first], standing[first])
    lanes = lanes_of(traffic, bev, road)
    along_m, sideways_m = lanes.along_and_sideways(xy_m)
    return Crowd(
        tuple(items),
        np.arange(len(items)) < vehicles,
        xy_m,
        yaw_rad,
        front_known,
        np.array([(i.length_m, i.width_m, _or_nan(i.height_m)) for i in items]).reshape(-1, 3),
        velocity,
        np.array([_or_nan(item.yaw_rate_radps) for item in items]),
        np.array([_or_nan(item.acceleration_mps2) for item in items]),
        np.array([(*nothing, np.nan) if item.rgb is None else item.rgb for item in items]).reshape(-1, 3),
        lanes,
        along_m,
        sideways_m,
        np.asarray(wrap_angle(yaw_rad - lanes.direction_rad(xy_m))),
        np.zeros(len(items)) if bev is None else _off_road(xy_m, bev),
        _EXACT_M if bev is None or _certain(bev) else _PREDICTED_M,
    )


def _off_road(xy_m: FloatArray, bev: BEVMap) -> FloatArray:
    share = np.linspace(0, 1, _STEPS)
    cells = bev.grid.cell_of(_EYE_M + share[:, None] * (xy_m - _EYE_M)[:, None])
    inside = bev.grid.contains(cells)
    i, j = np.moveaxis(np.where(inside[..., None], cells, 0), -1, 0)
    off = inside & bev.occupancy_valid[ROAD][i, j] & ~bev.on[ROAD][i, j]
    return np.asarray(off.mean(axis=1) * np.hypot(*(xy_m - _EYE_M).T))


def _certain(bev: BEVMap) -> bool:
    probability = bev.occupancy[VEHICLE]
    return bool(((probability == 0) | (probability == 1)).all())


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _visible(crowd: Crowd) -> FloatArray:
    n = len(crowd)
    if not n:
        return np.zeros(0)
    sight = crowd.corners_m - _EYE_M
    middle = crowd.xy_m - _EYE_M
    towards = np.arctan2(middle[:, 1], middle[:, 0])
    off = wrap_angle(np.arctan2(sight[..., 1], sight[..., 0]) - towards[:, None])
    low, high = off.min(axis=1), off.max(axis=1)
    bearing = (towards + low)[:, None] + (high - low)[:, None] * _RAYS
    enter = _enters(crowd, bearing.ravel()).reshape(n, len(_RAYS), n)
    own = enter[np.arange(n), :, np.arange(n)]
    height = np.where(np.isnan(crowd.size_m[:, 2]), HEIGHT_M["car"], crowd.size_m[:, 2])
    hides = crowd.vehicle & (height[:, None] < height + _TALLER_M) & ~np.eye(n, dtype=np.bool_)
    blocked = ((enter < own[..., None] - 0.3) & hides[:, None]).any(axis=2)
    return np.asarray(1 - blocked.mean(axis=1))


def _enters(crowd: Crowd, bearing_rad: FloatArray) -> FloatArray:
    """(R, N) how far from the eye each ray enters each footprint, infinity where it does not."""
    cos, sin = np.cos(crowd.yaw_rad), np.sin(crowd.yaw_rad)
    turn = np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)
    origin = np.einsum("nij,nj->ni", turn, _EYE_M - crowd.xy_m)
    ray = np.stack([np.cos(bearing_rad), np.sin(bearing_rad)], axis=1)
    ray = np.einsum("nij,rj->rni", turn, ray)
    ray = np.where(np.abs(ray) < 1e-9, 1e-9, ray)
    half = crowd.size_m[:, :2] / 2
    first, second = (-half - origin) / ray, (half - origin) / ray
    near, far = np.minimum(first, second).max(axis=2), np.maximum(first, second).min(axis=2)
    return np.where((near <= far) & (far > 0), np.maximum(near, 0), np.inf)
