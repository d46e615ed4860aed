"""Goal candidates relative to one vehicle: behind, in front of, next to, near, towards and at it."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import wrap_angle
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.goal.merging import shift_length_m
from grounding.goal.reference_frames import ReferenceVehicle
from grounding.query import Query
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap, align_axis
from grounding.road.style import DrivingStyle
from grounding.scene_object import SceneObject
from grounding.vocabulary import PASSING_ACTIONS

Proposal = tuple[list[CandidateSet], list[str]]

# Preferred gap between bumpers of actions that have one of their own; for pulling over beyond that for parking.
_PASSED_M, _PULLED_OVER_M = 6.0, 0.5
_MIN_PASSED_M = 2.0
# Tolerance beyond the preferred gap (a queue may be in between, except for parking) and below it.
_FURTHER_M, _FURTHER_PARKED_M, _CLOSER_M = 10.0, 3.0, 3.0
# Tolerance along the vehicle for candidates level with it.
_LEVEL_M = 1.0
# Least gaps to bumpers and to sides; preferred and greatest gap to a side.
_MIN_GAP_M, _MIN_SIDE_M, _SIDE_M, _MAX_SIDE_M = 0.3, 0.4, 0.8, 2.3
# Greatest gaps for "near" and "at".
_NEAR_M, _AT_M = 6.0, 10.0
# Greatest lateral offset of candidates in line with a vehicle.
IN_LINE_M = 1.2
# Standard deviations of the cost: gaps above and below the preferred one (metres, share of the gap), lateral offset.
ALONG_M, _CLOSE_M, _CLOSE_SHARE, LATERAL_M = 2.0, 1.0, 0.25, 0.6
# Costs of a second-best way to satisfy the command, of the farther side, and of the second heading.
SECOND, _FAR_SIDE, _FARTHER, _SECOND_HEADING = 1.5, 0.8, 0.3, 0.1
# Cost of parking in the road: only where there is no room at its edge.
_IN_THE_ROAD = 3.5
# Gap between a parked ego and the road edge.
_EDGE_M = 0.3
PARKING = ("park", "pull_over")
BUMPERS = "bumper to bumper"
# Least share of a gap that is asked for.
_LEAST_SHARE = 0.6
# Costs of candidates short of, beyond, left of and right of the vehicle.
_SIDE_COSTS = {"near": (0.5, 0.5, 0.0, 0.0), "at": (0.0, 0.0, 0.0, 0.0), "toward": (0.0, 2.0, 1.0, 1.0)}


def preferred_gap_m(action: str | None, style: DrivingStyle) -> float:
    """Return the gap between bumpers for an action without a distance in the command."""
    if action in PASSING_ACTIONS:
        return _PASSED_M
    if action in PARKING:
        return style.park_gap_m + (_PULLED_OVER_M if action == "pull_over" else 0.0)
    return style.stop_gap_m


def gap_range(query: Query, item: SceneObject, style: DrivingStyle) -> DistanceRange:
    """Return the range of the gap between bumpers."""
    if query.distance_m is not None and query.distance_of == "referent":
        # The distance of the command holds to within a metre and a tenth, and most of a small one is kept.
        named, off = query.distance_m, 1 + query.distance_m / 10
        least = max(named - off, _LEAST_SHARE * named)
        return DistanceRange(max(min(_MIN_GAP_M, named), least), named, named + off)
    follows = query.action in ("follow", "change_lane") or query.relation == "same_as"
    preferred = preferred_gap_m(query.action, style)
    if follows:
        preferred = style.following_gap_m(item.speed_mps)
    # A follower keeps its distance; after passing a vehicle, a small gap is enough.
    least = _MIN_PASSED_M if query.action in PASSING_ACTIONS else max(_MIN_GAP_M, preferred - _CLOSER_M)
    return DistanceRange(least, preferred, preferred + (_FURTHER_PARKED_M if query.action in PARKING else _FURTHER_M))


def gap_cost(gap_m: FloatArray, preferred_m: float, spread_m: float = ALONG_M) -> FloatArray:
    """Return the cost (N,) of gaps; shorter than preferred costs more than longer, less so for large gaps.

    `spread_m`: standard deviation of longer gaps.
    """
    close_m = max(_CLOSE_M, preferred_m * _CLOSE_SHARE)
    return np.asarray(((gap_m - preferred_m) / np.where(gap_m < preferred_m, close_m, spread_m)) ** 2)


def propose_in_line(relation: str, query: Query, item: SceneObject, road: RoadMap) -> Proposal:
    """Propose candidates behind or in front of a vehicle, in line with it or along its lane."""
    gaps = gap_range(query, item, road.style)
    reference = ReferenceVehicle(item, road, gaps.most_m + item.length_m / 2 + road.ego.length_m)
    if query.action == "follow" and relation == "behind":
        gaps = _from_here_on(gaps, reference)
    word = relation.replace("_", " ")
    front, reasons = reference.front_direction(word)
    sign = -1.0 if relation == "behind" else 1.0
    along, lateral = reference.offsets(front)
    free = query.action == "follow" or query.distance_of == "referent"
    most_m = gaps.most_m if free else min(gaps.most_m, _free_m(reference, front, sign))
    # In a narrow gap one heading may be valid where the other is not. Across the road only the vehicle's own is used.
    headings = [reference.aligned_heading_rad]
    if not reference.is_across:
        headings.append(reference.road_heading_rad)
        if gaps.most_m > _FURTHER_M + road.style.stop_gap_m:
            along, lateral = _offsets_along_lane(reference, front, sign, keeps_lane=query.action == "follow")
    if query.action == "follow" and item.front_known:
        headings = [np.where(np.cos(one - item.yaw_rad) < 0, wrap_angle(one + np.pi), one) for one in headings]
        if reference.faces_us and not reference.is_standing:
            reasons.append("it comes towards us: to follow it we have to turn around")
    found = []
    for number, heading in enumerate(headings):
        gap = sign * along - item.length_m / 2 - reference.ego_half_extent_m(heading - front)
        region = (gap >= gaps.least_m) & (gap <= most_m) & (np.abs(lateral) <= IN_LINE_M)
        cost = gap_cost(gap, gaps.preferred_m) + (lateral / LATERAL_M) ** 2 + number * _SECOND_HEADING
        found.append(
            reference.candidates_in(
                region, words=f"{word} it", cost=cost, heading_rad=heading, gap_m=gap, gap_kind=BUMPERS
            )
        )
    return found, reasons


def _free_m(reference: ReferenceVehicle, front: float, sign: float) -> float:
    """Return the gap ahead of a vehicle (1) or behind it (-1) up to the next one in line with it."""
    item, turn = reference.item, np.array([np.cos(front), np.sin(front)])
    others = (one for one in reference.road.free_space.objects if one.id != item.id)
    offsets_m = ((one, one.centre_m - item.centre_m) for one in others)
    in_line = [
        sign * float(off @ turn) - (item.length_m + one.length_m) / 2
        for one, off in offsets_m
        if abs(off[1] * turn[0] - off[0] * turn[1]) < IN_LINE_M and sign * float(off @ turn) > 0
    ]
    return min(in_line, default=np.inf)


def _from_here_on(gaps: DistanceRange, reference: ReferenceVehicle) -> DistanceRange:
    """Return the gaps of a follower; behind a vehicle ahead of us it stays where it is, and falls back while driving.

    Until we are in line with it we drive on as far as the shift to its side takes.
    """
    (_, aside_m), road = reference.lane_position, reference.road
    leads = reference.beside_ego_lane and not reference.faces_us
    leads = leads and (abs(aside_m) < LANE_M / 2 or not reference.is_standing)
    here_m = road.gap_ahead_m(reference.item)
    there_m = here_m - (shift_length_m(aside_m, road.ego) if abs(aside_m) > LANE_M / 2 else 0.0)
    if not leads or not _MIN_GAP_M < there_m < gaps.preferred_m:
        return gaps
    return DistanceRange(min(gaps.least_m, there_m - _CLOSER_M), there_m, gaps.most_m)


def _offsets_along_lane(
    reference: ReferenceVehicle, front: float, sign: float, keeps_lane: bool
) -> tuple[FloatArray, FloatArray]:
    """Return offsets (N,) each along and across the lane of the vehicle, ahead of it or behind it (sign -1).

    Who follows a vehicle in our lane keeps to the middle of it (`keeps_lane`), wherever that vehicle drives in it.
    """
    road, item, forward = reference.road, reference.item, front - reference.travel_rad
    if reference.beside_ego_lane and abs(np.sin(forward)) < 0.5:
        at, off = reference.lane_position
        along, lateral = reference.lane_coordinates
        across = lateral if keeps_lane and abs(off) < LANE_M / 2 else lateral - off
        return (1.0 if np.cos(forward) > 0 else -1.0) * (along - at), across
    i, j = reference.cells.T
    lane = road.tracer.trace(item.centre_m, front if sign > 0 else front + np.pi, reference.reach_m)
    along, lateral = lane.cell_coordinates(road.grid)
    return sign * along[i, j], lateral[i, j]


def propose_beside(relation: str, query: Query, item: SceneObject, road: RoadMap) -> Proposal:
    """Propose candidates next to a vehicle, or left or right of it as we see it."""
    reach_m = item.length_m / 2 + road.ego.length_m + _MAX_SIDE_M + (query.distance_m or 0.0)
    reference = ReferenceVehicle(item, road, reach_m)
    as_seen = relation != "next_to"
    forward = reference.viewed_rad if as_seen else align_axis(item.yaw_rad, reference.travel_rad)
    across = as_seen and reference.is_across
    heading = reference.road_heading_rad if across else reference.aligned_heading_rad
    along, left = reference.offsets(forward)
    gaps = DistanceRange(_MIN_SIDE_M, _SIDE_M, _MAX_SIDE_M)
    if query.distance_m is not None and query.distance_of == "referent":
        gaps = gap_range(query, item, road.style)
    ego_half = reference.ego_half_extent_m(heading - forward + np.pi / 2)
    gap = np.abs(left) - reference.half_extent_m(forward + np.pi / 2) - ego_half
    overlap_m = reference.half_extent_m(forward) + _LEVEL_M + road.grid.cell_m / 2  # a candidate is a whole cell
    level = (np.abs(along) <= overlap_m) & (gap >= gaps.least_m) & (gap <= gaps.most_m)
    cost = ((gap - gaps.preferred_m) / 0.8) ** 2 + (along / 2.5) ** 2
    kind = "side to side" if abs(np.sin(forward - item.yaw_rad)) < 0.5 else "side to bumper"
    found = []
    for sign, side in ((1.0, "left_of"), (-1.0, "right_of")):
        if relation in ("next_to", side):
            extra = _FAR_SIDE if relation == "next_to" and sign != reference.ego_side(forward) else 0.0
            found.append(
                reference.candidates_in(
                    level & (sign * left > 0),
                    words=_name_side(forward + sign * np.pi / 2 - reference.travel_rad),
                    cost=cost + extra,
                    heading_rad=heading,
                    gap_m=gap,
                    gap_kind=kind,
                )
            )
    return found, [_explain_sides(reference)] if as_seen else []


def propose_near(relation: str, query: Query, item: SceneObject, road: RoadMap) -> Proposal:
    """Propose candidates near, towards or at a vehicle: short of it, beyond it, left or right of it."""
    most = _AT_M if relation == "at" else _NEAR_M
    named = query.distance_m if query.distance_of == "referent" else None
    reach_m = item.length_m / 2 + road.ego.length_m + max(most, (named or 0.0) * 1.1 + 1.0)
    reference = ReferenceVehicle(item, road, reach_m)
    forward, heading = reference.viewed_rad, reference.road_heading_rad
    along, left = reference.offsets(forward)
    gap = reference.gaps_m(heading)
    close = np.abs(gap - named) <= 1 + named / 10 if named else (gap >= _MIN_SIDE_M) & (gap <= most)
    # Short of the vehicle and beyond it, both the ego lane and the line of the vehicle are in place.
    lateral = np.abs(left)
    if reference.beside_ego_lane:
        lateral = np.minimum(lateral, np.abs(reference.lane_coordinates[1]))
    half = reference.half_extent_m(forward)
    past_its_end = np.abs(along) - half - reference.ego_half_extent_m(heading - forward) >= 0
    level = (np.abs(along) <= half + _LEVEL_M) & ~past_its_end
    end_m = preferred_gap_m(query.action, road.style)
    sides = (
        ("short of it", past_its_end & (along < 0), end_m, lateral / 1.2),
        ("beyond it", past_its_end & (along > 0), end_m, lateral / 1.2),
        ("left of it", level & (left > 0), _SIDE_M, along / 2.5),
        ("right of it", level & (left < 0), _SIDE_M, along / 2.5),
    )
    farther = 3 if reference.ego_side(forward) > 0 else 2
    edge_cost = _edge_cost(reference) if query.action in PARKING else 0.0
    found = []
    for number, (words, region, preferred_m, off) in enumerate(sides):
        extra = _SIDE_COSTS[relation][number] + (_FARTHER if number == farther else 0.0)
        best = 0.0 if relation == "at" else named or preferred_m
        cost = ((gap - best) / ALONG_M) ** 2 + off**2 + extra + edge_cost
        if relation == "toward":
            cost = cost + np.maximum(_beyond_m(reference), 0.0) ** 2
        found.append(
            reference.candidates_in(
                region & close, words=words, cost=cost, heading_rad=heading, gap_m=gap, gap_kind="away from it"
            )
        )
    return found, []


def _beyond_m(reference: ReferenceVehicle) -> FloatArray:
    """Return how far cells (N,) are beyond the vehicle, as seen from the ego."""
    sight = reference.item.centre_m - reference.road.start.xy_m
    return np.asarray((reference.xy_m - reference.item.centre_m) @ (sight / max(float(np.hypot(*sight)), 1e-6)))


def _edge_cost(reference: ReferenceVehicle) -> FloatArray:
    """Return the cost (N,) of parking away from the road edge."""
    road = reference.road
    away = road.tracer.edge_m[tuple(reference.cells.T)] - road.ego.width_m / 2 - _EDGE_M
    return np.asarray(np.minimum(np.maximum(away, 0.0) ** 2, _IN_THE_ROAD))


def _name_side(angle_rad: float) -> str:
    """Return the side of a vehicle at an angle to our direction of travel, in words."""
    ahead, left = np.cos(angle_rad), np.sin(angle_rad)
    if abs(left) > abs(ahead) - 1e-9:
        return "left of it" if left > 0 else "right of it"
    return "beyond it" if ahead > 0 else "short of it"


def _explain_sides(reference: ReferenceVehicle) -> str:
    """Return the frame of reference of left and right in words."""
    turn = reference.item.yaw_rad - reference.viewed_rad
    ours = "left and right are ours, as we see the vehicle"
    if abs(np.sin(turn)) > 0.5:
        return f"{ours}: it stands across our way, so the place is at its end"
    return f"{ours}, which faces us" if reference.item.front_known and np.cos(turn) < 0 else ours
