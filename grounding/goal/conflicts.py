"""Vehicles that have to pass before we leave our lane: those that drive where our way leads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from appocc.checks import FloatArray
from appocc.motion_state import DRIVING_MPS
from grounding.referent.clarification import describe_one
from grounding.referent.scene import SceneModel
from grounding.road.car_paths import CarRoute
from grounding.road.free_space import gap_m
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject

# Speeds at which we may drive the way, how far ahead in time a vehicle is taken to keep its own, and how much earlier
# or later than we it may be there.
_SPEEDS_MPS, _HORIZON_S, _EARLIER_S = (3.0, 5.0, 8.0), 6.0, (0.0, -1.0, 1.0)
# Gap below which we are in its way.
_NEAR_M = 0.4
# From this lateral offset on we leave our lane.
_LEAVES_M = 1.0
# Who drives within this lateral offset of our lane, and our way, is ahead of us or follows us.
_IN_LANE_M = 1.5
# Points of the way are tested at this spacing.
_SPACING_M = 1.0


def explain_conflicts(found: Sequence[SceneObject], scene: SceneModel) -> list[str]:
    """Return which vehicle has to pass before we drive a way, in words; empty without one.

    Args:
        found: the vehicles that `find_conflicts` found, the nearest first.
        scene: the scene.
    """
    if not found:
        return []
    first = f"{describe_one(found[0], scene)}, drives at {found[0].speed_mps:.0f} m/s"
    more = f", and so {'do' if len(found) > 2 else 'does'} {len(found) - 1} more" if found[1:] else ""
    return [f"{first} and passes first{more}: we go once that way is clear"]


def find_conflicts(way: CarRoute, road: RoadMap, named: Sequence[SceneObject] = ()) -> list[SceneObject]:
    """Return the vehicles that reach our way when we do, the nearest first, if each keeps its speed and heading.

    Those in our own lane are none: we follow them, or they follow us.

    Args:
        way: the way.
        road: the road that we drive on, with its vehicles.
        named: the vehicles that the command names.
    """
    points, heading, run_m = _thin(way)
    outside = np.abs(road.ego_lane.project(points)[1]) > _LEAVES_M
    if not outside.any():
        return []
    points, heading, run_m = points[outside], heading[outside], run_m[outside]
    side = float(np.sign(road.ego_lane.project(points[:1])[1][0]))
    others = (one for one in _driving_elsewhere(road) if one not in named)
    found = [one for one in others if _is_beside(one, side, road) or _meets(one, points, heading, run_m, road)]
    return sorted(found, key=lambda one: one.distance_m(road.ego))


def _thin(way: CarRoute) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points (K, 2), headings (K,) and the length of the way up to there (K,)."""
    run_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way.points_m, axis=0).T))])
    kept = np.unique(np.searchsorted(run_m, np.arange(0.0, run_m[-1], _SPACING_M)))
    return way.points_m[kept], way.heading_rad[kept], run_m[kept]


def _driving_elsewhere(road: RoadMap) -> Iterator[SceneObject]:
    for item in road.free_space.objects:
        if not item.front_known or (item.speed_mps or 0.0) <= DRIVING_MPS:
            continue
        _, lateral_m = (float(each) for each in road.ego_lane.project(item.centre_m))
        if not (road.heads_our_way(item) and abs(lateral_m) < _IN_LANE_M):
            yield item


def _is_beside(item: SceneObject, side: float, road: RoadMap) -> bool:
    """Return whether a vehicle drives our way beside us, in the lane on the side (1: left) to which we leave ours."""
    along_m, lateral_m = (float(each) for each in road.ego_lane.project(item.centre_m))
    level = abs(along_m) < (item.length_m + road.ego.length_m) / 2
    return road.heads_as_we_do(item) and level and LANE_M / 2 < side * lateral_m < 1.5 * LANE_M


def _meets(item: SceneObject, points: FloatArray, heading: FloatArray, run_m: FloatArray, road: RoadMap) -> bool:
    """Return whether a vehicle comes into our way at one of our speeds."""
    ahead = np.array([np.cos(item.yaw_rad), np.sin(item.yaw_rad)])
    # Who drives our way ahead of us is not there any more when we are.
    leaves = road.heads_as_we_do(item) and (item.centre_m - road.start.xy_m) @ road.start.ahead > item.length_m
    for speed_mps in _SPEEDS_MPS:
        time_s = run_m / speed_mps
        soon = time_s < _HORIZON_S
        for earlier_s in (0.0,) if leaves else _EARLIER_S:
            moved = (item.speed_mps or 0.0) * np.maximum(time_s[soon, None] + earlier_s, 0.0) * ahead
            if (gap_m(item, road.ego, points[soon] - moved, heading[soon]) < _NEAR_M).any():
                return True
    return False
