"""Goal candidates at landmarks of the vector map: before or past a crossing, at a stop line, in a car park."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.geometry import wrap_angle
from grounding.goal import ego_lane
from grounding.goal.beside_vehicle import PARKING, propose_beside
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.goal.turns import propose_side_road
from grounding.query import Landmark, Query
from grounding.road.landmarks import Span
from grounding.road.road_map import RoadMap
from grounding.vocabulary import LANDMARK_KINDS, ORDINALS

# Gap between our front and a landmark to stop at, and to park at.
_GAP_M, _PARKED_GAP_M = 1.0, 3.0
# A place short of a landmark may be this much farther from it, as in a queue; one past it too.
_QUEUE_M, _ON_M = 15.0, 12.0
# Our front may be over the near side of a landmark by this.
_OVER_M = 0.5
_PAST = ("past", "opposite")
_INSIDE = ("in", "into", "on")
# Actions that drive on: "go through the lights" ends past them.
_ON_THE_WAY = ("other", "drive_past", "overtake")
# Beyond a stop line is where nobody stops: "behind" it is short of it.
_LINES = ("stop line", "traffic light", "stop sign")
# Cost of a metre to a place in a car park.
_METRE = 0.03


def landmark_of(query: Query) -> Landmark | None:
    """Return the landmark of the road that a place is measured from; None if it is measured from none."""
    for part in query.secondary:
        inside = query.landmark is None and query.referent is None and part.relation in _INSIDE
        if part.of == "goal" and part.noun in LANDMARK_KINDS and (query.landmark == "secondary" or inside):
            return part
    return None


def propose_at_landmark(query: Query, part: Landmark, road: RoadMap) -> tuple[list[CandidateSet] | None, list[str]]:
    """Return the candidate sets at a landmark, None if the map does not show it, and the reasons."""
    kind = LANDMARK_KINDS[part.noun]
    if not road.landmarks.knows(kind):
        return None, [f"no {kind} is known here: the map does not show any"]
    if kind == "car park":
        return _propose_in_car_park(query, road)
    through = part.relation in _INSIDE and query.action in _ON_THE_WAY
    if part.relation in _INSIDE and query.action != "turn" and not through:
        return None, [f"a {kind} is to be kept free: no place on it will do"]
    past = through or part.relation in _PAST or (part.relation == "behind" and kind not in _LINES)
    front_m = road.ego.length_m / 2
    spans = [one for one in road.landmarks.spans(kind, road.ego_lane) if _is_ahead(one, past, front_m)]
    number = next((ORDINALS[word] - 1 for word in part.qualifiers if word in ORDINALS), 0)
    if not spans:
        return None, [f"no {kind} is known ahead of us"]
    if number >= len(spans):
        return None, [f"only {len(spans)} {kind}{'s' if len(spans) > 1 else ''} ahead of us: the map shows no more"]
    span = spans[number]
    reasons = [f"the {kind} is {max(span.near_m - front_m, 0.0):.0f} m ahead of our front"]
    if query.action == "turn" and query.direction in ("left", "right"):
        how = "past" if past else "before" if part.relation == "before" else "at"
        found, more = propose_side_road(road, query.direction, (span.near_m + span.far_m) / 2, how)
        return found, [*reasons, *more]
    if query.direction == "around":
        ahead_m = span.far_m if past else span.near_m if part.relation == "before" else (span.near_m + span.far_m) / 2
        return ego_lane.propose_turned_around(road, ahead_m), reasons
    return _propose_along(query, span, past, kind, road), reasons


def _is_ahead(span: Span, past: bool, front_m: float) -> bool:
    return span.far_m > 0 if past else span.near_m > front_m - _OVER_M


def _propose_along(query: Query, span: Span, past: bool, kind: str, road: RoadMap) -> list[CandidateSet]:
    """Return candidates short of or past a part of our lane: at the road's edge to park, else in the lane."""
    named = query.distance_m if query.distance_of == "referent" else None
    parks = query.action in PARKING
    gap_m = named if named is not None else _PARKED_GAP_M if parks else _GAP_M
    front_m, side = road.ego.length_m / 2, query.goal_side or "right"
    if past:
        preferred = span.far_m + front_m + gap_m
        ahead = DistanceRange(preferred - 0.5, preferred, preferred + _ON_M)
    else:
        preferred = max(span.near_m - front_m - gap_m, 0.0)
        ahead = DistanceRange(max(preferred - _QUEUE_M, 0.0), preferred, preferred + 0.5)
    words = f"{'past' if past else 'short of'} the {kind}"
    found = ego_lane.propose_at_edge(road, side, ahead) if parks else ego_lane.propose_in_lane(road, ahead, words)
    return [replace(each, words=words) for each in found]


def _propose_in_car_park(query: Query, road: RoadMap) -> tuple[list[CandidateSet] | None, list[str]]:
    """Return candidates in the car parks of the map: beside vehicles that stand there, else anywhere in them."""
    inside = road.car_parks & road.drivable
    if not inside.any():
        return None, ["no car park is known here"]
    found = []
    for item in road.free_space.objects:
        cell = road.grid.cell_of(item.centre_m)
        if road.grid.contains(cell) and inside[tuple(cell)]:
            for each in propose_beside("next_to", query, item, road)[0]:
                both = (each, replace(each, heading_rad=wrap_angle(each.heading_rad + np.pi)))
                found += [replace(one.subset(inside[tuple(one.cells.T)]), words="in the car park") for one in both]
    if not any(len(each.cells) for each in found):
        cells = np.argwhere(inside)
        heading = road.direction_rad[tuple(cells.T)]
        found = [CandidateSet("in the car park", cells, np.zeros(len(cells)), heading)]
    far = [np.linalg.norm(road.grid.centre_of(each.cells) - road.start.xy_m, axis=1) for each in found]
    return [replace(each, cost=each.cost + _METRE * way) for each, way in zip(found, far, strict=True)], []
