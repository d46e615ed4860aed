"""The road about the ego: which way it runs, how far along and beside it a place lies, and which lanes are ours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from appocc.bevmap import ROAD, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from grounding.scene_object import EGO_CENTRE_M

if TYPE_CHECKING:
    from grounding.road.road_map import Road

LANE_M = 3.5
# Our lane is known as a line of points a metre apart, this far behind and ahead of the ego.
_BACK_M, _AHEAD_M = 40.0, 90.0
# Without a map: beyond these distances along the ego's heading a bend is not carried on.
_BENDS_FROM_M, _BENDS_TO_M = -25.0, 45.0
# Courses that are weighed against each other: direction of the road at the ego, and its change for each metre.
_SLANTS_RAD = np.linspace(-0.2, 0.2, 11)
_BENDS_PER_M = np.linspace(-0.018, 0.018, 13)
_USUAL_SLANT_RAD, _USUAL_BEND_PER_M = 0.035, 0.004
# A vehicle that stands along the road is parallel to it within this angle; crossing ones tell nothing.
_PARALLEL_RAD, _BESIDE_ROAD_M = 0.08, 6.0
_ON_LANE = 0.6
_MOST_LANES, _MOST_VOTES_LANES = 3, 7


@dataclass(frozen=True)
class Lanes:
    """Our lane and those beside it, in the ego frame.

    Attributes:
        line_m: (K, 2) points a metre apart on the middle of our lane, in the direction of travel.
        start_m: way along it from the level of the ego's origin to the first point, negative.
        lowest: number of the rightmost lane of our direction; ours is 0, those to the left are positive.
        highest: number of the leftmost one.
        oncoming_left: whether oncoming traffic keeps to our left.
    """

    line_m: FloatArray
    start_m: float
    lowest: int = 0
    highest: int = 0
    oncoming_left: bool = True

    @cached_property
    def _tangents(self) -> FloatArray:
        step = np.gradient(self.line_m, axis=0)
        return np.asarray(step / np.linalg.norm(step, axis=1, keepdims=True))

    def _nearest(self, xy_m: FloatArray) -> IntArray:
        """(N,) numbers of the points of the line nearest to places (N, 2)."""
        return np.asarray(((xy_m[:, None] - self.line_m) ** 2).sum(axis=2).argmin(axis=1), dtype=np.int64)

    def direction_rad(self, xy_m: FloatArray) -> FloatArray:
        """(N,) our direction of travel at the level of places (N, 2)."""
        x, y = self._tangents[self._nearest(xy_m)].T
        return np.asarray(np.arctan2(y, x))

    def along_and_sideways(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Metres along our lane from the ego's origin (N,), and to its left (N,), of places (N, 2)."""
        nearest = self._nearest(xy_m)
        (x, y), (tx, ty) = (xy_m - self.line_m[nearest]).T, self._tangents[nearest].T
        return self.start_m + nearest + x * tx + y * ty, y * tx - x * ty

    def beside(self, along_m: FloatArray, sideways_m: float) -> FloatArray:
        """(N, 2) places some metres to the left of our lane at ways along it (N,)."""
        at = np.rint(along_m - self.start_m).astype(np.int64)
        left = self._tangents[at][:, ::-1] * [-1.0, 1.0]
        return np.asarray(self.line_m[at] + sideways_m * left)


@dataclass(frozen=True)
class Traffic:
    """What vehicles tell of the road, N of them in the ego frame.

    Attributes:
        xy_m: (N, 2) places.
        yaw_rad: (N,) directions of their long axes.
        front_known: (N,) whether that is where they head.
        moving: (N,) whether they certainly move.
        standing: (N,) whether they certainly stand.
    """

    xy_m: FloatArray
    yaw_rad: FloatArray
    front_known: BoolArray
    moving: BoolArray
    standing: BoolArray


def lanes_of(traffic: Traffic, bev: BEVMap | None, road: Road | None) -> Lanes:
    """The lanes that a map and its road show, or, where there is no map, the vehicles."""
    if road is None:
        course = Lanes(_line(*_course(traffic)), -_BACK_M)
    else:
        course = Lanes(*_lengthened(road.own.points_m, road.own.start_m + EGO_CENTRE_M))
    along, sideways = course.along_and_sideways(traffic.xy_m)
    turn = np.cos(traffic.yaw_rad - course.direction_rad(traffic.xy_m))
    with_us, facing = (traffic.front_known & (sign * turn > 0.9) for sign in (1, -1))
    lane = sideways / LANE_M
    # Most countries drive on the right; what heads towards us, above all if it moves, tells where it is not so.
    votes = np.clip(lane, -2, 2) * np.where(traffic.moving, 2, 1) * (facing & (np.abs(lane) < _MOST_VOTES_LANES))
    oncoming_left = bool(votes.sum() > -0.5) if road is None else road.keeps > 0
    near = (along > -15) & (along < 45)
    chosen = (near & with_us & traffic.moving, near & facing & traffic.moving, near & traffic.standing)
    driven, oncoming, parked = (np.round(lane[each]).astype(int) for each in chosen)
    mapped = _mapped_lanes(course, bev)
    right = _own_lanes(-1, mapped, -driven, -oncoming, -parked)
    left = _own_lanes(1, mapped, driven, oncoming, parked)
    if mapped and not len(oncoming):
        # Nobody tells where the other direction begins: it has half of the lanes, if nobody drives there with us.
        half = (left + right + 2) // 2 - 1
        if oncoming_left:
            left = max(half - right, *driven[driven <= left].tolist(), 0)
        else:
            right = max(half - left, *(-driven[-driven <= right]).tolist(), 0)
    return Lanes(course.line_m, course.start_m, -right, left, oncoming_left)


def _lengthened(points_m: FloatArray, start_m: float) -> tuple[FloatArray, float]:
    """A line of points a metre apart, straight on at both ends as far as is needed, and where it begins then."""
    back = max(round(_BACK_M + start_m), 0)
    ahead = max(round(_AHEAD_M - start_m) - len(points_m), 0)
    first, last = points_m[1] - points_m[0], points_m[-1] - points_m[-2]
    before = points_m[0] - np.arange(back, 0, -1)[:, None] * first
    after = points_m[-1] + np.arange(1, ahead + 1)[:, None] * last
    return np.concatenate([before, points_m, after]), start_m - back


def _course(traffic: Traffic) -> tuple[float, float]:
    """Slant and bend of the road: the mean over all courses, each weighed by how many vehicles stand along it."""
    slant, bend = (grid.ravel() for grid in np.meshgrid(_SLANTS_RAD, _BENDS_PER_M))
    score = -0.5 * (slant / _USUAL_SLANT_RAD) ** 2 - 0.5 * (bend / _USUAL_BEND_PER_M) ** 2
    x, y = traffic.xy_m[:, 0], traffic.xy_m[:, 1]
    near = (x > _BENDS_FROM_M) & (x < 70)
    x, y, yaw, weight = x[near], y[near], traffic.yaw_rad[near], np.where(traffic.moving, 2.0, 1.0)[near]
    beside = np.exp(-0.5 * ((y - _aside(slant[:, None], bend[:, None], x)) / _BESIDE_ROAD_M) ** 2)
    angle = slant[:, None] + bend[:, None] * np.clip(x, _BENDS_FROM_M, _BENDS_TO_M)
    off = np.sin(yaw - angle) / _PARALLEL_RAD
    score += (weight * beside * np.exp(-0.5 * off**2)).sum(axis=1)
    share = np.exp(score - score.max())
    share /= share.sum()
    return float(share @ slant), float(share @ bend)


def _aside(slant_rad: FloatArray | float, bend_per_m: FloatArray | float, x_m: FloatArray) -> FloatArray:
    """How far to the left of the ego's origin our lane is, ahead of it by some metres."""
    bent = np.clip(x_m, _BENDS_FROM_M, _BENDS_TO_M)
    return np.asarray(slant_rad * x_m + bend_per_m * bent * (x_m - bent / 2))


def _line(slant_rad: float, bend_per_m: float) -> FloatArray:
    """The line of a course: points a metre of way apart."""
    way = np.arange(-_BACK_M, _AHEAD_M)
    angle = slant_rad + bend_per_m * np.clip(way, _BENDS_FROM_M, _BENDS_TO_M)
    step = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    line = np.cumsum(step, axis=0) - step
    return np.asarray(line - line[round(_BACK_M)])


def _mapped_lanes(course: Lanes, bev: BEVMap | None) -> dict[int, bool]:
    """Whether the map has road at lanes to both sides of ours; empty without a map."""
    if bev is None:
        return {}
    found = {}
    for lane in range(-_MOST_LANES, _MOST_LANES + 1):
        cells = bev.grid.cell_of(course.beside(np.arange(2.0, 26.0, 2.0), lane * LANE_M))
        i, j = cells[bev.grid.contains(cells)].T
        known = bev.occupancy_valid[ROAD][i, j]
        found[lane] = bool(known.any() and bev.on[ROAD][i, j][known].mean() > _ON_LANE)
    return found


def _own_lanes(side: int, mapped: dict[int, bool], driven: IntArray, oncoming: IntArray, parked: IntArray) -> int:
    """How many lanes of our direction lie to a side (1 left, -1 right) of ours; lanes are counted to that side."""
    count = 0
    for lane in range(1, _MOST_LANES + 1):
        if lane in oncoming or (mapped and not mapped[side * lane]):
            break
        if lane in driven or (mapped and lane not in parked):
            count = lane
        elif lane in parked:
            break
    return count
