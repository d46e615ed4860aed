"""From a command to wishes: which relation, lane, edge or branch its action and its words ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.ego_vehicle import EGO_LENGTH_M
from grounding.goal import ego_lane
from grounding.goal.beside_vehicle import PARKED, about, at_an_end, beside
from grounding.goal.lane_relative import between, on_our_way, opposite
from grounding.goal.reference_frames import Around
from grounding.goal.search import Wish
from grounding.goal.turns import branch
from grounding.query import Query
from grounding.road.road_map import Road
from grounding.scene_object import SceneObject
from grounding.vocabulary import Relation

# What an action means by itself of the vehicle that it takes.
_RELATION_OF: dict[str, Relation] = {
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
# Metres ahead, in our own lane or at the road's edge: least, wanted, most.
_STOP_M, _ON_M, _SLOW_M, _EDGE_M = (0.0, 8.0, 25.0), (12.0, 20.0, 34.0), (3.0, 10.0, 25.0), (4.0, 5.0, 30.0)
_SHORT_OF_M = 5.0
# So near our lane, from its side, a vehicle is in our way.
_IN_OUR_WAY_M = 1.5

Wanted = tuple[list[Wish] | None, list[str]]


def wanted(query: Query, road: Road, item: SceneObject | None, partner: SceneObject | None) -> Wanted:
    """The wishes of a command, best first, and frames of reference in words; no wishes where it names no place."""
    if query.action is None:
        return None, ["this is no driving command"]
    if item is None:
        wishes, reasons = _alone(query, road)
        if query.relation != "none" and wishes is not None:
            word = query.relation.replace("_", " ")
            reasons = [f"there is no vehicle to measure '{word}' from: the place is chosen without it", *reasons]
        return wishes, reasons
    wishes, reasons = _with(query, road, item, partner)
    if wishes is not None and query.goal_side and query.relation != "opposite":
        sign = 1.0 if query.goal_side == "left" else -1.0
        wishes = [_on_side(wish, road, sign) for wish in wishes]
        reasons.append(f"only places on our {query.goal_side} count")
    if query.distance_m is not None and query.distance_of == "ego":
        reasons.append(f"the {query.distance_m:.0f} m to go are not held: the vehicle says where")
    return wishes, reasons


def place_beside(relation: str, query: Query, road: Road, item: SceneObject) -> tuple[list[Wish], list[str]]:
    """The wishes of a relation to a vehicle."""
    if relation in ("behind", "in_front_of", "same_as"):
        return at_an_end("behind" if relation == "same_as" else relation, query, item, road)
    if relation in ("next_to", "left_of", "right_of"):
        return beside(relation, query, item, road)
    if relation in ("before", "past"):
        return on_our_way(relation, query, item, road)
    if relation == "opposite":
        return opposite(query, item, road)
    return about(relation if relation in ("toward", "at") else "near", query, item, road)


def _with(query: Query, road: Road, item: SceneObject, partner: SceneObject | None) -> Wanted:
    """With a vehicle."""
    action, relation = query.action or "stop", query.relation
    if relation == "between":
        if partner is None:
            return None, ["'between' needs two vehicles, and only one is known"]
        return between(item, partner, road)
    if action == "turn" and query.direction in ("left", "right") and relation not in ("none", "same_as"):
        how = {"past": "past", "before": "before"}.get(relation, "at")
        return branch(road, query.direction, Around(item, road, 0.0).on_course[0], how)
    if query.direction == "around":
        return _alone(query, road)
    if relation == "none":
        if action in ("wait", "give_way", "turn") or (action == "other" and query.direction):
            return _alone(query, road)
        if action in ("slow_down", "avoid"):
            return _short_of(road, item)
        relation = _RELATION_OF[action]
    return place_beside(relation, query, road, item)


def _short_of(road: Road, item: SceneObject) -> Wanted:
    """In our own lane, short of a vehicle that is in our way."""
    around = Around(item, road, 0.0)
    along, aside = around.on_course
    half_along, half_aside = around.half_m(around.ours_rad), around.half_m(around.ours_rad + np.pi / 2)
    if not around.beside_course or along < 0 or abs(aside) - half_aside > _IN_OUR_WAY_M:
        return ego_lane.in_lane(road, _SLOW_M, "in our lane"), ["it is not in our way"]
    most = along - half_along - EGO_LENGTH_M / 2 - 1.0
    place = max(most - _SHORT_OF_M + 1.0, 0.0)
    words = f"in our lane, {_SHORT_OF_M:.0f} m short of it"
    return ego_lane.in_lane(road, (min(0.0, most), place, max(most, 0.4)), words), []


def _alone(query: Query, road: Road) -> Wanted:
    """Without a vehicle."""
    action, side = query.action, query.goal_side
    turn = query.direction in ("left", "right") and (action in ("turn", "other") or "turn" in query.actions)
    if turn and query.direction and action not in ("change_lane", "follow", "overtake"):
        return branch(road, query.direction)
    if query.direction == "around":
        return ego_lane.turned_around(road), []
    if action == "change_lane":
        asked = query.direction or side
        reasons = [] if asked else ["no side is named: either lane will do"]
        return ego_lane.lane_beside(road, asked), [*reasons, *_lane_ends(road, ego_lane.CHANGE_M[0])]
    if action in PARKED or (action == "stop" and side):
        side = side or "right"
        metres = _ahead(query, _EDGE_M)
        return [*ego_lane.at_edge(road, side, metres), *_beyond(road, metres)], _lane_ends(road, metres[1])
    lanes = {"stop": _STOP_M, "slow_down": _SLOW_M, "avoid": _SLOW_M}
    if action in ("turn", "other") and query.direction == "straight":
        lanes[action] = _ON_M
    if action in lanes:
        metres = _ahead(query, lanes[action])
        return [*ego_lane.in_lane(road, metres, "in our lane"), *_beyond(road, metres)], _lane_ends(road, metres[1])
    if action in ("wait", "give_way"):
        return ego_lane.here(road), []
    if action == "turn":
        return None, ["the command does not say which way to turn"]
    if action == "other":
        return None, ["the command names no place to go to"]
    return None, [f"the command names no vehicle to {(action or '').replace('_', ' ')}"]


def _ahead(query: Query, otherwise: tuple[float, float, float]) -> tuple[float, float, float]:
    """Least, wanted and greatest metres ahead, by the distance that is named or the usual ones."""
    if query.distance_m is None or query.distance_of == "descriptor":
        return otherwise
    off = 1 + query.distance_m / 10
    return query.distance_m - off, query.distance_m, query.distance_m + off


def _beyond(road: Road, metres: tuple[float, float, float]) -> list[Wish]:
    """Where our lane ends before the place: on another road."""
    return ego_lane.further_on(road, metres, "beyond the end of our lane") if _lane_ends(road, metres[1]) else []


def _lane_ends(road: Road, before_m: float) -> list[str]:
    """That our lane does not reach so far, in words."""
    return [f"our lane ends {max(road.own.end_m, 0.0):.0f} m ahead"] if road.own.end_m < before_m + 1.0 else []


def _on_side(wish: Wish, road: Road, sign: float) -> Wish:
    """Only the cells on a side of our lane's middle."""
    aside = road.own.coordinates[1][tuple(wish.cells.T)]
    keep = sign * aside > 0.2
    gap = None if wish.gap_m is None else wish.gap_m[keep]
    return replace(wish, cells=wish.cells[keep], cost=wish.cost[keep], heading_rad=wish.heading_rad[keep], gap_m=gap)
