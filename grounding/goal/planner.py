"""Plan the goal of a command: from the query, its reference vehicle and the road map to one goal pose and a route."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import footprints, wrap_angle
from appocc.motion_state import DRIVING_MPS, MOVING_MPS
from grounding.goal.at_landmark import keep_clear
from grounding.goal.candidates import CandidateSet, GoalCandidate
from grounding.goal.conflicts import explain_conflicts, find_conflicts
from grounding.goal.exclusions import ExcludedPlace, excluded_cells
from grounding.goal.explanations import (
    explain_braking,
    explain_gap,
    explain_second_row,
    explain_speed,
    explain_target,
    explain_way,
)
from grounding.goal.limits import (
    AGAINST_TRAFFIC,
    BEHIND_US,
    OTHER_SIDE,
    TURNED,
    PlaceLimits,
    reversing_cost,
    standing_cost,
)
from grounding.goal.merging import moves_in_behind, propose_merging
from grounding.goal.proposals import explain_refusal, is_in_our_way, propose_candidates
from grounding.goal.search import CandidateSearch
from grounding.goal.traffic import (
    TOWARDS,
    asks_for_more_distance,
    comes_towards_us,
    drives_away,
    goes_around_traffic,
    how_it_moves,
    is_caught_up_with,
    is_followed,
    keeps_distance,
    meets_oncoming,
)
from grounding.query import Query
from grounding.referent.scene import SceneModel
from grounding.road.car_paths import CarRoute
from grounding.road.lane_model import LANE_M
from grounding.road.pose import Pose2D
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject
from grounding.vocabulary import PASSING_ACTIONS, Action, Pace

_RUNNERS_UP = 3
# A place that is free later is taken if its cost is lower by more.
_LATER = 0.5
# Said of a place on the other side of the road that heads as we do.
_FACING = ", facing the traffic"
# Where only one limit stands against the best place, that is asked.
_FOLLOW = "it does not stand still: shall we follow it?"
_CANNOT = {"overtake": "there is nothing to overtake", "turn": "we do not turn across its way"}
_LET_PASS = "it comes towards us: shall we let it pass?"
# Relations of a place that has to stay where the vehicle is.
_BESIDE = ("next_to", "left_of", "right_of")
_QUESTIONS = {
    BEHIND_US: "there is no such place ahead of us: shall we go back to the one behind us?",
    TURNED: "it stands on the other side of the road: shall we turn round here?",
    OTHER_SIDE: "that is on the side of oncoming traffic: shall we go there all the same?",
}
_PACE_REASONS = {
    "slower": "that asks for less speed and for no place",
    "faster": "that asks for more speed and for no place",
    "standing": "that asks to stand where we are, and for no place",
}
# Candidates, best first, and the way to the first.
_Found = tuple[list[GoalCandidate], CarRoute | None]
_MIN_SCORE = 1e-6
# No answer below this score.
_MIN_SCORE_OK = 0.1


@dataclass(frozen=True, eq=False, kw_only=True)
class Target:
    """Goal pose of the centre of the ego footprint.

    Attributes:
        cell: (i, j) index of the grid.
        ego_m: (2,) centre of that cell, ego frame.
        world_m: (2,) centre of that cell, world frame.
        heading_rad: heading, world frame.
        heading_ego_rad: heading relative to the present one.
        score: 0..1, one for the ideal candidate.
        ego: size of the ego vehicle.
    """

    cell: tuple[int, int]
    ego_m: FloatArray
    world_m: FloatArray
    heading_rad: float
    heading_ego_rad: float
    score: float
    ego: EgoVehicle

    def footprint(self) -> FloatArray:
        """Corners (4, 2) of the ego at the goal pose, present ego frame."""
        return footprints(self.ego_m, self.heading_ego_rad, [self.ego.length_m, self.ego.width_m])


@dataclass(frozen=True, eq=False)
class GoalPlan:
    """A goal pose and its reasons, or the reasons why there is none.

    Attributes:
        target: the goal pose, None if no candidate is valid.
        reasons: sentences.
        of_place: the reasons that hold for this target only.
        way: the way to the target as a car drives it; None without one.
        runners_up: further goal poses, at least an ego length from the target and from each other.
        nearest: if no candidate is valid, the nearest valid pose.
        search: all candidates with their costs, None if there were none to search.
        question: question to ask before driving to `nearest`; '' without one.
        instead: action that the question proposes; None if it is about `nearest`.
        pace: pace that the command asks for instead of a place; None if it asks for a place.
        refused: whether the command is refused, since no driver should do it.
        later: whether the place is beyond the map: it is planned once more of the road is seen.
        around_m: (2,) point, ego frame, around which `with_nearest` searches for the nearest place; None without one.
        passes_first: the vehicle that has to pass before we drive the way; None without one.
    """

    target: Target | None
    reasons: tuple[str, ...]
    way: CarRoute | None = None
    runners_up: tuple[Target, ...] = ()
    nearest: Target | None = None
    search: CandidateSearch | None = None
    question: str = ""
    instead: Action | None = None
    pace: Pace | None = None
    refused: bool = False
    later: bool = False
    around_m: FloatArray | None = None
    of_place: tuple[str, ...] = ()
    passes_first: SceneObject | None = None

    @property
    def score(self) -> float | None:
        """Score of the goal, 1 for a speed, a state or a later place; None if there is none of them."""
        return self.target.score if self.target else 1.0 if self.pace or self.later else None

    @property
    def route(self) -> FloatArray | None:
        """(K, 2) way of the ego's centre to the target, ego frame; None without one."""
        return None if self.way is None else self.way.points_m

    @cached_property
    def cost_field(self) -> FloatArray | None:
        """(X, Y) cost of all valid cells, infinity elsewhere; None if there was nothing to search."""
        return None if self.search is None else self.search.cost_field()


def plan_goal(
    query: Query,
    scene: SceneModel,
    road: RoadMap,
    item: SceneObject | None = None,
    partner: SceneObject | None = None,
    excluded: Sequence[ExcludedPlace] = (),
    start: Pose2D | None = None,
) -> GoalPlan:
    """Return the goal that a command asks for, or the nearest place; of a command without a place, speed or state.

    Arguments as for `plan_place`.
    """
    return with_nearest(plan_place(query, scene, road, item, partner, excluded, start))


def with_nearest(plan: GoalPlan) -> GoalPlan:
    """Return a plan without a place with the nearest valid pose, if there is one and none is known."""
    search, around_m = plan.search, plan.around_m
    if search is None or around_m is None or plan.nearest is not None or plan.target is not None:
        return plan
    near = search.find_nearest(around_m)
    if near is None:
        return plan
    nearest = to_target(near, search.scene, search.road, score=_MIN_SCORE)
    away, (x, y) = float(np.hypot(*(nearest.ego_m - around_m))), nearest.ego_m
    reason = f"the nearest place that would do is {away:.1f} m away from there, at ({x:.1f}, {y:.1f}) m"
    return replace(plan, nearest=nearest, reasons=(*plan.reasons, reason))


def plan_place(
    query: Query,
    scene: SceneModel,
    road: RoadMap,
    item: SceneObject | None = None,
    partner: SceneObject | None = None,
    excluded: Sequence[ExcludedPlace] = (),
    start: Pose2D | None = None,
) -> GoalPlan:
    """Return the goal that a command asks for; where there is none, `with_nearest` adds the nearest place.

    Args:
        query: the command.
        scene: the scene of the command.
        road: the road map of that scene.
        item: reference vehicle of the relation, None if the command names none.
        partner: second vehicle of "between".
        excluded: places that are ruled out.
        start: pose of the ego when it begins; None: where it is now.
    """
    if query.pace is not None:
        return GoalPlan(None, (_PACE_REASONS[query.pace],), pace=query.pace)
    if refusal := explain_refusal(query):
        return GoalPlan(None, (refusal,), refused=True)
    if start is not None:
        road = scene.road_from(start)
    if query.action == "avoid" and query.relation == "none" and not (item and is_in_our_way(item, road)):
        aside = "it is not in our way: " if item else ""
        return GoalPlan(None, (f"{aside}that asks for care, with less speed, and for no place",), pace="slower")
    # After a turn in the road its other side is ours.
    turned = query.road_side == "opposite" and start is not None and np.cos(start.heading_rad) < 0
    query = query.on_side(-road.traffic_side if turned else road.traffic_side)
    limits = PlaceLimits.of(query, road.traffic_side)
    if (
        item is not None
        and (query.action in _CANNOT or query.relation in _BESIDE or drives_away(query, item))
        and comes_towards_us(item, road)
        and query.trigger is None
    ):
        cannot = _CANNOT.get(query.action or "", "no place beside it stays")
        reason = f"it comes towards us at {item.speed_mps:.0f} m/s: {cannot}"
        return GoalPlan(None, (reason,), question=_LET_PASS, instead="give_way", refused=True)
    if item is not None and query.manoeuvre == "back" and (item.speed_mps or 0.0) > MOVING_MPS:
        return GoalPlan(None, (f"it {how_it_moves(item)}: we do not back up towards it",), refused=True)
    if item is not None and is_followed(query, item, road):
        following = replace(query, action="follow", relation="none")
        plan = plan_place(following, scene, road, item, excluded=excluded)
        return replace(plan, reasons=(f"it {how_it_moves(item)}: we follow it until it stands", *plan.reasons))
    if item is not None and keeps_distance(query, item, road):
        # A follower's own distance is the least one: "keep a safe distance from the car in front".
        named = query.distance_m if query.distance_of == "referent" else None
        distance_m = named if named is not None and named > road.style.following_gap_m(item.speed_mps) else None
        if distance_m is None and asks_for_more_distance(query):
            distance_m = max(road.gap_ahead_m(item), road.style.following_gap_m(item.speed_mps))
        query = replace(query, action="follow", distance_m=distance_m, distance_of="referent" if distance_m else None)
    if item is not None and is_caught_up_with(query, item, road):
        query = replace(query, relation="behind", landmark="referent")
    if item is not None and drives_away(query, item):
        reason = f"it {how_it_moves(item)}, so that no place beside it stays"
        followed = plan_place(replace(query, action="follow", relation="none"), scene, road, item, start=start)
        if followed.target is None:
            return GoalPlan(None, (reason, *followed.reasons))
        return GoalPlan(None, (reason,), question=_FOLLOW, instead="follow")
    proposed: list[CandidateSet] | None
    if item is not None and moves_in_behind(query, item, road):
        road = road.without([item])
        proposed, reasons = (
            [propose_merging(item, road)],
            [f"it {how_it_moves(item)}: we move in behind it once it is ahead of us"],
        )
        item = None
    else:
        proposed, reasons = propose_candidates(query, road, item, partner)
    if item is not None and item.speed_mps is not None and item.speed_mps > MOVING_MPS:
        reasons = [*reasons, f"it moves at {item.speed_mps:.0f} m/s: the place is measured from where it is now"]
    if proposed is None:
        if item is None and query.landmark == "secondary":
            plain = replace(query, landmark=None, relation="none", secondary=())
            return GoalPlan(None, tuple(reasons), nearest=plan_place(plain, scene, road, start=start).target)
        return GoalPlan(None, tuple(reasons))
    if item is not None and item.class_name != "person" and limits.our_side and _is_on_other_side(item, road):
        # Who names a vehicle that stands there asks for a place there: with the traffic if we can turn.
        # Before one that drives there we stay on our side, unless we are to go where it goes.
        drives = (item.speed_mps or 0.0) > DRIVING_MPS
        if not drives:
            proposed = [turned for each in proposed for turned in _with_traffic(each, road)]
        limits = replace(limits, our_side=drives and query.action == "approach" and query.relation in TOWARDS)
    if query.goal_side is not None and not limits.our_side:
        proposed = [facing for each in proposed for facing in _told_against(each, road)]
    if item is not None and item.class_name == "person" and limits.our_side:
        proposed = [_in_our_lanes(each, road) for each in proposed]
    candidate_sets = [_with_costs(each, query, limits, road) for each in proposed]
    references = [one for one in (item, partner) if one]
    kept_clear = keep_clear(query, road)
    ruled_out = excluded_cells(excluded, road, [cells for _, cells in kept_clear])
    reasons = [*reasons, *(words for words, _ in kept_clear)]
    search = CandidateSearch(candidate_sets, scene, road, references, ruled_out, limits)
    best, way = search.find_reachable(1 + _RUNNERS_UP)
    if (later := road.after_traffic(references, item is None)) is not None:
        again = CandidateSearch(candidate_sets, scene, later, references, ruled_out, limits)
        best_later, way_later = again.find_reachable(1 + _RUNNERS_UP)
        if best_later and way_later and _is_worth_waiting(query, (best, way), (best_later, way_later), road):
            search, best, way = again, best_later, way_later
            what = "the way is" if item is not None else "the way and the place are"
            reasons = [*reasons, f"{what} free once those ahead of us have driven on"]
    if not best or way is None:
        return _plan_without_target(search, item, reasons)
    target, *others = (to_target(candidate, scene, road) for candidate in best)
    of_place = [*explain_target(search, best[0]), explain_way(way), *explain_gap(query, best[0])]
    of_place += [*explain_braking(query, way, road), *explain_speed(query, item, road)]
    of_place += explain_second_row(query, best[0].cell, best[0].heading_rad, road)
    if limits.not_behind and meets_oncoming(way, road):
        of_place.append("the way there crosses the lanes of oncoming traffic")
    first = find_conflicts(way, road, references) if start is None else []
    of_place += explain_conflicts(first, scene)
    reasons = [*reasons, *of_place]
    if target.score < _MIN_SCORE_OK:
        reasons.append("the best free place fits the command badly: it is too far away, or too awkward to reach")
        return GoalPlan(None, tuple(reasons), nearest=target, search=search)
    plan = GoalPlan(target, tuple(reasons), way, tuple(others), None, search, of_place=tuple(of_place))
    return replace(plan, passes_first=first[0]) if first else plan


def _is_worth_waiting(query: Query, now: _Found, later: tuple[list[GoalCandidate], CarRoute], road: RoadMap) -> bool:
    """Return whether a place or a way once the traffic ahead has driven on is better than the one now."""
    (best, way), (best_later, way_later) = now, later
    if not best or way is None:
        return True
    if query.action in PASSING_ACTIONS:  # nobody swings out into oncoming traffic around those who drive on
        return meets_oncoming(way, road) and not meets_oncoming(way_later, road)
    return best_later[0].cost < best[0].cost - _LATER or goes_around_traffic(way, road)


def _in_our_lanes(candidates: CandidateSet, road: RoadMap) -> CandidateSet:
    """Return the candidates that do not reach from our lane towards oncoming traffic: a junction has no sides."""
    towards_m = road.traffic_side * road.lateral_m[tuple(candidates.cells.T)]
    return candidates.subset(towards_m <= (LANE_M - road.ego.width_m) / 2)


def _with_traffic(candidates: CandidateSet, road: RoadMap) -> list[CandidateSet]:
    """Return candidates that head with the traffic of their side of the road."""
    against = road.is_oncoming_side(candidates.cells, candidates.heading_rad)
    if not against.any():
        return [candidates]
    heading = np.where(against, wrap_angle(candidates.heading_rad + np.pi), candidates.heading_rad)
    here = candidates.subset(against)
    facing = replace(here, words=f"{here.words}{_FACING}", cost=here.cost + AGAINST_TRAFFIC)
    return [replace(candidates, heading_rad=heading), facing]


def _told_against(candidates: CandidateSet, road: RoadMap) -> list[CandidateSet]:
    """Return candidates on the side that the command asks for; those against the traffic there say so."""
    against = road.is_oncoming_side(candidates.cells, candidates.heading_rad)
    here = candidates.subset(against)
    facing = replace(here, words=f"{here.words}{_FACING}")
    return [part for part in (candidates.subset(~against), facing) if len(part.cells)]


def _is_on_other_side(item: SceneObject, road: RoadMap) -> bool:
    """Return whether a vehicle is on the side of oncoming traffic."""
    cell = np.array([road.nearest_drivable(item.centre_m)])
    return bool(road.is_oncoming_side(cell, np.array([road.direction_at(item.centre_m)]))[0])


def _with_costs(candidates: CandidateSet, query: Query, limits: PlaceLimits, road: RoadMap) -> CandidateSet:
    """Return candidates with the costs of the way to them and of standing there."""
    found = candidates.with_detour_cost(road)
    standing = standing_cost(query, road, found.cells, found.heading_rad)
    reversing = reversing_cost(limits, road, found.cells, found.heading_rad)
    return replace(found, cost=found.cost + standing + reversing)


def to_target(candidate: GoalCandidate, scene: SceneModel, road: RoadMap, score: float | None = None) -> Target:
    """Return a candidate as goal pose; by default its score is a Gaussian of its cost."""
    centre = road.grid.centre_of(candidate.cell)
    return Target(
        cell=candidate.cell,
        ego_m=centre,
        world_m=scene.world_xy(centre),
        heading_rad=scene.world_heading(candidate.heading_rad),
        heading_ego_rad=candidate.heading_rad,
        score=max(float(np.exp(-candidate.cost / 2)), _MIN_SCORE) if score is None else score,
        ego=road.ego,
    )


def _plan_without_target(search: CandidateSearch, item: SceneObject | None, reasons: Sequence[str]) -> GoalPlan:
    """Return the plan if no candidate is valid: the violated constraint."""
    road = search.road
    if not len(road.paths.cells):
        return GoalPlan(None, (*reasons, "no free road around us is known"), search=search)
    best, violation, why = search.explain_failure()
    reasons = [*reasons, *why]
    if best is not None and (question := _QUESTIONS.get(violation)):
        there = to_target(best, search.scene, road)
        return GoalPlan(None, tuple(reasons), nearest=there, search=search, question=question)
    if not why or (best is None and item is None):
        return GoalPlan(None, tuple(reasons), search=search)
    centre = road.grid.centre_of(best.cell) if best else item.centre_m if item else road.ego_lane.origin_m
    return GoalPlan(None, tuple(reasons), search=search, around_m=centre)
