"""Shift a planned goal ("a bit further back", "two metres closer"), or hold it at its place in the world."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import apply, inverse, wrap_angle
from grounding.goal.candidates import CandidateSet
from grounding.goal.explanations import explain_behind_us, explain_from, explain_second_row, explain_way
from grounding.goal.limits import NO_LIMITS, PlaceLimits
from grounding.goal.planner import GoalPlan, Target, to_target
from grounding.goal.search import CandidateSearch
from grounding.query import Query
from grounding.referent.scene import SceneModel
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject
from grounding.vocabulary import ShiftDirection

_WORDS = {"away": "farther away", "near": "closer", "leftwards": "to the left", "rightwards": "to the right"}
# A goal is at most this far from the wanted place, and a shift at least this share of the wanted one, and this far.
_TOLERANCE_M, _LEAST_SHARE, _LEAST_M = 1.2, 0.4, 0.1
# Cosine of the largest angle of a goal along our lane.
_ALONG_LANE = 0.9
# Shares of a shift that are tried: where there is no room for all of it, a part of it is better than none.
_SHARES = (1.0, 0.5, 0.25)


@dataclass(frozen=True, eq=False)
class HeldPose:
    """A goal pose in the world frame: place (2,) of the centre of the footprint, and heading."""

    world_m: FloatArray
    heading_rad: float


@dataclass(frozen=True)
class Shift:
    """A change of the goal along or across its heading.

    Attributes:
        direction: `away` and `near` are relative to a vehicle.
        distance_m: length of the change.
        vehicle: id of that vehicle; None: the reference vehicle of the goal.
        whole: whether a part of it is of no use: another place is wanted.
    """

    direction: ShiftDirection
    distance_m: float = 2.0
    vehicle: str | None = None
    whole: bool = False

    @property
    def words(self) -> str:
        """The shift in words."""
        return f"{round(self.distance_m, 1):g} m {_WORDS.get(self.direction, self.direction)}"


def shift_goal(
    goal_plan: GoalPlan, shift: Shift, query: Query, scene: SceneModel, road: RoadMap, item: SceneObject | None = None
) -> GoalPlan:
    """Move the goal of a plan.

    Args:
        goal_plan: plan with a target; a plan without one is returned as it is.
        shift: direction and distance.
        query: the command; nobody is moved into a junction to park there.
        scene: the scene of the command.
        road: the road map of that scene.
        item: reference vehicle; without one, "away" is ahead and "near" is back.

    Returns:
        The plan with the valid pose nearest to the shifted one, without the reasons for the place before; without a
        target if there is none near it.
    """
    target = goal_plan.target
    if target is None:
        return goal_plan
    direction = _direction(shift.direction, target, item)
    along_lane = item is None and shift.direction in ("ahead", "back", "away", "near")
    blocked: GoalPlan | None = None
    asked = PlaceLimits.of(query, road.traffic_side)
    limits = replace(NO_LIMITS, clear_of_junctions=asked.clear_of_junctions, clear_m=asked.clear_m)
    for share in _SHARES[: 1 if shift.whole else None]:
        length_m = max(share * shift.distance_m, road.grid.cell_m)  # no place is nearer to another one
        wanted, heading_rad = target.ego_m + length_m * direction, target.heading_ego_rad
        if along_lane and (on_lane := _along_lane(target, length_m * direction, road)) is not None:
            wanted, heading_rad = on_lane
        moved = _plan_near(wanted, heading_rad, shift.words, scene, road, item, limits)
        blocked = blocked or (moved if moved.target is None else None)
        moved_m = 0.0 if moved.target is None else _length_m(moved.target.ego_m - target.ego_m, wanted - target.ego_m)
        if moved_m >= max(_LEAST_SHARE * length_m, _LEAST_M):
            limit = "" if share == 1 else ": there is room for no more"
            reason = f"moved {moved_m:.1f} m as asked ({shift.words}){limit}"
            kept = (one for one in goal_plan.reasons if one not in goal_plan.of_place)
            return replace(goal_plan, target=moved.target, way=moved.way, reasons=(*kept, reason), of_place=(reason,))
    reasons = blocked.reasons if blocked is not None else ()
    return GoalPlan(None, (f"there is no room {shift.words}", *reasons), nearest=target)


def explain_moved(
    goal_plan: GoalPlan, query: Query, road: RoadMap, item: SceneObject | None = None, name: str = "it"
) -> GoalPlan:
    """Return a plan with where its moved goal is now, measured from a vehicle of some name, and the way there."""
    target, way = goal_plan.target, goal_plan.way
    if target is None or way is None:
        return goal_plan
    pose = target.ego_m, target.heading_ego_rad
    ahead_m = float(road.along_m[target.cell])
    told = [explain_from(*pose, target.ego, item, name)] if item is not None else []
    if item is None and ahead_m > 0:
        told = [f"the place is {ahead_m:.1f} m ahead"]
    told += [*explain_behind_us(target.cell, road), explain_way(way)]
    told += explain_second_row(query, target.cell, target.heading_ego_rad, road)
    return replace(goal_plan, reasons=(*goal_plan.reasons, *told), of_place=tuple(told))


def hold_goal(pose: HeldPose, scene: SceneModel, road: RoadMap) -> GoalPlan | None:
    """Return the plan to the valid pose nearest to one that is held in the world; None if there is none near it."""
    ego_from_world = inverse(scene.world_from_ego)
    wanted = apply(ego_from_world, np.append(pose.world_m, 0.0))[:2]
    heading_rad = float(wrap_angle(pose.heading_rad - scene.world_heading(0.0)))
    held = _plan_near(wanted, heading_rad, "where it was planned", scene, road)
    return held if held.target is not None else None


def _plan_near(
    wanted: FloatArray,
    heading_rad: float,
    words: str,
    scene: SceneModel,
    road: RoadMap,
    item: SceneObject | None = None,
    limits: PlaceLimits = NO_LIMITS,
) -> GoalPlan:
    """Return the plan to the valid pose nearest to a point (2,), ego frame."""
    cells = road.grid.cell_of(wanted) + np.argwhere(np.ones((9, 9))) - 4
    cells = cells[road.grid.contains(cells)]
    off_m = np.linalg.norm(road.grid.centre_of(cells) - wanted, axis=1)
    near = off_m <= _TOLERANCE_M
    candidates = CandidateSet(words, cells[near], off_m[near] ** 2, np.full(int(near.sum()), heading_rad))
    kept = [item] if item else []
    search = CandidateSearch([candidates.with_detour_cost(road)], scene, road, kept, limits=limits)
    found, way = search.find_reachable(1)
    later = road.after_traffic(kept) if not found or way is None else None
    if later is not None:  # those ahead of us have driven on by then
        again = CandidateSearch([candidates.with_detour_cost(later)], scene, later, kept, limits=limits)
        found, way = again.find_reachable(1)
    if not found or way is None:
        return GoalPlan(None, tuple(search.explain_failure()[-1]), search=search)
    told = (f"the place is {words}",)
    return GoalPlan(to_target(found[0], scene, road), told, way, search=search, of_place=told)


def _along_lane(target: Target, moved_m: FloatArray, road: RoadMap) -> tuple[FloatArray, float] | None:
    """Return the point (2,) of our lane that a shift (2,) along the heading of a goal leads to, and its heading.

    None where the goal does not face along our lane, or the lane ends before that.
    """
    lane = road.ego_lane
    along_m, lateral_m = (float(one) for one in lane.project(target.ego_m))
    ahead_rad = float(lane.direction_rad(target.ego_m))
    to_m = along_m + float(moved_m @ [np.cos(ahead_rad), np.sin(ahead_rad)])
    if np.cos(target.heading_ego_rad - ahead_rad) < _ALONG_LANE or not lane.start_m < to_m < lane.end_m:
        return None
    turned = float(lane.heading_rad(np.array(to_m))) - ahead_rad
    point = lane.offset_points(np.array([to_m]), lateral_m)[0]
    return point, float(wrap_angle(target.heading_ego_rad + turned))


def _length_m(moved: FloatArray, wanted: FloatArray) -> float:
    """Return how far a move (2,) goes in the direction of the wanted one (2,)."""
    return float(moved @ wanted / np.linalg.norm(wanted))


def _direction(direction: ShiftDirection, target: Target, item: SceneObject | None) -> FloatArray:
    """Return the unit vector (2,) of a shift, ego frame."""
    along = np.array([np.cos(target.heading_ego_rad), np.sin(target.heading_ego_rad)])
    left = np.array([-along[1], along[0]])
    if direction in ("leftwards", "rightwards"):
        return left if direction == "leftwards" else -left
    if direction in ("ahead", "back") or item is None:
        return along if direction in ("ahead", "away") else -along
    offset = target.ego_m - item.centre_m
    beside = abs(float(offset @ along)) < item.length_m / 2
    axis = left if beside else along
    outwards = axis if float(offset @ axis) >= 0 else -axis
    return np.asarray(outwards if direction == "away" else -outwards)
