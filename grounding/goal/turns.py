"""Roads that branch off: which one a turn means, and the place on it."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from appocc.checks import FloatArray, IntArray
from appocc.geometry import wrap_angle
from grounding.goal.ego_lane import junction
from grounding.goal.search import Wish
from grounding.road.road_map import Road

# A branch leaves by so much, has so many cells, so far beside our lane, and the place is so far into it.
_TURNED_RAD = (np.radians(45), np.radians(135))
_BRANCH_CELLS, _BESIDE_M, _BRANCH_M = 40, 2.5, 8.0
# Who turns does not go back more than this.
_BACK_M = 2.0
# A lane that turns so far over so many metres leads into another road.
_CORNER_RAD, _CORNER_M = np.radians(45), 14.0
# So sure the road's axis is on a branch, and not in the junction before it.
_SURE = 0.5


def branch(road: Road, side: str, past_m: float | None = None, how: str = "at") -> tuple[list[Wish], list[str]]:
    """On the first road that branches off to a side.

    With `past_m`, metres along our lane, the one past that (`how`: "past"), before it or the nearest "at" it.
    """
    sign = 1.0 if side == "left" else -1.0
    ahead = road.own.straight_from_corner(_CORNER_RAD, _CORNER_M)
    i, j = np.unravel_index(road.ways.cells, road.grid.shape)
    along, aside = (values[i, j] for values in ahead.coordinates)
    turned = wrap_angle(road.direction_rad[i, j] - ahead.heading_rad(along)) * sign
    leaves = (turned > _TURNED_RAD[0]) & (turned < _TURNED_RAD[1]) & (road.sure[i, j] > _SURE) & (along > 0)
    leaves &= sign * aside > _BESIDE_M
    mask = np.zeros(road.grid.shape, np.bool_)
    mask[i[leaves], j[leaves]] = True
    label, _ = ndimage.label(mask, np.ones((3, 3)))
    entrances = _entrances(road, label[i, j].astype(np.int64), ahead.coordinates[0])
    if not entrances:
        return [], [f"the map shows no road that branches off to the {side}"]
    number, entrance_m, way_m = _choice(entrances, past_m, how)
    if number is None:
        where = "past" if how == "past" else "before"
        return [], [f"the map shows no road that branches off to the {side} {where} it"]
    cells = np.argwhere(label == number)
    heading = road.direction_rad[cells[:, 0], cells[:, 1]]
    length = road.ways.length_m[cells[:, 0], cells[:, 1]]
    cost = ((length - way_m - _BRANCH_M) / 4.0) ** 2 + (road.off_lane(cells, heading) / 1.2) ** 2
    cost += junction(road, cells)
    reasons = [f"the road to the {side} branches off {entrance_m:.0f} m ahead"]
    return [Wish(f"on the road to the {side}", cells, cost, heading)], reasons


def _entrances(road: Road, number: IntArray, along_of: FloatArray) -> list[tuple[int, float, float]]:
    """Number, metres along our lane and way of each branch's nearest cell, in the order in which we come past.

    Branches to which one would have to go back first are left out.

    Args:
        road: the road.
        number: (N,) of the branch of each cell that can be reached, 0 for none.
        along_of: (X, Y) metres along our lane.
    """
    way = road.ways.length_m.ravel()[road.ways.cells]
    order = np.argsort(way, kind="stable")
    branches, first, count = np.unique(number[order], return_index=True, return_counts=True)
    found = []
    for one, at in zip(branches, first, strict=True):
        if one == 0 or count[branches == one] < _BRANCH_CELLS:
            continue
        i, j = np.unravel_index(int(road.ways.cells[order[at]]), road.grid.shape)
        if along_of[tuple(road.ways.chain((int(i), int(j))).T)].min() > -_BACK_M:
            found.append((int(one), float(along_of[i, j]), float(way[order[at]])))
    return sorted(found, key=lambda one: one[1])


def _choice(
    entrances: list[tuple[int, float, float]], past_m: float | None, how: str
) -> tuple[int | None, float, float]:
    """The branch that is meant."""
    if past_m is None:
        return entrances[0]
    fit = [one for one in entrances if how == "at" or (one[1] > past_m) == (how == "past")]
    return min(fit, key=lambda one: abs(one[1] - past_m)) if fit else (None, 0.0, 0.0)
