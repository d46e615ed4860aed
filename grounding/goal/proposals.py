"""Propose goal candidates for a command: choose the relation, lane, road edge or side road that it asks for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from grounding.goal import ego_lane
from grounding.goal.at_landmark import landmark_of, propose_at_landmark
from grounding.goal.beside_vehicle import PARKING, SECOND, Proposal, propose_beside, propose_in_line, propose_near
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.goal.lane_relative import propose_between, propose_on_our_way, propose_opposite
from grounding.goal.reference_frames import ReferenceVehicle
from grounding.goal.turns import WHICH_WAY, explain_passed, propose_corner, propose_side_road
from grounding.query import Query
from grounding.road.lane_model import LANE_M
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject
from grounding.vocabulary import LANDMARK_KINDS, PERSON_NOUNS

# Relation that an action implies.
_RELATION_OF = {
    "follow": "behind",
    "change_lane": "behind",
    "approach": "toward",
    "overtake": "past",
    "drive_past": "past",
    "park": "near",
    "stop": "near",
    "pull_over": "near",
    "other": "near",
}
# Least distance to go on before the edge of the map.
_LEAST_ON_M = 2.0
# Distance ahead in the ego lane to go on, slow down and creep, along the road edge, and backwards.
_ON_M = DistanceRange(12.0, 20.0, 34.0)
_SLOW_M, _EDGE_M = DistanceRange(3.0, 10.0, 25.0), DistanceRange(2.0, 5.0, 30.0)
_CREEP_M, _BACK_M = DistanceRange(0.8, 2.5, 6.0), 3.0
_SHORT_OF_M = 5.0
# Distance ahead to turn round, and beyond the vehicle to which we come back then.
_TURN_M, _TURN_BEYOND_M = 3.0, 14.0
# A road that branches off at a smaller angle, by its cosine, is a fork: to keep left is to take it.
_FORK_COS = 0.64
# A vehicle whose side is this close to the centreline is in our way.
_IN_OUR_WAY_M = 1.5
# Gaps of a place at the kerb to the vehicle before or past which it is.
_EDGE_GAP_M = DistanceRange(0.5, 1.5, 8.0)
# Tolerance along a person for candidates level with them.
_ABREAST_M = 2.0
# Least lateral offset of candidates on one side of the ego lane.
_MIN_SIDE_M = 0.2

# What no driver should do, by manoeuvre.
_REFUSALS = {
    "pavement": "the pavement is for people on foot: no place on it will do",
    "oncoming_lane": "the oncoming lane is for those who come towards us: no place in it will do",
    "red_light": "a red light means stop: it is not to be passed",
    "double_park": "a second row blocks the lane: we stop at the kerb",
    "push": "another vehicle or a person is not to be touched: we wait behind or drive around",
    "off_road": "beside the road there is no place for a car",
    "speeding": "a speed limit is not to be broken",
}
# Verbs of the horn.
_HORN = re.compile(r"\b(?:honk|beep|toot|hoot)\b")
# Things beside the road.
_OFF_ROAD_NOUNS = ("pavement", "sidewalk", "footpath")

# Candidate sets are None if the command asks for no place.
OptionalProposal = tuple[list[CandidateSet] | None, list[str]]


def propose_candidates(
    query: Query, road: RoadMap, item: SceneObject | None, partner: SceneObject | None
) -> OptionalProposal:
    """Return the candidate sets of a command, best first, and the frame of reference in words."""
    if query.action is None:
        return None, ["this is no driving command"]
    reasons: list[str] = []
    if item is not None and query.manoeuvre == "back" and query.relation == "none" and _is_before_us(item, road):
        item, reasons = None, ["we back away from it"]  # "back up, we're too close to the car in front"
    if item is None and _is_corner(query):
        corner, why = propose_corner(road)
        return corner or None, why
    if item is None and (part := landmark_of(query)):
        return propose_at_landmark(query, part, road)
    if item is None:
        found, more = _propose_alone(query, road)
        reasons = [*reasons, *more]
        if query.relation != "none" and found is not None:
            word = query.relation.replace("_", " ")
            reasons = [f"there is no vehicle to measure '{word}' from: the place is chosen without it", *reasons]
        return found, reasons
    found, reasons = _propose_with(query, road, item, partner)
    if found is not None and query.goal_side == road.sides.kerb and query.relation in ("before", "past"):
        found = [*_propose_at_kerb(query, road, item), *(replace(one, cost=one.cost + SECOND) for one in found)]
    if found is not None and query.goal_side and query.relation != "opposite":
        sign = 1.0 if query.goal_side == "left" else -1.0
        found = [_keep_side(each, road, sign) for each in found]
        reasons.append(f"only places on our {query.goal_side} count")
    if found is not None and query.manoeuvre == "back" and query.action not in PARKING:
        found = [_keep_behind(each, road) for each in found]
        if not any(len(each.cells) for each in found):
            return None, ["driving backwards does not lead there: it is not behind us"]
    if query.distance_m is not None and query.distance_of in ("ego", "kerb"):
        what = "to the kerb" if query.distance_of == "kerb" else "to go"
        reasons.append(f"the {query.distance_m:.3g} m {what} are not held: the vehicle says where")
    return found, reasons


def _is_corner(query: Query) -> bool:
    """Return whether a command turns at a corner and does not say to which side: "go round the corner"."""
    corners = [one for one in query.secondary if LANDMARK_KINDS.get(one.noun) == "junction" and one.of == "goal"]
    round_it = any(one.relation in ("near", "into") for one in corners)
    turns = query.action == "turn" and (query.direction is None or (query.direction == "around" and round_it))
    return bool(corners) and (turns or (query.action == "other" and query.direction is None and round_it))


def explain_refusal(query: Query) -> str:
    """Return why a command is refused; '' if it is not."""
    on_foot = query.referent is not None and query.referent.noun in PERSON_NOUNS  # who stands there, not we
    onto = any(
        part.noun in _OFF_ROAD_NOUNS
        and part.relation in ("on", "onto", "into", "in")
        and part.of == "goal"
        and not on_foot
        for part in query.secondary
    )
    if query.action == "other" and query.relation == "none" and _HORN.search(query.command.lower()):
        return "the horn is not controlled here"
    unheeded = any(one.relation == "for" and one.noun in PERSON_NOUNS for one in query.excluded)
    if unheeded and query.action == "other":
        return "people go first: we stop for them"
    return _REFUSALS.get("pavement" if onto else query.manoeuvre or "", "")


def propose_relation(relation: str, query: Query, road: RoadMap, item: SceneObject) -> Proposal:
    """Return the candidate sets of a relation to a vehicle, or to a person, whose heading says nothing."""
    if item.class_name == "person":
        short, beyond, *level = propose_near("near", query, item, road)[0]
        parts = {"behind": [short], "before": [short], "past": [beyond]}
        return parts.get(relation, [*level, *_propose_abreast(query, item, road), short, beyond]), []
    if relation in ("behind", "in_front_of", "same_as"):
        return propose_in_line("behind" if relation == "same_as" else relation, query, item, road)
    if relation in ("next_to", "left_of", "right_of"):
        return propose_beside(relation, query, item, road)
    if relation in ("before", "past"):
        return propose_on_our_way(relation, query, item, road)
    if relation == "opposite":
        return propose_opposite(query, item, road)
    return propose_near(relation if relation in ("toward", "at") else "near", query, item, road)


def _propose_at_kerb(query: Query, road: RoadMap, item: SceneObject) -> list[CandidateSet]:
    """Return candidates at our kerb, before or past a vehicle: "pull up on the right, just before the van"."""
    reference = ReferenceVehicle(item, road, 0.0)
    along_m, _ = reference.lane_position
    clear_m = reference.half_extent_m(reference.travel_rad) + road.ego.length_m / 2
    sign = -1 if query.relation == "before" else 1
    ahead = DistanceRange(*(along_m + sign * (gap_m + clear_m) for gap_m in _EDGE_GAP_M[::sign]))
    return ego_lane.propose_at_edge(road, road.sides.kerb, ahead) if reference.beside_ego_lane else []


def _propose_abreast(query: Query, item: SceneObject, road: RoadMap) -> list[CandidateSet]:
    """Return candidates level with a person who may be across the road: at our edge to park, else in our lane."""
    reference = ReferenceVehicle(item, road, 0.0)
    along_m, _ = reference.lane_position
    if not reference.beside_ego_lane:
        return []
    level = DistanceRange(along_m - _ABREAST_M, along_m, along_m + _ABREAST_M)
    side = query.goal_side or road.sides.kerb
    parks, words = query.action in PARKING, "level with it, on our side of the road"
    found = ego_lane.propose_at_edge(road, side, level) if parks else ego_lane.propose_in_lane(road, level, words)
    return [replace(each, words=words, cost=each.cost + SECOND) for each in found]


def _propose_with(query: Query, road: RoadMap, item: SceneObject, partner: SceneObject | None) -> OptionalProposal:
    """Return the candidate sets of a command with a reference vehicle."""
    action, relation = query.action or "stop", query.relation
    if relation == "between":
        if partner is None:
            return None, ["'between' needs two vehicles, and only one is known"]
        return propose_between(item, partner, road)
    if action == "turn" and query.direction in ("left", "right") and relation not in ("none", "same_as"):
        along_m, _ = ReferenceVehicle(item, road, 0.0).lane_position
        how = relation if relation in ("past", "before") else "at"
        return propose_side_road(road, query.direction, along_m, how)
    if action == "turn" and query.direction is None:
        return None, [WHICH_WAY]
    if query.direction == "around":
        along_m = ReferenceVehicle(item, road, 0.0).lane_position[0]
        beyond_m = along_m + item.length_m / 2 + _TURN_BEYOND_M
        level_m = along_m if along_m < 0 else max(along_m, _TURN_M)  # back to one behind us
        ahead_m = beyond_m if relation == "past" else _TURN_M if relation == "none" and along_m > 0 else level_m
        return ego_lane.propose_turned_around(road, ahead_m), []
    if relation == "none":
        if action in ("wait", "give_way"):
            return _propose_letting(road, item)
        if action == "turn" or (action == "other" and query.direction):
            return _propose_alone(query, road)
        walks = item.class_name == "person" and item.is_standing is False  # "stop for the man crossing"
        if action in ("slow_down", "avoid") or (action == "stop" and walks):
            return _propose_short_of(query, road, item)
        return propose_relation(_RELATION_OF[action], query, road, item)
    return propose_relation(relation, query, road, item)


def _propose_letting(road: RoadMap, item: SceneObject) -> Proposal:
    """Return candidates to give way: short of a road user ahead of us, at the kerb for one behind us in our lane."""
    along, lateral = (float(each) for each in road.ego_lane.project(item.centre_m))
    if along < 0 and abs(lateral) < LANE_M / 2:
        edge = ego_lane.propose_at_edge(road, road.sides.kerb, _to_stop_at(road, _EDGE_M))
        return [*edge, *(replace(one, cost=one.cost + SECOND) for one in _propose_waiting(road))], []
    if along < 0 or road.speed_mps is None or ego_lane.is_standing(road):
        return _propose_waiting(road), []
    stop = ego_lane.stopping_range(road)
    half = ReferenceVehicle(item, road, 0.0).half_extent_m(road.start.heading_rad)
    short_m = along - half - road.ego.length_m / 2 - road.style.stop_gap_m
    most = max(min(stop.most_m, short_m), stop.least_m)
    ahead = DistanceRange(stop.least_m, min(stop.preferred_m, most), most + road.grid.cell_m)
    too_near = ["it is too near for us to stop short of it"] if short_m < stop.least_m else []
    return ego_lane.propose_in_lane(road, ahead, "in our lane"), too_near


def _propose_waiting(road: RoadMap) -> list[CandidateSet]:
    """Return candidates to stand where we are, or where our speed lets us stop."""
    if road.speed_mps is None or ego_lane.is_standing(road):
        return ego_lane.propose_here(road)
    return ego_lane.propose_in_lane(road, ego_lane.stopping_range(road), "in our lane")


def _propose_short_of(query: Query, road: RoadMap, item: SceneObject) -> Proposal:
    """Return candidates in the ego lane short of a vehicle that is in our way, by the distance that is named."""
    named = query.distance_m if query.distance_of == "referent" else None
    short_m = _SHORT_OF_M if named is None else named
    reference = ReferenceVehicle(item, road, 0.0)
    along, _ = reference.lane_position
    half_length = reference.half_extent_m(reference.travel_rad)
    if along < 0 and query.action == "stop":  # "this gentleman wants to get in, stop for him"
        return propose_relation("near", query, road, item)
    if along < 0 or (query.action != "stop" and not is_in_our_way(item, road)):
        return ego_lane.propose_in_lane(road, _SLOW_M, "in our lane"), ["it is not in our way"]
    most = along - half_length - road.ego.length_m / 2 - 1.0
    preferred = most - short_m + 1.0
    words = f"in our lane, {short_m:.0f} m short of it" if preferred > 0 else "in our lane"
    nearer = [] if preferred > 0 else [f"we are less than {short_m:.0f} m short of it already"]
    return ego_lane.propose_in_lane(
        road, DistanceRange(min(0.0, most), max(preferred, 0.0), max(most, 0.4)), words
    ), nearer


def is_in_our_way(item: SceneObject, road: RoadMap) -> bool:
    """Return whether a vehicle or a person is ahead in our lane or reaches into it."""
    reference = ReferenceVehicle(item, road, 0.0)
    along, lateral = reference.lane_position
    half_width = reference.half_extent_m(reference.travel_rad + np.pi / 2)
    return bool(along >= 0 and reference.beside_ego_lane and abs(lateral) - half_width <= _IN_OUR_WAY_M)


def _is_before_us(item: SceneObject, road: RoadMap) -> bool:
    return float((item.centre_m - road.start.xy_m) @ road.start.ahead) > 0


def _propose_alone(query: Query, road: RoadMap) -> OptionalProposal:
    """Return the candidate sets of a command without a reference vehicle."""
    action, side = query.action, query.goal_side
    if query.manoeuvre == "back":
        return ego_lane.propose_back(road, query.distance_m or _BACK_M), []
    if query.manoeuvre == "creep":
        return ego_lane.propose_in_lane(road, _distance_ahead(query, _CREEP_M), "in our lane"), []
    turn = query.direction in ("left", "right") and (action in ("turn", "other") or "turn" in query.actions)
    if turn and query.direction and any("behind_ego" in part.qualifiers for part in query.secondary):
        return None, explain_passed(road, query.direction) or [f"no road to the {query.direction} is known behind us"]
    if turn and query.direction and action not in ("change_lane", "follow", "overtake"):
        turning = propose_side_road(road, query.direction, count=query.count or 1)
        keeps = action == "other" and query.count is None and not any(_forks(one, road) for one in turning[0] or ())
        return (
            _propose_lane_change(query, road, ()) if keeps else turning
        )  # "keep right" where the road does not fork
    if query.direction == "around":
        return ego_lane.propose_turned_around(road, _TURN_M), []
    lanes = [word for part in query.secondary if part.noun == "lane" for word in part.qualifiers]
    if action == "other" and {*lanes} & {"left_lane", "right_lane"} and not query.direction:
        return ego_lane.propose_in_lane(road, _ON_M, "in our lane"), ["the lane to stay in is taken to be ours"]
    if action == "change_lane":
        return _propose_lane_change(query, road, lanes)
    if action in PARKING or (action == "stop" and side) or (action == "other" and query.road_side == "opposite"):
        if query.count is not None and query.count > 1:
            return ego_lane.propose_in_gap(road, side or road.sides.kerb, query.count)
        ahead = _distance_ahead(query, _to_stop_at(road, _EDGE_M))
        kerb = {"gap_m": query.distance_m} if query.distance_of == "kerb" and query.distance_m is not None else {}
        found = ego_lane.propose_at_edge(road, side or road.sides.kerb, ahead, **kerb)
        return [*found, *_propose_beyond_lane_end(road, ahead)], _note_lane_end(road, ahead.preferred_m)
    ranges = {"stop": ego_lane.stopping_range(road), "slow_down": _SLOW_M, "avoid": _SLOW_M}
    goes_on = query.direction == "straight" or query.manoeuvre == "onward" or query.distance_m is not None
    if action in ("turn", "other") and goes_on:
        ranges[action] = _ON_M
    if action == "stop" and ego_lane.is_standing(road) and not goes_on:
        return ego_lane.propose_here(road), ["we stand already"]
    if action in ranges:
        ahead = _distance_ahead(query, ranges[action])
        if goes_on and query.distance_m is None:
            ahead = _within_map(road, ahead)
        found = ego_lane.propose_in_lane(road, ahead, "in our lane")
        return [*found, *_propose_beyond_lane_end(road, ahead)], _note_lane_end(road, ahead.preferred_m)
    if action in ("wait", "give_way"):
        return _propose_waiting(road), []
    if action == "turn":
        return None, [WHICH_WAY]
    if action == "other":
        return None, ["the command names no place to go to"]
    return None, [f"the command names no vehicle to {(action or '').replace('_', ' ')}"]


def _forks(side_road: CandidateSet, road: RoadMap) -> bool:
    """Return whether a road branches off at a small angle."""
    return bool(np.any(np.cos(side_road.heading_rad - road.start.heading_rad) > _FORK_COS))


def _propose_lane_change(query: Query, road: RoadMap, lanes: Sequence[str]) -> OptionalProposal:
    """Return the candidate sets of a lane change; where ours is the lane at the kerb, it is kept."""
    asked, kerb_side = query.direction or query.goal_side, road.sides.kerb
    ours_at_kerb = not ego_lane.has_kerb_lane(road)
    if ours_at_kerb and (f"{kerb_side}_lane" in lanes or asked == kerb_side):
        return ego_lane.propose_in_lane(road, _ON_M, "in our lane"), [f"the {kerb_side} lane is ours: we keep it"]
    unknown = "the map counts no lanes" if "middle_lane" in lanes else "no side is named"
    reasons = [] if asked else [f"{unknown}: either lane will do"]
    if asked and query.action == "other" and ego_lane.is_oncoming_lane(road, asked):
        why = f"the lane to the {asked} is that of oncoming traffic: we keep ours"
        return ego_lane.propose_in_lane(road, _ON_M, "in our lane"), [why]
    found = ego_lane.propose_next_lane(road, asked)
    if not asked and ours_at_kerb:
        ours = ego_lane.propose_in_lane(road, ego_lane.CHANGE_M, "in our lane")
        away = ego_lane.propose_next_lane(road, "left" if kerb_side == "right" else "right")
        found = [*away, *(replace(one, cost=one.cost + SECOND) for one in ours)]
        reasons = [f"{unknown}, and the lane at the kerb is ours"]
    return found, [*reasons, *_note_lane_end(road, ego_lane.CHANGE_M.least_m)]


def _within_map(road: RoadMap, ahead: DistanceRange) -> DistanceRange:
    """Return a distance ahead that is as short as the rest of our lane, where that leads to the edge of the map."""
    lane = road.ego_lane
    left_m = max(lane.end_m - road.ego.length_m, _LEAST_ON_M)
    if lane.at_road_end or left_m >= ahead.preferred_m:
        return ahead
    return DistanceRange(min(ahead.least_m, left_m / 2), left_m, ahead.most_m)


def _to_stop_at(road: RoadMap, ahead: DistanceRange) -> DistanceRange:
    """Return a distance ahead to stop at, as far as our speed allows."""
    if road.speed_mps is None:
        return ahead
    stop = ego_lane.stopping_range(road)
    return DistanceRange(*(max(each) for each in zip(ahead, stop, strict=True)))


def _distance_ahead(query: Query, default: DistanceRange) -> DistanceRange:
    """Return the distance ahead that the command gives, or the default."""
    if query.distance_m is None or query.distance_of in ("descriptor", "kerb"):
        return default
    off = 1 + query.distance_m / 10
    return DistanceRange(query.distance_m - off, query.distance_m, query.distance_m + off)


def _propose_beyond_lane_end(road: RoadMap, ahead: DistanceRange) -> Sequence[CandidateSet]:
    """Return candidates on another road if the ego lane ends before the preferred distance."""
    if not _note_lane_end(road, ahead.preferred_m) or not road.ego_lane.at_road_end:
        return ()
    return ego_lane.propose_on_any_road(road, ahead, "beyond the end of our lane")


def _note_lane_end(road: RoadMap, before_m: float) -> list[str]:
    """Return a note if the ego lane, or the map, ends before a distance."""
    end_m = road.ego_lane.end_m
    what = "our lane" if road.ego_lane.at_road_end else "the map of our lane"
    return [f"{what} ends {max(end_m, 0.0):.0f} m ahead"] if end_m < before_m + 1.0 else []


def _keep_behind(candidates: CandidateSet, road: RoadMap) -> CandidateSet:
    """Return the candidates behind the pose at the start."""
    offset_m = road.grid.centre_of(candidates.cells) - road.start.xy_m
    return candidates.subset(offset_m @ road.start.ahead < 0)


def _keep_side(candidates: CandidateSet, road: RoadMap, sign: float) -> CandidateSet:
    """Return the candidates left (1) or right (-1) of the ego lane's centreline."""
    return candidates.subset(sign * road.lateral_m[tuple(candidates.cells.T)] > _MIN_SIDE_M)
