"""Markings across lanes and at junctions: stop lines, zebra crossings, arrows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from appocc.checks import FloatArray
from appocc.polylines import directions_at, length_m, points_at
from appocc.simulation.ground.road_segments import STOP_WIDTH_M, ZEBRA_GAP_M, ZEBRA_M, RoadSegment
from appocc.simulation.network import Connection, Lane

STRIPE_M = 0.5
# Distance from the stop line to the tips of the last arrow and of the one before.
_ARROWS_M = (3.0, 22.0)
_ARROW_LONG_M = 5.0
# Half outlines in metres, tip at (0, 0); x to the right, y ahead.
_SHAFT = 0.09


def stop_lines(segments: Sequence[RoadSegment], signal: bool | None = None) -> list[FloatArray]:
    """Return the outlines (4, 2) of the stop lines, each across the car lanes that arrive at a junction.

    Args:
        segments: road segments.
        signal: only those at traffic lights, or only the others; None: all.
    """
    lines = []
    for segment in segments:
        if signal is not None and segment.end.signal != signal:
            continue
        driving = [k for k, lane in enumerate(segment.lanes) if lane.kind == "driving"]
        if not segment.end.has_stop or not driving or length_m(segment.left_m) < 8.0:
            continue
        offsets = _offsets(segment)
        near, far = -segment.end.stop_m, -segment.end.stop_m - STOP_WIDTH_M
        lines.append(
            _rectangle_at(segment, True, (near, far), (offsets[driving[-1]][0] + 0.15, offsets[driving[0]][1]))
        )
    return lines


def zebras(segments: Sequence[RoadSegment]) -> list[FloatArray]:
    """Return the outlines (4, 2) of the stripes of all zebra crossings; the stripes run along the street."""
    return [
        _rectangle_at(segment, at_end, reach, (left, left + STRIPE_M))
        for segment, at_end, reach in _zebra_ends(segments)
        for left in np.arange(STRIPE_M / 2, segment.width_m - STRIPE_M * 0.9, 2 * STRIPE_M)
    ]


def zebra_areas(segments: Sequence[RoadSegment]) -> list[FloatArray]:
    """Return the outlines (4, 2) of all zebra crossings, each over the width of a segment."""
    return [
        _rectangle_at(segment, at_end, reach, (0.0, segment.width_m))
        for segment, at_end, reach in _zebra_ends(segments)
    ]


def _zebra_ends(segments: Sequence[RoadSegment]) -> Iterator[tuple[RoadSegment, bool, tuple[float, float]]]:
    """Yield the ends of segments with a zebra crossing, and its near and far side ahead of the cross-section."""
    for segment in segments:
        for at_end, end in ((False, segment.start), (True, segment.end)):
            if end.zebra:
                sign = -1.0 if at_end else 1.0
                yield segment, at_end, (sign * ZEBRA_GAP_M, sign * (ZEBRA_GAP_M + ZEBRA_M))


def _offsets(segment: RoadSegment) -> list[tuple[float, float]]:
    """Return start and end of each lane, from right to left, as distances to the right of the left border."""
    widths = np.array([lane.width_m for lane in segment.lanes])
    begins = np.cumsum(widths[::-1])[::-1] - widths
    return [(float(b), float(b + w)) for b, w in zip(begins, widths, strict=True)]


def _rectangle_at(
    segment: RoadSegment, at_end: bool, ahead_m: tuple[float, float], right_m: tuple[float, float]
) -> FloatArray:
    """Return a (4, 2) rectangle at an end of a segment, from its cross-section ahead and from its left border."""
    point, heading = segment.section(at_end)
    right = np.array([heading[1], -heading[0]])
    corners = [(0, 0), (0, 1), (1, 1), (1, 0)]
    return np.stack([point + heading * ahead_m[i] + right * right_m[j] for i, j in corners])


def arrows(segments: Sequence[RoadSegment], connections: Sequence[Connection]) -> list[FloatArray]:
    """Return the outlines of the arrows at signalled junctions."""
    ways: dict[str, set[str]] = defaultdict(set)
    for link in connections:
        ways[link.from_lane].add({"R": "r", "L": "l"}.get(link.direction, link.direction))
    areas = []
    for segment in segments:
        if segment.end.signal and len(segment.driving) > 1:
            for lane in segment.driving:
                areas += _lane_arrows(segment, lane, ways[lane.name] - {"t"})
    return areas


def _lane_arrows(segment: RoadSegment, lane: Lane, directions: set[str]) -> list[FloatArray]:
    point, heading = segment.section(True)
    length = length_m(lane.centre_m)
    stop = length - segment.end.stop_m - STOP_WIDTH_M - float((lane.centre_m[-1] - point) @ heading)
    areas = []
    for back in _ARROWS_M:
        tip = stop - back
        if tip < 2 * _ARROW_LONG_M:
            continue
        place = np.array([tip - _ARROW_LONG_M])
        origin, ahead = points_at(lane.centre_m, place)[0], directions_at(lane.centre_m, place)[0]
        frame = np.stack([[ahead[1], -ahead[0]], ahead])
        areas += [area @ frame + origin for area in arrow_areas(directions)]
    return areas


def arrow_areas(directions: set[str]) -> list[FloatArray]:
    """Return the areas of an arrow for any of s, l, r: x to the right, y ahead, from (0, 0) to (0, 5)."""
    areas = []
    bend = 3.1 if "s" in directions else 4.1
    if "s" in directions:
        areas.append(_box(-_SHAFT, _SHAFT, 0.0, 3.6))
        areas.append(np.array([[-0.32, 3.6], [0.32, 3.6], [0.0, _ARROW_LONG_M]]))
    elif directions:
        areas.append(_box(-_SHAFT, _SHAFT, 0.0, bend))
    for sign in [s for name, s in (("l", -1.0), ("r", 1.0)) if name in directions]:
        areas.append(
            np.array([[0.0, bend - 0.7], [0.0, bend - 0.3], [0.55, bend + 0.15], [0.55, bend - 0.2]]) * [sign, 1]
        )
        areas.append(np.array([[0.45, bend - 0.75], [0.45, bend + 0.65], [1.05, bend + 0.1]]) * [sign, 1])
    return areas


def _box(left: float, right: float, low: float, high: float) -> FloatArray:
    return np.array([[left, low], [right, low], [right, high], [left, high]])
