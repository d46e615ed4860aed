"""Goal candidates on side roads: which side road a turn refers to, and the cells on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from appocc.checks import FloatArray, IntArray
from appocc.geometry import wrap_angle
from grounding.goal.beside_vehicle import Proposal
from grounding.goal.candidates import CandidateSet, DistanceRange
from grounding.goal.ego_lane import junction_cost, propose_in_lane
from grounding.road.lane_model import POINT_M
from grounding.road.road_map import RoadMap

# A side road differs from the ego lane by an angle in this range.
_TURNED_RAD = (np.radians(45), np.radians(135))
# Least number of cells of a side road, least lateral offset from the ego lane, and distance of the goal into it.
_MIN_CELLS, _MIN_LATERAL_M, _INTO_M = 40, 2.5, 8.0
# Standard deviations of the cost of a place nearer than that, and farther: others may stand there.
_SPREAD_M = 4.0, 10.0
# Side roads that need more reversing than this are left out.
_MAX_BACK_M = 2.0
# A lane that turns by this angle within this distance leads into another road.
_CORNER_RAD, _CORNER_M = np.radians(45), 14.0
# A road that we have passed is this near.
_PASSED_M = 30.0
WHICH_WAY = "the command does not say which way to turn"
# The confidence of the road axis is above this on a side road, and below it in the junction.
_CONFIDENT = 0.5


class _SideRoad(NamedTuple):
    """The entrance of a side road: its label, along-track distance and path length."""

    label: int
    along_m: float
    path_m: float


def propose_side_road(
    road: RoadMap, side: str, reference_m: float | None = None, relation: str = "at", count: int = 1
) -> Proposal:
    """Propose candidates on a side road to the left or right.

    Args:
        road: the road map.
        side: left or right.
        reference_m: along-track distance of a reference vehicle; the side road is chosen relative to it.
        relation: "past" or "before" the reference, or nearest to it ("at").
        count: without a reference, the number of the side road on that side, from 1.
    """
    sign = 1.0 if side == "left" else -1.0
    ahead = road.ego_lane.straighten_at_corner(_CORNER_RAD, _CORNER_M)
    all_along, all_lateral = (
        (road.along_m, road.lateral_m) if ahead is road.ego_lane else ahead.cell_coordinates(road.grid)
    )
    i, j = np.unravel_index(road.paths.cells, road.grid.shape)
    along, lateral = all_along[i, j], all_lateral[i, j]
    turned = wrap_angle(road.direction_rad[i, j] - ahead.heading_rad(along)) * sign
    leaves = (turned > _TURNED_RAD[0]) & (turned < _TURNED_RAD[1])
    leaves &= (road.axis_confidence[i, j] > _CONFIDENT) & (along > 0) & (sign * lateral > _MIN_LATERAL_M)
    mask = np.zeros(road.grid.shape, np.bool_)
    mask[i[leaves], j[leaves]] = True
    label, _ = ndimage.label(mask, np.ones((3, 3)))
    side_roads = _find_side_roads(road, label[i, j].astype(np.int64), all_along)
    if not side_roads:
        behind = explain_passed(road, side)
        return [], [f"the map shows no road that branches off to the {side}", *behind]
    if reference_m is None and count > len(side_roads):
        known = "one road" if len(side_roads) == 1 else f"{len(side_roads)} roads"
        return [], [f"the map shows only {known} that branch{'es' if len(side_roads) == 1 else ''} off to the {side}"]
    chosen = _choose(side_roads, reference_m, relation, count)
    if chosen is None:
        where = "past" if relation == "past" else "before"
        return [], [f"the map shows no road that branches off to the {side} {where} it"]
    cells = np.argwhere(label == chosen.label)
    heading = road.direction_rad[cells[:, 0], cells[:, 1]]
    length = road.paths.length_m[cells[:, 0], cells[:, 1]]
    farther_m = length - chosen.path_m - _INTO_M
    cost = (farther_m / np.where(farther_m < 0, *_SPREAD_M)) ** 2 + (
        road.half_road_offset_m(cells, heading) / 1.2
    ) ** 2
    cost += junction_cost(road, cells)
    reasons = [f"the road to the {side} branches off {chosen.along_m:.0f} m ahead"]
    return [CandidateSet(f"on the road to the {side}", cells, cost, heading)], reasons


def propose_corner(road: RoadMap) -> Proposal:
    """Propose candidates round the corner: where our lane bends, or on the only side road there is.

    Where there are roads to both sides, the reasons say that the command does not tell which.
    """
    ahead_m, side = _bend_of_lane(road)
    if side:
        beyond = DistanceRange(ahead_m + _INTO_M, ahead_m + _CORNER_M, ahead_m + _CORNER_M + _INTO_M)
        found = propose_in_lane(road, beyond, "in our lane, round the corner")
        return found, [f"our lane bends to the {side} {ahead_m:.0f} m ahead"]
    by_side = {side: propose_side_road(road, side) for side in ("left", "right")}
    branches = [each for each in by_side.values() if each[0]]
    if len(branches) == 1:
        return branches[0]
    if not branches:
        return [], ["the map shows no corner ahead of us"]
    return [], [f"{WHICH_WAY}: there are roads to the left and to the right"]


def _bend_of_lane(road: RoadMap) -> tuple[float, str]:
    """Return how far ahead our lane bends into another direction, and to which side; '' where it does not."""
    lane = road.ego_lane
    straight = lane.straighten_at_corner(_CORNER_RAD, _CORNER_M)
    parts = np.flatnonzero(np.hypot(*(lane.points_m - straight.points_m).T) > POINT_M / 10)
    ahead_m = lane.start_m + POINT_M * float(parts[0]) if len(parts) else 0.0
    if ahead_m <= 0:
        return 0.0, ""
    turned = wrap_angle(lane.heading_rad(np.array(ahead_m + _CORNER_M)) - lane.heading_rad(np.array(ahead_m)))
    return ahead_m, "left" if turned > 0 else "right"


def explain_passed(road: RoadMap, side: str) -> list[str]:
    """Return that there is a road to one side that we have passed, and how far behind us it is; empty without one."""
    sign = 1.0 if side == "left" else -1.0
    crosses = np.abs(np.sin(road.tracer.axis_rad - road.start.heading_rad)) > np.sin(_TURNED_RAD[0])
    offset = road.grid.centres() - road.start.xy_m
    ahead_m = offset @ road.start.ahead
    left_m = offset @ np.array([-road.start.ahead[1], road.start.ahead[0]])
    passed = road.drivable & crosses & (road.axis_confidence > _CONFIDENT)
    passed &= (ahead_m < 0) & (ahead_m > -_PASSED_M) & (sign * left_m > _MIN_LATERAL_M) & (np.abs(left_m) < _PASSED_M)
    if passed.sum() < _MIN_CELLS:
        return []
    away_m = float(np.median(-ahead_m[passed]))
    return [f"the road to the {side} that we have passed is {away_m:.0f} m behind us: for it we have to turn round"]


def _find_side_roads(road: RoadMap, label: IntArray, all_along_m: FloatArray) -> list[_SideRoad]:
    """Return the side roads that need no reversing, in the order in which we pass them.

    Args:
        road: the road map.
        label: (N,) label of the side road of each reachable cell, 0 for none.
        all_along_m: (X, Y) along-track distance.
    """
    length = road.paths.length_m.ravel()[road.paths.cells]
    order = np.argsort(length, kind="stable")
    labels, first, count = np.unique(label[order], return_index=True, return_counts=True)
    found = []
    for one, at in zip(labels, first, strict=True):
        if one == 0 or count[labels == one] < _MIN_CELLS:
            continue
        i, j = np.unravel_index(int(road.paths.cells[order[at]]), road.grid.shape)
        if all_along_m[tuple(road.paths.cells_to((int(i), int(j))).T)].min() > -_MAX_BACK_M:
            found.append(_SideRoad(int(one), float(all_along_m[i, j]), float(length[order[at]])))
    return sorted(found, key=lambda one: one.along_m)


def _choose(side_roads: list[_SideRoad], reference_m: float | None, relation: str, count: int) -> _SideRoad | None:
    """Return the side road that the command refers to, None if there is none."""
    if reference_m is None:
        return side_roads[count - 1]
    fits = [one for one in side_roads if relation == "at" or (one.along_m > reference_m) == (relation == "past")]
    return min(fits, key=lambda one: abs(one.along_m - reference_m), default=None)
