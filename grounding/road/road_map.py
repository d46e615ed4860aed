"""The road around the ego, once for a scene: where it may stand, where it can get to, and which way the road runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from scipy import ndimage

from appocc.bevmap import LANE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EGO_WIDTH_M
from appocc.geometry import wrap_angle
from appocc.grid import BEVGrid
from grounding.road.centreline import Course, Tracer
from grounding.road.free_space import OFF_ROAD, TAKEN, UNKNOWN, Footing
from grounding.road.orientation import SHORTEST_M, axes
from grounding.road.routing import Ways, ways_from
from grounding.scene_object import EGO_CENTRE_M, SceneObject

# The ego's own middle may lie on a cell that is not free, on a kerb that a network misplaced for example.
_START_M = 6.0
# A predicted map has holes in the road that are none; ways lead over so many cells of them.
_HOLE_CELLS = 6
# Over so many steps a way shows its direction. It crosses the road's axis, goes back, and the axis is still the same
# one, by the cosines of the angles between them.
_STEPS = 8
_CROSSING, _BACKWARD, _STEADY = 0.6, 0.5, 0.5
# The direction of travel is what most ways say over some metres.
_AROUND_M = 2.5
_WIDEST_M = 16.0
# One that comes towards us says as much of the side on which one drives as so many that stand.
_MOVING_VOTES = 3.0
# A road as narrow as this is driven in its middle.
_ONE_LANE_M = 5.5
# A metre on the narrowest way, and one out of our own lane, count for so much more when ways are compared.
_NARROW, _WIDE_M, _OFF_LANE, _LANE_M = 0.8, 1.6, 0.3, 3.0
# A road is our own up to so far beside our lane, where it runs on with it (cosine of the angle between both).
_BESIDE_M, _PARALLEL = 12.0, 0.7
_EGO = np.array([EGO_CENTRE_M, 0.0])


@dataclass(frozen=True)
class Road:
    """What a map says about driving; arrays (X, Y) of its grid, ego frame.

    Attributes:
        grid: cells.
        footing: where the ego's footprint may stand.
        tracer: lays lines along lanes; it holds the axis of the road everywhere.
        direction_rad: direction of travel of one who came the best way from the ego; behind the ego, its own.
        sure: 0..1, how well edges, markings and vehicles agree on the road's axis; low in junctions.
        road: what is road, vehicles on it or not; small holes of predicted maps are filled.
        ways: best ways from the ego.
        own: the line on which the ego's own lane goes on; metres along count from the ego's middle.
        keeps: 1 where one drives on the right, -1 on the left.
    """

    grid: BEVGrid
    footing: Footing
    tracer: Tracer
    direction_rad: FloatArray
    sure: FloatArray
    road: BoolArray
    ways: Ways
    own: Course
    keeps: int

    @classmethod
    def of(cls, bev: BEVMap, objects: Sequence[SceneObject]) -> Road:
        """The road of a map with vehicles on it."""
        grid, footing = bev.grid, Footing.of(bev, objects)
        inner = footing.inner
        road = (inner & (OFF_ROAD | UNKNOWN)) == 0
        if not ((bev.occupancy == 0) | (bev.occupancy == 1)).all():
            road = _without_holes(road)
        axis, sure = axes(grid, road, (inner & UNKNOWN) == 0, bev.on[LANE], objects)
        tracer = Tracer(grid, axis, sure, _clearance(grid, road), _clearance(grid, ~bev.on[LANE]))
        own = tracer.course(_EGO, 0.0)
        clearance = _clearance(grid, road & ((inner & TAKEN) == 0))
        free = clearance > EGO_WIDTH_M / 2
        dislike = _NARROW * np.clip((_WIDE_M - clearance) / _WIDE_M, 0.0, 1.0)
        dislike += _OFF_LANE * (np.abs(own.coordinates[1]) > _LANE_M / 2)
        ways = ways_from(grid, free, dislike, _start(grid, free))
        made = cls(grid, footing, tracer, _directions(ways, axis), sure, road, ways, own, 1)
        return replace(made, keeps=made._side_of_traffic())

    def to_edge(self, cells: IntArray, angle_rad: FloatArray, most_m: float = _WIDEST_M) -> FloatArray:
        """Metres (N,) from cells (N, 2) in directions (N,) to where the road ends; vehicles do not end it."""
        steps = np.arange(1, int(most_m / self.grid.cell_m * 2) + 1) / 2
        unit = np.exp(1j * angle_rad)[:, None]
        i = np.rint(cells[:, :1] + steps * unit.real).astype(np.int64)
        j = np.rint(cells[:, 1:] + steps * unit.imag).astype(np.int64)
        x, y = self.grid.shape
        on = (i >= 0) & (i < x) & (j >= 0) & (j < y)
        on &= self.road[np.clip(i, 0, x - 1), np.clip(j, 0, y - 1)]
        on &= self.road[cells[:, 0], cells[:, 1]][:, None]
        return np.asarray(np.logical_and.accumulate(on, axis=1).sum(axis=1) * self.grid.cell_m / 2)

    def headings(self, cells: IntArray, like_rad: FloatArray, weight: float = 0.5) -> FloatArray:
        """Headings (N,) in cells (N, 2) along the road, as sure as it is, and like others (N,) by a weight."""
        i, j = cells.T
        both = self.sure[i, j] * np.exp(2j * self.tracer.axis_rad[i, j]) + weight * np.exp(2j * like_rad)
        return np.asarray(wrap_angle(like_rad + wrap_angle(np.angle(both) - 2 * like_rad) / 2))

    def off_lane(self, cells: IntArray, heading_rad: FloatArray) -> FloatArray:
        """Metres (N,) of cells (N, 2) from the middle of the half of the road that is ours at headings (N,)."""
        left, right = (self.to_edge(cells, heading_rad + turn, most_m=12.0) for turn in (np.pi / 2, -np.pi / 2))
        wanted = np.where(left + right > _ONE_LANE_M, np.clip((left + right) / 4, 1.7, 4.0), (left + right) / 2)
        return (right if self.keeps > 0 else left) - wanted

    def _side_of_traffic(self) -> int:
        """1 for the right, -1 for the left: the right unless one or several that face us plainly keep to it."""
        votes = 0.0
        for item in self.footing.objects:
            along, aside = self.own.place_of(item.centre_m)
            told = item.front_known and item.length_m >= SHORTEST_M
            if told and 0 < along < self.own.end_m and 2 < abs(aside) < 12:
                faces_us = np.cos(item.yaw_rad - self.own.heading_rad(np.array(along))) < -0.8
                votes += np.sign(aside) * faces_us * (_MOVING_VOTES if (item.speed_mps or 0.0) > 1 else 1.0)
        return -1 if votes <= -_MOVING_VOTES else 1

    def nearest(self, xy_m: FloatArray) -> tuple[int, int]:
        """The cell that can be reached nearest to a point (2,); the point's own where none can be."""
        return self._nearest_of(self._reached, xy_m)

    @cached_property
    def _reached(self) -> IntArray:
        return np.stack(np.unravel_index(self.ways.cells, self.grid.shape), axis=-1)

    @cached_property
    def _on_road(self) -> IntArray:
        return np.argwhere(self.road)

    def _nearest_of(self, cells: IntArray, xy_m: FloatArray) -> tuple[int, int]:
        at = np.clip(self.grid.cell_of(xy_m), 0, np.array(self.grid.shape) - 1)
        best = cells[np.argmin(((cells - at) ** 2).sum(axis=1))] if len(cells) else at
        return int(best[0]), int(best[1])

    def on_road(self, xy_m: FloatArray) -> tuple[int, int]:
        """The cell of the road nearest to a point (2,); the point's own where there is no road."""
        return self._nearest_of(self._on_road, xy_m)

    def direction_at(self, xy_m: FloatArray) -> float:
        """Our direction of travel along the road's axis at a point (2,), radians."""
        i, j = np.clip(self.grid.cell_of(xy_m), 0, np.array(self.grid.shape) - 1).tolist()
        axis_rad = float(self.tracer.axis_rad[i, j])
        along, aside = self.own.place_of(xy_m)
        if self.own.start_m < along < self.own.end_m and abs(aside) < _BESIDE_M:
            # Round what blocks a road one comes back to it from beyond: beside our lane, that tells the direction.
            ours_rad = float(self.own.heading_rad(np.array(along)))
            if abs(np.cos(axis_rad - ours_rad)) > _PARALLEL:
                return agreeing(axis_rad, ours_rad)
        return agreeing(axis_rad, self.direction_rad[self.nearest(xy_m)])


def agreeing(axis_rad: float, with_rad: float) -> float:
    """The one of both directions of an axis that is nearer to another direction."""
    turned = float(wrap_angle(axis_rad))
    return turned if np.cos(turned - with_rad) >= 0 else float(wrap_angle(turned + np.pi))


def _without_holes(road: BoolArray) -> BoolArray:
    """Road with small holes filled."""
    label, count = ndimage.label(~road)
    size = np.bincount(label.ravel(), minlength=count + 1)
    return np.asarray(road | (size <= _HOLE_CELLS)[label])


def _clearance(grid: BEVGrid, open_: BoolArray) -> FloatArray:
    """Distance (X, Y) from cells to the nearest that is not open or not on the map, metres."""
    far = cv2.distanceTransform(np.pad(open_.astype(np.uint8), 1), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return far[1:-1, 1:-1].astype(np.float64) * grid.cell_m


def _start(grid: BEVGrid, free: BoolArray) -> tuple[int, int] | None:
    """The free cell nearest to the ego's middle, None where none is near."""
    cells = np.argwhere(free)
    far = np.hypot(*(grid.centre_of(cells) - _EGO).T)
    if not len(cells) or far.min() > _START_M:
        return None
    i, j = cells[np.argmin(far)].tolist()
    return i, j


def _directions(ways: Ways, axis: FloatArray) -> FloatArray:
    """Direction of travel (X, Y): of both along the axis the one in which the best way comes along.

    Ways that go back from the ego are reversed: the ego would come from there. Where a way crosses the axis, as when
    it changes lanes, the direction goes on from some steps before.
    """
    back = ways.before(_STEPS)
    direction = np.asarray(wrap_angle(axis)).copy()  # in the ego's own heading where no way leads
    unit = np.exp(1j * axis.ravel()[ways.cells])
    xy = ways.grid.centre_of(np.stack(np.unravel_index(ways.cells, axis.shape), axis=-1))
    way = (xy - xy[back]) @ [1, 1j]
    way /= np.maximum(np.abs(way), 1e-9)
    along, with_before = (unit * np.conj(way)).real, (unit * np.conj(unit[back])).real
    ranks = _ranks(back)
    comes = np.ones(len(back), np.bool_)  # and is not gone back from
    sign = np.where(unit.real >= 0, 1.0, -1.0)
    for rank, cells in enumerate(ranks[1:]):
        ahead = way[cells].real > -_BACKWARD if rank == 0 else comes[back[cells]]
        comes[cells] = ahead | (xy[cells, 0] > xy[ranks[0][0], 0])
        onward = np.sign(along[cells]) * np.where(comes[cells], 1.0, -1.0)
        crosses = (np.abs(along[cells]) < _CROSSING) & (np.abs(with_before[cells]) > _STEADY)
        sign[cells] = np.where(crosses, np.sign(with_before[cells]) * sign[back[cells]], onward)
    # Round a vehicle one comes back into the corner before it: the neighbourhood knows better.
    votes = np.zeros((*axis.shape, 2), np.float32)
    votes.reshape(-1, 2)[ways.cells] = np.stack([unit.real * sign, unit.imag * sign], axis=-1)
    around = cv2.GaussianBlur(votes, (0, 0), _AROUND_M / ways.grid.cell_m).reshape(-1, 2)[ways.cells]
    agrees = around[:, 0] * unit.real + around[:, 1] * unit.imag >= 0
    direction.ravel()[ways.cells] = np.angle(np.where(agrees, unit, -unit))
    return direction


def _ranks(back: IntArray) -> list[IntArray]:
    """Which cells are none, one, two, ... leaps back from the start."""
    rank = (back != np.arange(len(back))).astype(np.int64)
    while (rank[back] > 0).any():
        rank, back = rank + rank[back], back[back]
    order = np.argsort(rank, kind="stable")
    return np.split(order, np.cumsum(np.bincount(rank))[:-1]) if len(order) else []
