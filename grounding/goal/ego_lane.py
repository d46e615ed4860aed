"""What a command wishes for that names no vehicle: our lane, the road's edge, a branch, where we are."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.ego_vehicle import EGO_WIDTH_M
from appocc.geometry import wrap_angle
from grounding.goal.search import Wish
from grounding.road.free_space import TAKEN
from grounding.road.road_map import Road

# In our lane means so far aside at most; spread of the dislike.
_IN_LANE_M, _ASIDE_M = 1.6, 0.6
# Lanes are so wide, give or take; ours is changed so many metres ahead: least, wanted, most.
LANE_M, _LANE_SLACK_M, CHANGE_M, _CHANGE_SPREAD_M = 3.5, 1.2, (8.0, 15.0, 25.0), 6.0
# Dislike of a place beyond what stands in the lane.
_BEYOND = 3.0
# At the road's edge the ego's side stands so near to it, give or take, and no farther than so much.
_EDGE_M, _EDGE_SPREAD_M, _AT_EDGE_M = 0.3, 0.5, 1.5
# Dislike of standing in a junction, where the road's axis is not sure.
_JUNCTION, _PLAIN = 4.0, 0.75
# Dislike of the edge of a road across ours, and of going on where our lane has ended.
_OTHER_ROAD, _OTHER_WAY = 6.0, 1.0


def in_lane(road: Road, metres: tuple[float, float, float], words: str, spread_m: float = 4.0) -> list[Wish]:
    """Our own lane, at least, wanted and at most so many metres ahead."""
    return [_along(road, 0.0, _IN_LANE_M, metres, spread_m, words)]


def lane_beside(road: Road, side: str | None) -> list[Wish]:
    """The lane to the left or right of ours (None: either), some way ahead."""
    sides = [(name, sign) for name, sign in (("left", 1.0), ("right", -1.0)) if side in (name, None)]
    return [
        _along(road, sign * LANE_M, _LANE_SLACK_M, CHANGE_M, _CHANGE_SPREAD_M, f"one lane to the {name}")
        for name, sign in sides
    ]


def _along(
    road: Road, aside_m: float, slack_m: float, metres: tuple[float, float, float], spread_m: float, words: str
) -> Wish:
    """Places so far beside our course, some metres ahead on it."""
    along, aside = road.own.coordinates
    least, wanted, most = metres
    region = (along >= least) & (along <= min(most, road.own.end_m)) & (np.abs(aside - aside_m) <= slack_m)
    cells = np.argwhere(region)
    cost = ((along[region] - wanted) / spread_m) ** 2 + ((aside[region] - aside_m) / _ASIDE_M) ** 2
    # One stays behind what stands in the lane.
    blocks = (along > 0) & (np.abs(aside - aside_m) < EGO_WIDTH_M / 2) & ((road.footing.inner & TAKEN) > 0)
    cost += _BEYOND * (along[region] > np.min(along[blocks], initial=np.inf))
    return Wish(words, cells, cost, road.headings(cells, road.own.heading_rad(along[region])), along[region], "ahead")


def further_on(road: Road, metres: tuple[float, float, float], words: str) -> list[Wish]:
    """On any road, so many metres of way from us, the less turned the better: for where our own lane ends."""
    least, wanted, most = metres
    region = (road.ways.length_m >= least) & (road.ways.length_m <= most)
    cells, way = np.argwhere(region), road.ways.length_m[region]
    heading = road.direction_rad[region]
    bearing = np.arctan2(*(road.grid.centre_of(cells) - road.own.middle_m).T[::-1])
    cost = ((way - wanted) / 4.0) ** 2 + 2.0 * (2 - np.cos(heading) - np.cos(bearing))
    cost += junction(road, cells) + (road.off_lane(cells, heading) / 1.5) ** 2
    return [Wish(words, cells, cost + _OTHER_WAY, heading)]


def at_edge(road: Road, side: str, metres: tuple[float, float, float]) -> list[Wish]:
    """The road's edge on a side, ahead."""
    sign = 1.0 if side == "left" else -1.0
    along, aside = road.own.coordinates
    least, wanted, most = metres
    region = road.road & (along >= least) & (along <= min(most, road.own.end_m)) & (sign * aside >= -1.0)
    region &= np.abs(aside) <= 16.0
    cells = np.argwhere(region)
    ours = road.own.heading_rad(along[region])
    heading = road.headings(cells, ours, weight=0.05)
    side_m = road.to_edge(cells, heading + sign * np.pi / 2, most_m=3.0) - EGO_WIDTH_M / 2
    ahead = along[region] - wanted
    cost = np.minimum(((side_m - _EDGE_M) / _EDGE_SPREAD_M) ** 2, 16.0)
    cost += np.where(ahead < 0, ahead / 3.0, ahead / 12.0) ** 2
    cost += junction(road, cells) + _OTHER_ROAD * np.sin(heading - ours) ** 2
    near = side_m < _AT_EDGE_M
    words = f"at the {side} edge of the road"
    return [Wish(words, cells[near], cost[near], heading[near], along[region][near], "ahead")]


def here(road: Road) -> list[Wish]:
    """Where we are, or as near as may be."""
    cells = road.grid.cell_of(road.own.middle_m) + np.argwhere(np.ones((21, 21))) - 10
    cells = cells[road.grid.contains(cells)]
    far = np.linalg.norm(road.grid.centre_of(cells) - road.own.middle_m, axis=1)
    heading = np.zeros(len(cells))
    return [Wish("where we are", cells, (far / 1.0) ** 2, heading)]


def turned_around(road: Road) -> list[Wish]:
    """The opposite lane of our road, heading back."""
    along, aside = road.own.coordinates
    start = road.grid.cell_of(road.own.middle_m)[None]
    start = np.clip(start, 0, np.array(road.grid.shape) - 1)
    left_m, right_m = (float(road.to_edge(start, np.array([turn]))[0]) for turn in (np.pi / 2, -np.pi / 2))
    # The opposite lane mirrors ours at the middle of the road.
    over_m = max(road.keeps * (left_m - right_m), LANE_M)
    wanted = road.keeps * over_m
    region = (along >= -8.0) & (along <= min(25.0, road.own.end_m)) & (np.abs(aside - wanted) <= 2.5)
    cells = np.argwhere(region)
    cost = ((along[region] - 3.0) / 6.0) ** 2 + ((aside[region] - wanted) / 0.8) ** 2
    heading = wrap_angle(road.headings(cells, road.own.heading_rad(along[region])) + np.pi)
    return [Wish("in the opposite lane, turned around", cells, cost, heading, along[region], "ahead")]


def junction(road: Road, cells: IntArray) -> FloatArray:
    """Dislike (N,) of cells (N, 2) in a junction."""
    return np.asarray(_JUNCTION * np.maximum(_PLAIN - road.sure[tuple(cells.T)], 0.0) / _PLAIN)
