"""What a relation to a vehicle wishes for that is measured by the road: on our way, across it, between two."""

from __future__ import annotations

import numpy as np

from appocc.ego_vehicle import EGO_LENGTH_M, EGO_WIDTH_M
from grounding.goal.beside_vehicle import ALONG_M, ASIDE_M, BUMPERS, IN_LINE_M, PARKED, SECOND, off_gap, wanted_gap_m
from grounding.goal.ego_lane import LANE_M
from grounding.goal.reference_frames import Around, ego_half_m, wish_of
from grounding.goal.search import Wish
from grounding.query import Query
from grounding.road.free_space import gap_m, whole_steps
from grounding.road.road_map import Road
from grounding.scene_object import SceneObject

# Level with a vehicle across the road means up to so much before or beyond it; a parked one stands so near the edge.
_LEVEL_M, _EDGE_M, _AT_EDGE_M = 2.0, 0.3, 0.6
# The road's width is looked at so far before and beyond a vehicle, and taken where no side road widens it.
_ACROSS_M, _WIDTH_AT_M, _WIDTH_SHARE = 18.0, np.arange(-8.0, 8.1, 2.0), 0.25
_MIDDLE_M = 1.5
# A vehicle is in our lane up to so far from its middle; dislike of leaving it to drive past something.
_IN_LANE_M, _LEAVES = 1.5, 12.0


def on_our_way(relation: str, query: Query, item: SceneObject, road: Road) -> tuple[list[Wish], list[str]]:
    """Before or past a vehicle on our way: in line with it, in our own lane, or beside it to overtake."""
    wanted, least, most = wanted_gap_m(query, item)
    around = Around(item, road, most + item.length_m / 2 + EGO_LENGTH_M)
    sign, words = (-1.0, "short of it on our way") if relation == "before" else (1.0, "beyond it on our way")
    heading = around.lane_rad
    driven = query.action == "drive_past"
    along, aside = around.offsets(around.ours_rad)
    ego_half = ego_half_m(heading - around.ours_rad)
    lanes = [("in line with it", aside, 0.0)]
    if around.beside_course:
        (at, off), (on, own) = around.on_course, around.course
        along, aside, ego_half = on - at, own - off, np.full(len(on), EGO_LENGTH_M / 2)
        if abs(off) < _IN_LANE_M:
            own = aside  # It stands in our lane itself, and shows where that is.
        # Who drives past it stays in our lane; elsewhere a place in line with it will do.
        lanes = [("in our lane", own, 0.0), ("in line with it", aside, _LEAVES if driven else SECOND)]
        if query.action in PARKED:
            lanes = [("in line with it", aside, 0.0), ("in our lane", own, SECOND)]
    if query.action == "overtake":
        beside = np.abs(aside) - LANE_M
        lanes = [("in line with it", aside, 0.0), ("one lane beside it", beside, SECOND)]
    gap = sign * along - around.half_m(around.ours_rad) - ego_half
    fits = (gap >= least) & (gap <= most)
    price = off_gap(gap, wanted)
    wishes = []
    for where, off_m, dislike in lanes:
        region = fits & (np.abs(off_m) <= IN_LINE_M)
        cost = price + (off_m / ASIDE_M) ** 2 + dislike
        wishes.append(wish_of(f"{words}, {where}", around, region, cost, heading, gap, BUMPERS))
    return wishes, []


def opposite(query: Query, item: SceneObject, road: Road) -> tuple[list[Wish], list[str]]:
    """Across the road from a vehicle, level with it."""
    around = Around(item, road, _ACROSS_M)
    forward = around.ours_rad
    left_m, right_m = _edges(around)
    along, left = around.offsets(forward)
    # From the middle of the road, to the left.
    of_item = (right_m - left_m) / 2
    of_cell, half_road = left + of_item, (left_m + right_m) / 2
    sign = -1.0 if of_item > 0 else 1.0
    level_m = around.half_m(forward) + _LEVEL_M + road.grid.cell_m / 2  # a place is a whole cell
    region = (np.abs(along) <= level_m) & (sign * of_cell > 0)
    region &= np.abs(of_cell) < half_road
    if query.action in PARKED:
        aside = (half_road - np.abs(of_cell) - EGO_WIDTH_M / 2 - _EDGE_M) / _AT_EDGE_M
    else:
        aside = (np.abs(of_cell) - half_road / 2) / 1.5
    cost = (along / ALONG_M) ** 2 + aside**2
    words = f"across the road from it, on the {'left' if sign > 0 else 'right'} side"
    stands = f"{abs(of_item):.1f} m {'left' if of_item > 0 else 'right'} of its middle"
    reason = f"the road is {2 * half_road:.0f} m wide there and the vehicle stands {stands}"
    gap = around.gaps_m(around.lane_rad)
    return [wish_of(words, around, region, cost, around.lane_rad, gap, "away from it")], [reason]


def _edges(around: Around) -> tuple[float, float]:
    """Metres from a vehicle's middle to the road's edges, left and right of our direction; less than 0 beyond one."""
    road, forward = around.road, around.ours_rad
    ahead, left = np.array([np.cos(forward), np.sin(forward)]), np.array([-np.sin(forward), np.cos(forward)])
    foot = np.array(road.on_road(around.item.centre_m))
    cells = foot + np.rint(_WIDTH_AT_M[:, None] * ahead / road.grid.cell_m).astype(np.int64)
    cells = cells[road.grid.contains(cells)]
    cells = cells[road.road[tuple(cells.T)]]
    if not len(cells):
        return 0.0, 0.0
    edges = (road.to_edge(cells, np.full(len(cells), forward + turn)) for turn in (np.pi / 2, -np.pi / 2))
    left_m, right_m = (float(np.quantile(edge, _WIDTH_SHARE)) for edge in edges)
    moved = float((road.grid.centre_of(foot) - around.item.centre_m) @ left)
    return left_m + moved, right_m - moved


def between(item: SceneObject, partner: SceneObject, road: Road) -> tuple[list[Wish], list[str]]:
    """In the gap between two vehicles, clear of both."""
    line = partner.centre_m - item.centre_m
    apart, angle = float(np.hypot(*line)), float(np.arctan2(line[1], line[0]))
    around = Around(item, road, apart + EGO_LENGTH_M)
    heading = around.in_line_rad
    along, aside = around.offsets(angle)
    first, second = around.gaps_m(heading), gap_m(partner, around.xy_m, whole_steps(heading))
    region = (along > 0) & (along < apart) & (np.abs(aside) <= _MIDDLE_M)
    # The farther they stand apart, the less the very middle matters.
    cost = ((first - second) / max(ALONG_M, apart / 8)) ** 2 + aside**2
    room = apart - around.half_m(angle) - Around(partner, road, 0.0).half_m(angle)
    reason = f"the two stand {max(room, 0.0):.1f} m apart"
    gap = np.minimum(first, second)
    return [wish_of("between both", around, region, cost, heading, gap, "from the nearer of them")], [reason]
