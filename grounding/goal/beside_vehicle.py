"""What a relation to a vehicle wishes for: cells around it, how good each is, and the frame in words."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.ego_vehicle import EGO_LENGTH_M, EGO_WIDTH_M
from appocc.geometry import wrap_angle
from grounding.goal.reference_frames import Around, ego_half_m, front_of, wish_of
from grounding.goal.search import Wish
from grounding.query import Query
from grounding.road.road_map import Road, agreeing
from grounding.scene_object import SceneObject

# Metres between bumpers where the command names none; elsewhere _GAP_M. To follow: and so many seconds' way.
_GAPS_M = {"park": 1.0, "pull_over": 1.5, "overtake": 6.0, "drive_past": 6.0}
_GAP_M, _FOLLOW_M, _FOLLOW_S = 2.0, 6.0, 1.5
_PASSES, _PASSED_M = ("overtake", "drive_past"), 2.0
# A queue may stand between us and a vehicle to stop behind; one parks beside it or not at all.
_FURTHER_M, _FURTHER_PARKED_M, _CLOSER_M = 10.0, 3.0, 3.0
# Beside: metres between sides, and by how much lengths may miss each other's middle. Near and at: the greatest gap.
_LEVEL_M = 1.0
_LEAST_M, _LEAST_SIDE_M, _SIDE_M, _MOST_SIDE_M = 0.3, 0.4, 0.8, 2.3
_NEAR_M, _AT_M = 6.0, 10.0
# In line means so far aside at most, in our own lane too; spreads of the dislikes along (farther and
# closer than wanted) and aside.
IN_LINE_M, ALONG_M, _CLOSE_M, _CLOSE_SHARE, ASIDE_M = 1.2, 2.0, 1.0, 0.25, 0.6
# Dislike of a way that is only the second best, and of the farther side.
SECOND, _FAR_SIDE, _FARTHER, _ALSO = 1.5, 0.8, 0.3, 0.1
# One who parks stands so near the edge of the road.
_EDGE_M = 0.3
PARKED = ("park", "pull_over")
BUMPERS = "bumper to bumper"
# Dislikes of places short of it, beyond it, left and right of it.
_DISLIKES = {"near": (0.5, 0.5, 0.0, 0.0), "at": (0.0, 0.0, 0.0, 0.0), "toward": (0.0, 2.0, 1.0, 1.0)}


def wanted_gap_m(query: Query, item: SceneObject) -> tuple[float, float, float]:
    """Wanted, least and greatest gap between bumpers, metres."""
    if query.distance_m is not None and query.distance_of == "referent":
        # A distance that is named is kept to within a metre and a tenth.
        named, off = query.distance_m, 1 + query.distance_m / 10
        return named, max(min(_LEAST_M, named), named - off), named + off
    follows = query.action in ("follow", "change_lane") or query.relation == "same_as"
    wanted = _FOLLOW_M + _FOLLOW_S * (item.speed_mps or 0.0) if follows else _GAPS_M.get(query.action or "", _GAP_M)
    # One who follows does not squeeze in before a queue; how far beyond it one is who has passed, nobody measures.
    least = _PASSED_M if query.action in _PASSES else max(_LEAST_M, wanted - _CLOSER_M)
    return wanted, least, wanted + (_FURTHER_PARKED_M if query.action in PARKED else _FURTHER_M)


def off_gap(gap_m: FloatArray, wanted_m: float) -> FloatArray:
    """Dislike (N,) of other gaps than the wanted one; closer is worse than farther, less so where it is wide."""
    close_m = max(_CLOSE_M, wanted_m * _CLOSE_SHARE)
    return np.asarray(((gap_m - wanted_m) / np.where(gap_m < wanted_m, close_m, ALONG_M)) ** 2)


def at_an_end(relation: str, query: Query, item: SceneObject, road: Road) -> tuple[list[Wish], list[str]]:
    """Behind or in front of a vehicle, in line with it or on along its lane."""
    wanted, least, most = wanted_gap_m(query, item)
    around = Around(item, road, most + item.length_m / 2 + EGO_LENGTH_M)
    word = relation.replace("_", " ")
    front, reasons = front_of(around, word)
    sign = -1.0 if relation == "behind" else 1.0
    along, aside = around.offsets(front)
    # In a narrow gap one heading may fit where the other does not; across the road only the vehicle's own does.
    headings = [around.in_line_rad] if around.across else [around.in_line_rad, around.lane_rad]
    if most > _FURTHER_M + _GAP_M and not around.across:
        along, aside = _bent(around, front, sign)
    if query.action == "follow" and item.front_known:
        headings = [np.where(np.cos(one - item.yaw_rad) < 0, wrap_angle(one + np.pi), one) for one in headings]
        if around.faces_us and not around.stands:
            reasons.append("it comes towards us: to follow it we have to turn around")
    wishes = []
    for number, heading in enumerate(headings):
        gap = sign * along - item.length_m / 2 - ego_half_m(heading - front)
        region = (gap >= least) & (gap <= most) & (np.abs(aside) <= IN_LINE_M)
        cost = off_gap(gap, wanted) + (aside / ASIDE_M) ** 2 + number * _ALSO
        wishes.append(wish_of(f"{word} it", around, region, cost, heading, gap, BUMPERS))
    return wishes, reasons


def _bent(around: Around, front: float, sign: float) -> tuple[FloatArray, FloatArray]:
    """Metres along and aside of a vehicle's lane, where that bends, forwards or (sign -1) backwards of its front."""
    road, item = around.road, around.item
    if around.beside_course and abs(np.sin(front - around.ours_rad)) < 0.5:
        at, off = around.on_course
        on, aside = around.course
        return (1.0 if np.cos(front - around.ours_rad) > 0 else -1.0) * (on - at), aside - off
    i, j = around.cells.T
    heading = front if sign > 0 else front + np.pi
    on, aside = road.tracer.course(item.centre_m, heading, around.reach_m).coordinates
    return sign * on[i, j], aside[i, j]


def beside(relation: str, query: Query, item: SceneObject, road: Road) -> tuple[list[Wish], list[str]]:
    """Next to a vehicle, or left or right of it as we see it."""
    around = Around(item, road, item.length_m / 2 + EGO_LENGTH_M + _MOST_SIDE_M + (query.distance_m or 0.0))
    as_seen = relation != "next_to"
    forward = around.seen_rad if as_seen else agreeing(item.yaw_rad, around.ours_rad)
    heading = around.lane_rad if as_seen and around.across else around.in_line_rad
    along, left = around.offsets(forward)
    wanted, least, most = _SIDE_M, _LEAST_SIDE_M, _MOST_SIDE_M
    if query.distance_m is not None and query.distance_of == "referent":
        wanted, least, most = wanted_gap_m(query, item)
    gap = np.abs(left) - around.half_m(forward + np.pi / 2) - ego_half_m(heading - forward + np.pi / 2)
    overlap_m = around.half_m(forward) + _LEVEL_M + road.grid.cell_m / 2  # a place is a whole cell
    level = (np.abs(along) <= overlap_m) & (gap >= least) & (gap <= most)
    cost = ((gap - wanted) / 0.8) ** 2 + (along / 2.5) ** 2
    measured = "side to side" if abs(np.sin(forward - item.yaw_rad)) < 0.5 else "side to bumper"
    wishes = []
    for sign, side in ((1.0, "left_of"), (-1.0, "right_of")):
        if relation in ("next_to", side):
            dislike = _FAR_SIDE if relation == "next_to" and sign != around.side_of_us(forward) else 0.0
            words = _seen(forward + sign * np.pi / 2 - around.ours_rad)
            wishes.append(wish_of(words, around, level & (sign * left > 0), cost + dislike, heading, gap, measured))
    return wishes, [_whose(around)] if as_seen else []


def about(relation: str, query: Query, item: SceneObject, road: Road) -> tuple[list[Wish], list[str]]:
    """Near a vehicle, towards it or where it is: short of it, beyond it or beside it, not too far away."""
    most = _AT_M if relation == "at" else _NEAR_M
    named = query.distance_m if query.distance_of == "referent" else None
    around = Around(item, road, item.length_m / 2 + EGO_LENGTH_M + max(most, (named or 0.0) * 1.1 + 1.0))
    forward, heading = around.seen_rad, around.lane_rad
    along, left = around.offsets(forward)
    gap = around.gaps_m(heading)
    close = np.abs(gap - named) <= 1 + named / 10 if named else (gap >= _LEAST_SIDE_M) & (gap <= most)
    # Short of it and beyond it we stay in our lane or come in line with it.
    aside = np.abs(left) if not around.beside_course else np.minimum(np.abs(left), np.abs(around.course[1]))
    past_its_end = np.abs(along) - around.half_m(forward) - ego_half_m(heading - forward) >= 0
    level = (np.abs(along) <= around.half_m(forward) + _LEVEL_M) & ~past_its_end
    end_m = _GAPS_M.get(query.action or "", _GAP_M)
    ways = (
        ("short of it", past_its_end & (along < 0), end_m, aside / 1.2),
        ("beyond it", past_its_end & (along > 0), end_m, aside / 1.2),
        ("left of it", level & (left > 0), _SIDE_M, along / 2.5),
        ("right of it", level & (left < 0), _SIDE_M, along / 2.5),
    )
    farther = 3 if around.side_of_us(forward) > 0 else 2
    edges = _off_edge(around) if query.action in PARKED else 0.0
    wishes = []
    for number, (words, region, wanted, off) in enumerate(ways):
        dislike = _DISLIKES[relation][number] + (_FARTHER if number == farther else 0.0)
        best = 0.0 if relation == "at" else named or wanted
        cost = ((gap - best) / ALONG_M) ** 2 + off**2 + dislike + edges
        wishes.append(wish_of(words, around, region & close, cost, heading, gap, "away from it"))
    return wishes, []


def _off_edge(around: Around) -> FloatArray:
    """Dislike (N,) of places that are not at an edge of the road, for one who parks."""
    away = around.road.tracer.edge_m[tuple(around.cells.T)] - EGO_WIDTH_M / 2 - _EDGE_M
    return np.asarray(np.minimum(np.maximum(away, 0.0) ** 2, SECOND))


def _seen(angle_rad: float) -> str:
    """Where a place lies from a vehicle, at an angle to our direction."""
    ahead, left = np.cos(angle_rad), np.sin(angle_rad)
    if abs(left) > abs(ahead) - 1e-9:
        return "left of it" if left > 0 else "right of it"
    return "beyond it" if ahead > 0 else "short of it"


def _whose(around: Around) -> str:
    """Whose left and right they are, and why not the vehicle's where those are others."""
    turn = around.item.yaw_rad - around.seen_rad
    ours = "left and right are ours, as we see the vehicle"
    if abs(np.sin(turn)) > 0.5:
        return f"{ours}: it stands across our way, so the place is at its end"
    return f"{ours}, which faces us" if around.item.front_known and np.cos(turn) < 0 else ours
