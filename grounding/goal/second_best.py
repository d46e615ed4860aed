"""Where a command has no room at the place that it names: the next best place, or the question whether it will do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from grounding.goal import ego_lane
from grounding.goal.beside_vehicle import PARKING
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.goal.explanations import gap_beyond_m
from grounding.goal.limits import PlaceLimits, is_in_the_road
from grounding.goal.planner import GoalPlan, Target, plan_place, to_target, with_nearest
from grounding.goal.reference_frames import ReferenceVehicle
from grounding.goal.search import CandidateSearch
from grounding.query import Query
from grounding.referent.scene import SceneModel
from grounding.road.free_space import OFF_MAP
from grounding.road.kerb import kerb_gap_m
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject
from grounding.vocabulary import PASSING_ACTIONS, Relation

# Relations in line with a vehicle, and actions that stop in our lane where there is no room in line with it.
_IN_LINE, _STOPPING = ("behind", "in_front_of"), ("stop", "wait")
# The last metres of our lane on the map.
_BEFORE_END_M = 12.0
# Places to park up to this far from the vehicle are proposed, and other places up to the second.
_AROUND_M, _NEARBY_M = 22.0, 10.0
# Along the edge this distance costs one; a place there has this gap to the edge, and at most the second.
_AWAY_M, _EDGE_M, _MAX_EDGE_M = 3.0, 0.3, 0.9
# Behind us and in another street: distances from our pose and from our lane.
_BEHIND_M, _ASIDE_M = 5.0, 10.0
# A gap below this is told as "just beyond it".
_JUST_M = 0.5


def plan_with_second_best(
    query: Query, plan: GoalPlan, scene: SceneModel, road: RoadMap, item: SceneObject | None
) -> GoalPlan:
    """Return a plan, or if it has neither a place nor a question the next best place or the nearest one.

    To stop in line with a vehicle, our own lane will do, short of it or beyond it. To park, the nearest place at the
    edge of the road is asked about; otherwise the nearest place of all.

    Args:
        query: the command.
        plan: its plan.
        scene: the scene of the command.
        road: the road map of that scene.
        item: reference vehicle of the relation, None if the command names none.
    """
    if query.manoeuvre == "double_park" and plan.refused:
        return _offer_our_lane(replace(query, manoeuvre=None), plan, scene, road)
    settled = plan.target is not None or plan.question or plan.search is None
    if item is None and not settled:
        onward = _plan_to_end_of_map(plan, scene, road) if query.distance_of == "ego" else None
        return onward or _plan_without_vehicle(query, plan, scene, road)
    if item is None or settled or query.relation == "between":  # beside one of two is not between them
        return with_nearest(plan)
    beyond = query.action in PASSING_ACTIONS or (query.relation == "past" and query.action not in PARKING)
    if beyond and (onward := _plan_to_end_of_map(plan, scene, road)) is not None:
        return onward
    if query.action in _STOPPING and query.relation in _IN_LINE:
        stopped = _plan_in_our_lane(query, scene, road, item)
        if stopped.target is not None:
            word = query.relation.replace("_", " ")
            return replace(stopped, reasons=(f"there is no room {word} it in its line", *stopped.reasons))
    nearest = _find_edge_place(query, plan, scene, road, item) if query.action in PARKING else None
    if nearest is None and query.action in PARKING and query.relation in _IN_LINE:
        ours = _plan_in_our_lane(query, scene, road, item).target
        if ours is not None:
            question = f"there is no room there: shall we stop in our lane, {_describe(ours, item)}?"
            return replace(plan, nearest=ours, question=question)
    if nearest is None:
        plan = with_nearest(plan)
        nearest = _close_enough(plan.nearest, item) if query.action in (*PARKING, *_STOPPING) else None
        if nearest is not None and query.action in PARKING and _is_in_another_lane(nearest, road):
            nearest = None
    if nearest is None:
        return plan
    verb = (query.action or "stop").replace("_", " ")
    where = _describe(nearest, item) + _consequences(query, nearest, road)
    question = f"there is no room there: shall we {verb} {where}?"
    return replace(plan, nearest=nearest, question=question)


def _plan_without_vehicle(query: Query, plan: GoalPlan, scene: SceneModel, road: RoadMap) -> GoalPlan:
    """Return a plan without a place and without a vehicle: on until there is room, our lane, or the nearest place."""
    if not asks_for_kerb(query):
        return with_nearest(plan)
    return (_drive_on if query.manoeuvre == "onward" else _ask_to_stop_in_lane)(query, plan, scene, road)


def asks_for_kerb(query: Query) -> bool:
    """Return whether a command asks for any place at the edge of the road."""
    stops = query.action in PARKING or (query.action == "stop" and (query.goal_side or query.road_side))
    return bool(stops) and query.relation == "none" and query.landmark is None


def _drive_on(query: Query, plan: GoalPlan, scene: SceneModel, road: RoadMap) -> GoalPlan:
    """Return a plan without room at the edge of the road as the one to drive on until there is room."""
    onward = plan_place(Query(query.command, "other", ("other",), manoeuvre="onward"), scene, road)
    reasons = (*plan.reasons, "there is no room yet: we drive on in our lane until there is", *onward.reasons)
    return replace(onward, reasons=reasons)


def _offer_our_lane(query: Query, plan: GoalPlan, scene: SceneModel, road: RoadMap) -> GoalPlan:
    """Return a refused plan with the question whether our lane will do, where the edge of the road has no room."""
    kerb = replace(query, action="pull_over", relation="none", referent=None, landmark=None, secondary=())
    at_edge = plan_place(kerb, scene, road)
    if at_edge.target is not None or at_edge.question:
        return plan
    asked = _ask_to_stop_in_lane(kerb, at_edge, scene, road)
    return replace(plan, nearest=asked.nearest, question=asked.question)


def _ask_to_stop_in_lane(query: Query, plan: GoalPlan, scene: SceneModel, road: RoadMap) -> GoalPlan:
    """Return a plan without room at the edge of the road with the question whether our lane will do."""
    in_lane = replace(query, action="stop", goal_side=None, road_side=None, direction=None)
    if query.distance_of == "kerb":
        in_lane = replace(in_lane, distance_m=None, distance_of=None)
    stopped = plan_place(in_lane, scene, road)
    if stopped.target is None:
        return with_nearest(plan)
    ahead_m = float(road.along_m[stopped.target.cell])
    where = "stay where we are" if ego_lane.is_standing(road) else f"stop in our lane, {ahead_m:.0f} m ahead"
    question = f"there is no room at the edge of the road ahead: shall we {where}?"
    return replace(plan, nearest=stopped.target, question=question)


def _plan_to_end_of_map(plan: GoalPlan, scene: SceneModel, road: RoadMap) -> GoalPlan | None:
    """Return the plan for a place beyond the end of the map: our lane up to there; None where the map goes on."""
    end_m = road.ego_lane.end_m
    search = plan.search
    if search is None or road.ego_lane.at_road_end or search.explain_failure()[1] != OFF_MAP:
        return None
    up_to = DistanceRange(end_m - _BEFORE_END_M, end_m - road.ego.length_m / 2, end_m)
    road = road.after_traffic() or road
    found, way = CandidateSearch(ego_lane.propose_in_lane(road, up_to, "in our lane"), scene, road).find_reachable()
    if not found or way is None:
        return None
    told = plan.reasons if search.references else ()
    reasons = (*told, "the place lies beyond the map: we go to the end of the map for now")
    return replace(plan, target=to_target(found[0], scene, road), way=way, reasons=reasons)


def _plan_in_our_lane(query: Query, scene: SceneModel, road: RoadMap, item: SceneObject) -> GoalPlan:
    """Return the plan to stop in our own lane, at the same end of the vehicle."""
    reference = ReferenceVehicle(item, road, 0.0)
    front, _ = reference.front_direction(query.relation)
    ahead = np.cos(front - reference.travel_rad) > 0
    relation: Relation = "before" if (query.relation == "behind") == ahead else "past"
    if not reference.beside_ego_lane:
        return GoalPlan(None, ())
    return plan_place(replace(query, action="stop", relation=relation), scene, road, item)


def _find_edge_place(
    query: Query, plan: GoalPlan, scene: SceneModel, road: RoadMap, item: SceneObject
) -> Target | None:
    """Return the place at the edge of the road that is nearest to a vehicle; None if there is none around it.

    It is none of the places that the command rules out.
    """
    along, lateral = (float(each) for each in road.ego_lane.project(item.centre_m))
    limits = PlaceLimits.of(query, road.traffic_side)
    other_side = "left" if road.traffic_side > 0 else "right"
    across = road.traffic_side * lateral > 0 and not limits.our_side
    side = query.goal_side or (other_side if across else road.sides.kerb)
    around = DistanceRange(along - _AROUND_M, along, along + _AROUND_M)
    places = [_nearest_first(each, side, road, item) for each in ego_lane.propose_at_edge(road, side, around)]
    excluded = plan.search.excluded if plan.search is not None else None
    found, _ = CandidateSearch(places, scene, road, [item], excluded, limits).find_reachable()
    return to_target(found[0], scene, road) if found else None


def _nearest_first(edge: CandidateSet, side: str, road: RoadMap, item: SceneObject) -> CandidateSet:
    """Return candidates at one edge of the road, those near a vehicle first."""
    gap_m = kerb_gap_m(road, edge.cells, edge.heading_rad, 1 if side == "left" else -1, 3.0)
    away_m = np.hypot(*(road.grid.centre_of(edge.cells) - item.centre_m).T)
    cost = away_m / _AWAY_M + np.maximum(gap_m - _EDGE_M, 0.0) ** 2
    return replace(edge, cost=cost).subset((away_m < _AROUND_M) & (gap_m < _MAX_EDGE_M)).with_detour_cost(road)


def _describe(place: Target, item: SceneObject) -> str:
    """Return where a place is, measured from a vehicle."""
    gap_m = gap_beyond_m(place.ego_m, place.heading_ego_rad, place.ego, item)
    if not gap_m:
        return "beside it"
    how_far = "just" if abs(gap_m) < _JUST_M else f"{abs(gap_m):.0f} m"
    return f"{how_far} {'beyond' if gap_m > 0 else 'short of'} it"


def _consequences(query: Query, place: Target, road: RoadMap) -> str:
    """Return the drawbacks of a place in words: it is in the road, behind us, or in another street."""
    told = []
    if query.action in PARKING and is_in_the_road(place.cell, place.heading_ego_rad, road):
        told.append("in the road")
    along_m, aside_m = float(road.along_m[place.cell]), abs(float(road.lateral_m[place.cell]))
    if along_m < -_BEHIND_M:
        told.append(f"{-along_m:.0f} m behind us")
    elif aside_m > _ASIDE_M:
        told.append(f"{np.hypot(along_m, aside_m):.0f} m from here")
    return "".join(f", {words}" for words in told)


def _is_in_another_lane(place: Target, road: RoadMap) -> bool:
    """Return whether a place is in the road, and not in our lane."""
    in_road = is_in_the_road(place.cell, place.heading_ego_rad, road)
    return in_road and abs(float(road.lateral_m[place.cell])) > LANE_M / 2


def _close_enough(nearest: Target | None, item: SceneObject) -> Target | None:
    """Return a place if it is near a vehicle."""
    if nearest is None or np.hypot(*(nearest.ego_m - item.centre_m)) > _NEARBY_M + item.length_m / 2:
        return None
    return nearest
