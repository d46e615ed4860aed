"""True streets of a simulated town: lanes with their direction, junctions, crossings and car parks.

They come from the plan of the town, not from its maps, so that they share nothing with what is audited with them.
World frame of the dataset: its origin is the lower corner of the town's ground.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.simulation.builtin import load_builtin
from appocc.simulation.ground.areas import empty_canvas, has_cars
from appocc.simulation.ground.crossings import stop_lines
from appocc.simulation.ground.road_segments import ZEBRA_GAP_M, ZEBRA_M, RoadSegment, find_road_segments
from appocc.simulation.network import Lane

# A point this far from the border of a lane is still in it.
_BORDER_M = 0.2
# Least cosine between a heading and a lane that has its direction.
_SAME_WAY = 0.3


class _Strip(NamedTuple):
    """A piece of a lane: its ends (2,), its unit direction (2,), length and half width."""

    start_m: FloatArray
    along: FloatArray
    length_m: float
    half_m: float
    edge: str


class Streets:
    """The streets of a built-in town."""

    def __init__(self, name: str) -> None:
        """Read the plan of a town.

        Raises:
            NotFoundError: if the town is unknown.
        """
        plan, _ = load_builtin(name)
        low, network = empty_canvas(plan).low_m, plan.network
        lanes = [lane for edge in network.edges if has_cars(edge) for lane in edge.lanes]
        self._strips = _strips([lane for lane in lanes if lane.kind in ("driving", "parking")], low)
        segments = find_road_segments(network)
        ends = {s.lanes[0].edge: s for s in segments}
        real = {
            name
            for edge in network.edges
            if edge.name in ends
            for name, end in ((edge.from_junction, ends[edge.name].start), (edge.to_junction, ends[edge.name].end))
            if end.junction
        }
        self.junctions = [j.outline_m - low for j in network.junctions if j.name in real and len(j.outline_m) > 2]
        self.crossings = [zebra - low for segment in segments for zebra in _zebras(segment)]
        self.stop_lines = [line - low for line in stop_lines(segments)]
        self.car_parks = [park.outline_m - low for park in plan.car_parks]

    def way(self, xy_m: FloatArray, heading_rad: float) -> int:
        """Return 1 if a lane at a point (2,) has the direction of a heading, -1 if all there oppose it, 0 for none.

        Junctions and car parks have no direction.
        """
        if self.is_in(self.junctions, xy_m[None]) or self.is_in(self.car_parks, xy_m[None]):
            return 0
        cosines = [float(s.along @ [np.cos(heading_rad), np.sin(heading_rad)]) for s in self._at(xy_m)]
        if not cosines or min(abs(each) for each in cosines) < _SAME_WAY:
            return 0
        return 1 if max(cosines) > 0 else -1

    def _at(self, xy_m: FloatArray) -> list[_Strip]:
        found = []
        for s in self._strips:
            x, y = xy_m - s.start_m
            along, across = x * s.along[0] + y * s.along[1], y * s.along[0] - x * s.along[1]
            if -_BORDER_M <= along <= s.length_m + _BORDER_M and abs(across) <= s.half_m + _BORDER_M:
                found.append(s)
        return found

    @staticmethod
    def is_in(areas: list[FloatArray], points_m: FloatArray) -> bool:
        """Return whether any of some points (K, 2) lies in one of some outlines (N, 2)."""
        return any(bool(_inside(outline, points_m).any()) for outline in areas)


def _strips(lanes: list[Lane], low_m: FloatArray) -> list[_Strip]:
    found = []
    for lane in lanes:
        points = lane.centre_m - low_m
        for a, b in pairwise(points):
            length = float(np.hypot(*(b - a)))
            if length > 0:
                found.append(_Strip(a, (b - a) / length, length, lane.width_m / 2, lane.edge))
    return found


def _zebras(segment: RoadSegment) -> list[FloatArray]:
    """Return the outlines (4, 2) of the crossings at both ends of a segment, each over its whole width."""
    found = []
    for at_end, end in ((False, segment.start), (True, segment.end)):
        if end.zebra:
            point, out = segment.section(at_end)
            ahead = (-1.0 if at_end else 1.0) * out
            right = np.array([out[1], -out[0]]) * segment.width_m
            near, far = point + ahead * ZEBRA_GAP_M, point + ahead * (ZEBRA_GAP_M + ZEBRA_M)
            found.append(np.stack([near, near + right, far + right, far]))
    return found


def _inside(outline_m: FloatArray, points_m: FloatArray) -> BoolArray:
    """Return whether points (K, 2) are in an outline (N, 2), by the number of its sides on one side of them."""
    a, b = outline_m, np.roll(outline_m, -1, axis=0)
    x, y = points_m[:, None, 0], points_m[:, None, 1]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    return np.asarray((spans & (x < a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0]))).sum(axis=1) % 2 == 1)
