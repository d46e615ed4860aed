"""What is measured for a question: sizes, headings, the gap at a goal, the way there, and who is ahead of us."""

from __future__ import annotations

import numpy as np

from appocc.geometry import wrap_angle
from appocc.motion_state import STANDING_MPS
from appocc.polylines import length_m
from grounding.answer import Answer
from grounding.describe import describe_object
from grounding.goal.planner import Target
from grounding.referent.doubts import is_in_other_street
from grounding.referent.scene import SceneModel
from grounding.road.lane_model import LANE_M
from grounding.scene_object import SceneObject

# How far ahead a vehicle may hold us up, and how far from a goal one ends the gap there.
_AHEAD_M, _GAP_M = 40.0, 20.0
# A vehicle faces along our way, or against it, within this angle.
_ALONG_RAD = np.radians(45)
# Least acceleration that is told.
_STEADY_MPS2 = 0.5
# Kilometres an hour in a metre a second.
_KMH = 3.6
# Speed of a way through a street, for a rough time.
_STREET_MPS = 4.0


def describe_one(item: SceneObject, scene: SceneModel) -> str:
    """Describe an object, with the note that it is in another street."""
    away = ", in another street" if is_in_other_street(scene.table.items.index(item), scene) else ""
    return f"the {describe_object(item, scene)}{away}"


def describe_size(item: SceneObject, scene: SceneModel) -> str:
    """Tell the length, width and height of an object."""
    height = "" if item.height_m is None else f", {item.height_m:.1f} m high"
    size = f"{item.length_m:.1f} m long, {item.width_m:.1f} m wide{height}"
    return f"{describe_one(item, scene)}: {size}"


def describe_speed(ours_mps: float) -> str:
    """Tell our own speed, forwards or backwards, after "we"."""
    if abs(ours_mps) < STANDING_MPS:
        return "stand"
    how = "drive backwards" if ours_mps < 0 else "drive"
    return f"{how} at {abs(ours_mps):.0f} m/s, {abs(ours_mps) * _KMH:.0f} km/h"


def describe_change(item: SceneObject) -> str:
    """Tell whether an object gets faster or slower; '' where that is not known."""
    if item.acceleration_mps2 is None:
        return ""
    if abs(item.acceleration_mps2) < _STEADY_MPS2:
        return ", at a steady speed"
    return ", getting faster" if item.acceleration_mps2 > 0 else ", getting slower"


def describe_heading(heading_rad: float) -> str:
    """Tell a heading by ours: "the same way as we do", "against our way", "to our left"."""
    angle = float(wrap_angle(heading_rad))
    if abs(angle) <= _ALONG_RAD:
        return "the same way as we do now"
    if abs(angle) >= np.pi - _ALONG_RAD:
        return "against our way"
    return "to our left" if angle > 0 else "to our right"


def describe_facing(item: SceneObject, scene: SceneModel) -> str:
    """Tell which way an object faces."""
    facing = describe_heading(item.yaw_rad) if item.front_known else "which way is not known"
    return f"{describe_one(item, scene)}: it faces {facing}"


def approaches(item: SceneObject) -> bool:
    """Return whether an object drives towards us, from wherever: not one that has passed."""
    moves = item.front_known and item.is_moving
    towards_rad = np.arctan2(-item.centre_m[1], -item.centre_m[0])
    return bool(moves and abs(wrap_angle(item.yaw_rad - towards_rad)) < _ALONG_RAD)


def gap_ends_m(goal: Target, scene: SceneModel) -> tuple[float, float]:
    """Return how much of the gap in line with a goal is left before and behind us; at most `_GAP_M` each."""
    forward = np.array([np.cos(goal.heading_ego_rad), np.sin(goal.heading_ego_rad)])
    left = np.array([-forward[1], forward[0]])
    before_m, behind_m = _GAP_M, _GAP_M
    for item in scene.table.items:
        offset = item.footprint() - goal.ego_m
        along, across = offset @ forward, offset @ left
        if across.min() < goal.ego.width_m / 2 and across.max() > -goal.ego.width_m / 2:
            gap_m = float(max(along.min(), -along.max())) - goal.ego.length_m / 2
            before_m = min(before_m, gap_m) if along.mean() > 0 else before_m
            behind_m = min(behind_m, gap_m) if along.mean() <= 0 else behind_m
    return before_m, behind_m


def describe_gap(goal: Target, scene: SceneModel) -> str:
    """Tell the gap in line with a goal: how long it is, and what is left before and behind us."""
    before_m, behind_m = gap_ends_m(goal, scene)
    ends = [_tell_rest(before_m, "in front of us"), _tell_rest(behind_m, "behind us")]
    if max(before_m, behind_m) < _GAP_M:
        length = before_m + behind_m + goal.ego.length_m
        return f"the gap is {length:.1f} m long, we are {goal.ego.length_m:.1f} m: {' and '.join(ends)}"
    return f"at the goal: {' and '.join(ends)}"


def _tell_rest(gap_m: float, where: str) -> str:
    return f"{gap_m:.1f} m {where}" if gap_m < _GAP_M else f"nothing within {_GAP_M:.0f} m {where}"


def way_to(goal: Answer | None) -> float | None:
    """Return the length of the way to the end of a plan; None without one."""
    routes = [one.plan.route for one in (goal.steps or (goal,))] if goal is not None else []
    lengths = [length_m(route) for route in routes if route is not None]
    return sum(lengths) if lengths else None


def describe_time(way_m: float) -> str:
    """Tell a rough time for a way."""
    return f"some {way_m / _STREET_MPS:.0f} s at {_STREET_MPS:.0f} m/s if nothing holds us up"


def describe_way(way_m: float) -> str:
    """Tell the length of a way, and a rough time."""
    return f"the way to the goal is {way_m:.0f} m: {describe_time(way_m)}"


def find_in_lane(scene: SceneModel) -> list[SceneObject]:
    """Return the vehicles and people ahead of us in our lane, nearest first."""
    table, front_m = scene.table, scene.ego.length_m - scene.ego.rear_overhang_m
    ahead_m = table.along_m - front_m
    rows = np.flatnonzero((ahead_m > 0) & (ahead_m < _AHEAD_M) & (np.abs(table.lateral_m) < LANE_M / 2))
    return [table.items[int(row)] for row in rows[np.argsort(table.along_m[rows])]]
