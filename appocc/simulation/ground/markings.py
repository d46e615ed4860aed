"""Painted lines along the streets, derived from the lanes: SUMO networks hold none."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from appocc.checks import FloatArray, IntArray
from appocc.polylines import clean, cut, dashes, directions_at, length_m, points_at, shifted
from appocc.simulation.ground.road_segments import RoadSegment
from appocc.simulation.surface import Surface

LINE_WIDTH_M = 0.15
DASH_M, DASH_GAP_M = 3.0, 5.0
# Length of the solid line before a junction, where lane changes are prohibited.
SOLID_M = 20.0
# Spacing of the two lines of a double line, and distance from a lane's edge to its edge line, centre to centre.
DOUBLE_M, EDGE_M = 0.30, 0.20
# Two directions share a carriageway if their borders are at most this far apart.
_TOGETHER_M = 0.9
_SAMPLE_M = 0.5
_NEIGHBOURS = 10
_SHORTEST_M = 1.0
_NEAR_END_M = 30.0


@dataclass(frozen=True, eq=False)
class MarkingLine:
    """A painted line; each dash is a separate line.

    Attributes:
        points_m: (N, 2) its centre line.
        surface: LINE_WHITE or LINE_YELLOW.
        between: whether it separates the two directions of a street.
    """

    points_m: FloatArray
    surface: Surface
    between: bool


@dataclass(frozen=True)
class MarkingStyle:
    """Marking style of a town.

    Attributes:
        centre: colour of the lines between the directions.
        double_on_small: whether two-lane streets have a double centre line instead of dashes.
        small_edges: whether two-lane streets have edge lines.
    """

    centre: Surface
    double_on_small: bool
    small_edges: bool

    @classmethod
    def draw(cls, seed: int) -> MarkingStyle:
        """Draw the marking style of a town by its seed."""
        draw = np.random.default_rng([seed, 51]).random(3)
        return cls(Surface.LINE_YELLOW if draw[0] < 0.6 else Surface.LINE_WHITE, draw[1] < 0.25, draw[2] < 0.3)


def marking_lines(segments: Sequence[RoadSegment], style: MarkingStyle) -> list[MarkingLine]:
    """Return all lines along the streets."""
    lines = []
    for segment in segments:
        lines += _between_lanes(segment)
        lines += _right_edge(segment, style)
    return lines + _left_borders(segments, style)


def _between_lanes(segment: RoadSegment) -> list[MarkingLine]:
    lines = []
    for right, left in zip(segment.lanes, segment.lanes[1:], strict=False):
        if "driving" not in (right.kind, left.kind):
            continue
        border = shifted(right.centre_m, right.width_m / 2)
        if right.kind == left.kind:
            lines += _white_lines(lane_line(border, segment))
        else:
            lines += _white_lines(
                [_trim(border, segment, segment.start.clear_leaving_m, segment.end.clear_arriving_m)]
            )
    return lines


def lane_line(border_m: FloatArray, segment: RoadSegment) -> list[FloatArray]:
    """Return the dashes, and the solid part before a junction, along a border between lanes of one direction."""
    line = _trim(border_m, segment, segment.start.clear_leaving_m, segment.end.clear_arriving_m)
    if len(line) < 2:
        return []
    solid = SOLID_M if segment.end.junction else 0.0
    length = length_m(line)
    broken = cut(line, 0.0, length - solid)
    pieces = dashes(broken, DASH_M, DASH_GAP_M) if len(broken) else []
    return [*pieces, cut(line, length - solid, length)] if solid else pieces


def _right_edge(segment: RoadSegment, style: MarkingStyle) -> list[MarkingLine]:
    """Return the right edge line; lanes next to parked cars or bicycles have none."""
    outer = segment.lanes[0]
    if outer.kind != "driving" or not (segment.arterial or style.small_edges):
        return []
    line = shifted(outer.centre_m, EDGE_M - outer.width_m / 2)
    return _white_lines([_trim(line, segment, segment.start.clear_leaving_m, segment.end.clear_arriving_m)])


def _left_borders(segments: Sequence[RoadSegment], style: MarkingStyle) -> list[MarkingLine]:
    """Return the lines between the directions, and the left edge lines of medians and one-way streets."""
    borders = [clean(segment.left_m) for segment in segments]
    along = [np.arange(_SAMPLE_M / 2, max(length_m(b), _SAMPLE_M), _SAMPLE_M) for b in borders]
    partners = _adjacent_borders(borders, along)
    lines: list[MarkingLine] = []
    for number, segment in enumerate(segments):
        if segment.lanes[-1].kind != "driving":
            continue
        for start, end, other in _runs(partners[number], along[number], length_m(borders[number])):
            piece = cut(borders[number], start, end)
            if other < 0:
                lines += _left_edge(piece, segment, style)
            elif number < other:
                lines += _divider(_move_halfway(piece, borders[other]), segment, segments[other], style)
    return lines


def _adjacent_borders(borders: Sequence[FloatArray], along_m: Sequence[FloatArray]) -> list[IntArray]:
    """Return, per sample along each border, the index of the adjacent opposite border; -1 if there is none."""
    points = np.concatenate([points_at(b, s) for b, s in zip(borders, along_m, strict=True)])
    headings = np.concatenate([directions_at(b, s) for b, s in zip(borders, along_m, strict=True)])
    counts = [len(s) for s in along_m]
    owner = np.repeat(np.arange(len(borders)), counts)
    _, near = cKDTree(points).query(points, _NEIGHBOURS, distance_upper_bound=_TOGETHER_M)
    found = near < len(points)
    near = np.where(found, near, 0)
    facing = found & (np.einsum("ik,ijk->ij", headings, headings[near]) < -0.8)
    partner = np.where(facing, owner[near], len(borders)).min(axis=1)
    partner[partner == len(borders)] = -1
    return np.split(partner, np.cumsum(counts)[:-1])


def _runs(partner: IntArray, along_m: FloatArray, length: float) -> list[tuple[float, float, int]]:
    """Return runs of samples with the same partner; the first and the last reach the ends of the border."""
    changes = np.flatnonzero(np.diff(partner)) + 1
    bounds = [0.0, *(along_m[changes] - _SAMPLE_M / 2), length]
    partners = partner[[0, *changes]]
    return [
        (float(a), float(b), int(p))
        for a, b, p in zip(bounds, bounds[1:], partners, strict=False)
        if b - a > _SHORTEST_M
    ]


def _move_halfway(line_m: FloatArray, other_m: FloatArray) -> FloatArray:
    """Move a line halfway towards a parallel one nearby."""
    if len(line_m) < 2:
        return line_m
    fine = points_at(other_m, np.arange(0.0, length_m(other_m) + 0.05, 0.1))
    return np.asarray((line_m + fine[cKDTree(fine).query(line_m)[1]]) / 2)


def _divider(
    middle_m: FloatArray, segment: RoadSegment, other: RoadSegment, style: MarkingStyle
) -> list[MarkingLine]:
    """Return the line between two directions: double on main streets, else dashed."""
    start_m = max(segment.start.clear_leaving_m, other.end.clear_arriving_m)
    line = _trim(middle_m, segment, start_m, max(segment.end.clear_arriving_m, other.start.clear_leaving_m))
    if len(line) < 2:
        return []
    if segment.arterial or other.arterial or style.double_on_small:
        pieces = [shifted(line, DOUBLE_M / 2), shifted(line, -DOUBLE_M / 2)]
    else:
        pieces = _dashed_between_junctions(line, segment)
    return [MarkingLine(piece, style.centre, True) for piece in pieces if len(piece) > 1]


def _dashed_between_junctions(line_m: FloatArray, segment: RoadSegment) -> list[FloatArray]:
    """Return dashes with a solid part near the junctions."""
    length = length_m(line_m)
    first = SOLID_M / 2 if segment.start.junction and length > 3 * SOLID_M else 0.0
    last = SOLID_M / 2 if segment.end.junction and length > 3 * SOLID_M else 0.0
    broken = cut(line_m, first, length - last)
    pieces = [cut(line_m, 0.0, first), *dashes(broken, DASH_M, DASH_GAP_M), cut(line_m, length - last, length)]
    return [piece for piece in pieces if len(piece) > 1]


def _left_edge(border_m: FloatArray, segment: RoadSegment, style: MarkingStyle) -> list[MarkingLine]:
    if not segment.arterial or len(border_m) < 2:
        return []
    line = shifted(border_m, -EDGE_M)
    line = _trim(line, segment, segment.start.clear_leaving_m, segment.end.clear_arriving_m)
    return [MarkingLine(line, style.centre, False)] if len(line) > 1 else []


def _white_lines(lines_m: Iterable[FloatArray]) -> list[MarkingLine]:
    return [MarkingLine(line, Surface.LINE_WHITE, False) for line in lines_m if len(line) > 1]


def _trim(line_m: FloatArray, segment: RoadSegment, start_m: float, end_m: float) -> FloatArray:
    """Cut off the parts of a line closer to the junctions than `start_m` and `end_m`, measured along the street."""
    if len(line_m) < 2:
        return line_m
    first, last = 0.0, length_m(line_m)
    # Nothing is cut from a piece in the middle of a street, far from its ends.
    if segment.start.junction:
        point, heading = segment.section(False)
        first = start_m - float((line_m[0] - point) @ heading)
        first = first if np.hypot(*(line_m[0] - point)) < _NEAR_END_M else 0.0
    if segment.end.junction:
        point, heading = segment.section(True)
        short = end_m + float((line_m[-1] - point) @ heading)
        last -= short if np.hypot(*(line_m[-1] - point)) < _NEAR_END_M else 0.0
    return cut(line_m, max(first, 0.0), min(last, length_m(line_m)))
