"""Goal candidates at landmarks of the vector map: before or past a crossing, at a stop line, in a car park."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.checks import BoolArray
from appocc.geometry import wrap_angle
from grounding.goal import ego_lane
from grounding.goal.beside_vehicle import PARKING, propose_beside
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.goal.turns import propose_side_road
from grounding.query import Landmark, Query
from grounding.road.landmarks import Span, explain_unknown
from grounding.road.road_map import RoadMap
from grounding.vocabulary import LANDMARK_KINDS, ORDINALS

# Gap between our front and a landmark to stop at, and to park at.
_GAP_M, _PARKED_GAP_M = 1.0, 3.0
# A place short of a landmark may be this much farther from it, as in a queue; one past it too.
_QUEUE_M, _ON_M = 15.0, 12.0
# What is not to be near something is this far from it.
CLEAR_M = 5.0
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
        return None, [explain_unknown(kind)]
    if kind == "car park":
        return _propose_in_car_park(query, road)
    if query.manoeuvre == "back":
        return _propose_backwards(kind, road)
    straight = query.direction == "straight" and part.relation == "at"
    through = query.action in _ON_THE_WAY and (straight or part.relation in _INSIDE)
    if part.relation in _INSIDE and query.action != "turn" and not through:
        return None, [f"a {kind} is to be kept free: no place on it will do"]
    past = through or part.relation in _PAST or (part.relation == "behind" and kind not in _LINES)
    front_m = road.ego.length_m / 2
    spans = [one for one in road.landmarks.spans(kind, road.ego_lane) if _is_ahead(one, past, front_m)]
    beyond_m = _passed_m(query, part, road)
    spans = [one for one in spans if one.middle_m > beyond_m]
    number = next((ORDINALS[word] - 1 for word in part.qualifiers if word in ORDINALS), 0)
    if not spans:
        here = any(one.near_m <= front_m <= one.far_m for one in road.landmarks.spans(kind, road.ego_lane))
        return None, [f"we are at the {kind} already" if here else f"no {kind} is known ahead of us"]
    if number >= len(spans):
        return None, [f"only {len(spans)} {kind}{'s' if len(spans) > 1 else ''} ahead of us: the map shows no more"]
    span = spans[number]
    reasons = [f"the {kind} is {max(span.near_m - front_m, 0.0):.0f} m ahead of our front"]
    if query.action == "turn" and query.direction in ("left", "right"):
        how = "past" if past else "before" if part.relation == "before" else "at"
        found, more = propose_side_road(road, query.direction, span.middle_m, how)
        return found, [*reasons, *more]
    if query.direction == "around":
        ahead_m = span.far_m if past else span.near_m if part.relation == "before" else span.middle_m
        return ego_lane.propose_turned_around(road, ahead_m), reasons
    if past and span.far_m >= road.ego_lane.end_m:
        told = f"the {kind} reaches beyond the end of the map"
        if not through:
            return None, [f"{told}: what is past it is not known here"]
        return _propose_on_the_way(span, road), [f"{told}: the place is on the way through it"]
    return _propose_along(query, span, past, kind, road), reasons


def keep_clear(query: Query, road: RoadMap) -> list[tuple[str, BoolArray]]:
    """Return what a command keeps clear of landmarks: in words, and the cells (X, Y) of centres that it rules out."""
    found = []
    for part in query.excluded:
        kind = LANDMARK_KINDS.get(part.noun, "")
        if part.relation is None or not road.landmarks.knows(kind):
            continue
        clear_m = 0.0 if part.relation in _INSIDE else part.distance_m or CLEAR_M
        reach_m = clear_m + road.ego.length_m / 2 + road.grid.cell_m
        away_m = road.landmarks.distance_field_m(road.grid, kind)
        where = f"less than {clear_m:.0f} m from" if clear_m else "on"
        found.append((f"places {where} a {kind} are ruled out", away_m <= reach_m))
    return found


def _is_ahead(span: Span, past: bool, front_m: float) -> bool:
    return span.far_m > 0 if past else span.near_m > front_m - _OVER_M


def _passed_m(query: Query, part: Landmark, road: RoadMap) -> float:
    """Return the middle along our lane of what is driven through on the way to a landmark, minus infinity without it.

    "The crossing on the far side" is beyond a junction, whether the command names it or not.
    """
    through = [other for other in query.secondary if other is not part and other.relation in (*_INSIDE, "past")]
    kinds = {LANDMARK_KINDS[other.noun] for other in through if other.noun in LANDMARK_KINDS}
    kinds |= {"junction"} if "opposite_side" in part.qualifiers else set()
    spans = (road.landmarks.spans(kind, road.ego_lane) for kind in kinds)
    ahead = ([one for one in found if one.far_m > road.ego.length_m / 2] for found in spans)
    return max((found[0].middle_m for found in ahead if found), default=-np.inf)


def _propose_backwards(kind: str, road: RoadMap) -> tuple[list[CandidateSet] | None, list[str]]:
    """Return candidates to which we drive backwards, short of a landmark behind us."""
    spans = [one for one in road.landmarks.spans(kind, road.line_behind) if one.near_m > road.ego.length_m / 2]
    if not spans:
        return None, [f"no {kind} is known behind us"]
    back_m = max(spans[0].near_m - road.ego.length_m / 2 - _GAP_M, 0.0)
    return ego_lane.propose_back(road, back_m), [f"the {kind} is {spans[0].near_m:.0f} m behind us"]


def _propose_on_the_way(span: Span, road: RoadMap) -> list[CandidateSet]:
    """Return candidates in our lane as far as the map shows it, on the way through what reaches beyond the map."""
    end_m = road.ego_lane.end_m
    ahead = DistanceRange(max(span.near_m, end_m - _ON_M), end_m, end_m)
    return ego_lane.propose_in_lane(road, ahead, "in our lane, where the map ends")


def _propose_along(query: Query, span: Span, past: bool, kind: str, road: RoadMap) -> list[CandidateSet]:
    """Return candidates short of or past a part of our lane: at the road's edge to park, else in the lane."""
    named = query.distance_m if query.distance_of == "referent" else None
    parks = query.action in PARKING
    gap_m = named if named is not None else _PARKED_GAP_M if parks else _GAP_M
    front_m, side = road.ego.length_m / 2, query.goal_side or road.sides.kerb
    if past:
        preferred = _past_crossings_m(span.far_m, gap_m, road) + front_m + gap_m
        ahead = DistanceRange(preferred - 0.5, preferred, preferred + _ON_M)
    else:
        preferred = max(span.near_m - front_m - gap_m, 0.0)
        ahead = DistanceRange(max(preferred - _QUEUE_M, 0.0), preferred, preferred + 0.5)
    words = f"{'past' if past else 'short of'} the {kind}"
    found = ego_lane.propose_at_edge(road, side, ahead) if parks else ego_lane.propose_in_lane(road, ahead, words)
    return [replace(each, words=words) for each in found]


def _past_crossings_m(far_m: float, gap_m: float, road: RoadMap) -> float:
    """Return where along our lane a landmark that ends at a distance is past, with a crossing right behind it."""
    for span in road.landmarks.spans("crossing", road.ego_lane):
        if span.far_m > far_m and span.near_m < far_m + gap_m + road.ego.length_m:
            far_m = span.far_m
    return far_m


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
