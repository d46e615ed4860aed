"""Wear of the asphalt: tone, oil, patches, seams, cracks, manhole covers, joints."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from appocc.checks import FloatArray
from appocc.polylines import clean, cut, directions_at, length_m, points_at, shifted, strip
from appocc.simulation.ground.areas import lane_areas
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.land import Lot
from appocc.simulation.ground.land_styles import find_land_style
from appocc.simulation.ground.road_segments import RoadSegment, street_name
from appocc.simulation.network import Lane
from appocc.simulation.plan import TownPlan

# Channels of the wear canvas: grey level of the asphalt, and its shade (below neutral darker, above lighter).
TONE, SHADE = 0, 1
NEUTRAL = 128
_JUNCTION_TONE = 86
_TONES = (70, 108)
# Nested strips of a lane: half width in metres and change of shade.
_OIL = ((0.9, -2), (0.6, -3), (0.35, -4))
_TRACKS_M, _TRACK_HALF_M, _TRACK = 0.85, 0.22, -3
_GUTTER_M, _GUTTER = 0.45, -7
_JOINT_M = 0.1
_HEDGE_M, _HEDGE = 0.35, -16


def draw_wear(canvas: Canvas, plan: TownPlan, segments: Sequence[RoadSegment], lots: Sequence[Lot]) -> None:
    """Draw tone and shade of streets and lots; `canvas` has the two channels."""
    pavement_m = find_land_style(plan.style).pavement_m
    _draw_lots(canvas, lots)
    _draw_tones(canvas, plan, segments)
    lanes = [lane for segment in segments for lane in segment.driving]
    inner = [lane for lane in plan.network.inner_lanes if lane.kind == "driving"]
    _draw_lane_wear(canvas, lanes, inner)
    canvas.add((strip(_right_border(s, 0.0), _GUTTER_M, 0.0) for s in segments), _GUTTER, SHADE)
    random = np.random.default_rng([plan.seed, 53])
    for segment in segments:
        _draw_repairs(canvas, segment, random)
        _draw_pavement_joints(canvas, segment, pavement_m)
    _draw_car_park_wear(canvas, plan, random)


def _draw_lots(canvas: Canvas, lots: Sequence[Lot]) -> None:
    """Give each lot its own brightness, with a hedge or a wall between neighbours."""
    for lot in lots:
        canvas.fill([lot.outline_m], NEUTRAL + lot.shade, SHADE)
        canvas.fill([strip(lot.outline_m[1:], _HEDGE_M / 2, -_HEDGE_M / 2)], NEUTRAL + lot.shade + _HEDGE, SHADE)
        if len(lot.driveway_m):
            canvas.fill([lot.driveway_m], NEUTRAL - lot.shade, SHADE)


def _draw_tones(canvas: Canvas, plan: TownPlan, segments: Sequence[RoadSegment]) -> None:
    random = np.random.default_rng([plan.seed, 54])
    streets = sorted({segment.street for segment in segments})
    tone = dict(zip(streets, random.integers(*_TONES, len(streets)).tolist(), strict=True))
    around: dict[str, list[int]] = defaultdict(list)
    for edge in plan.network.edges:
        for junction in (edge.from_junction, edge.to_junction):
            around[junction].append(tone.get(street_name(edge), _JUNCTION_TONE))
    for place in plan.network.junctions:
        if len(place.outline_m) > 2:
            own = around.get(place.name, [_JUNCTION_TONE])
            _fill_asphalt(canvas, [place.outline_m], sum(own) // len(own) + int(random.integers(-5, 6)))
    for segment in segments:
        for lane in segment.lanes:
            lighter = int(random.integers(-2, 3)) + (4 if lane.kind == "parking" else 0)
            _fill_asphalt(canvas, [lane_areas(lane)], tone[segment.street] + lighter)


def _fill_asphalt(canvas: Canvas, areas_m: Iterable[FloatArray], tone: int) -> None:
    areas = list(areas_m)
    canvas.fill(areas, tone, TONE)
    canvas.fill(areas, NEUTRAL, SHADE)


def _draw_lane_wear(canvas: Canvas, lanes: Sequence[Lane], inner: Sequence[Lane]) -> None:
    """Draw oil along the middle of the lanes, and tyre tracks."""
    lines = [clean(lane.centre_m) for lane in (*lanes, *inner)]
    for half, change in _OIL:
        canvas.add((strip(line, half, -half) for line in lines), change, SHADE)
    for lane in lanes:
        line = clean(lane.centre_m)
        for side in (-_TRACKS_M, _TRACKS_M):
            canvas.add([strip(line, side + _TRACK_HALF_M, side - _TRACK_HALF_M)], _TRACK, SHADE)


def _right_border(segment: RoadSegment, beyond_m: float) -> FloatArray:
    """Return the right border of a segment, moved outwards."""
    outer = segment.lanes[0]
    return shifted(outer.centre_m, -outer.width_m / 2 - beyond_m)


def _draw_repairs(canvas: Canvas, segment: RoadSegment, random: np.random.Generator) -> None:
    """Draw patches with tar edges, seams along the street, cracks across it, and manhole covers."""
    length = length_m(segment.left_m)
    if length < 5.0 or not segment.driving:
        return
    count = random.poisson(length * np.array([1 / 55, 1 / 60, 1 / 14, 1 / 38])).tolist()
    for _ in range(count[0]):
        patch = _patch(segment, random, length)
        canvas.add([strip(np.concatenate([patch, patch[:1]]), 0.05, -0.05)], -16, SHADE)
        canvas.add([patch], int(random.choice([-13, -9, -6, 7])), SHADE)
    for _ in range(count[1]):
        start = random.uniform(0, length)
        line = cut(segment.left_m, start, start + random.uniform(8, 40))
        side = sum(lane.width_m for lane in segment.driving[1:]) or random.uniform(0.1, 1.5)
        canvas.add([strip(_wavy_line(line, -side - 0.2, random), 0.05, -0.05)], -18, SHADE)
    for _ in range(count[2]):
        start, width = random.uniform(0, length), random.uniform(0.8, segment.width_m)
        canvas.add([strip(_crack(segment, start, width, random), 0.05, -0.05)], -int(random.integers(10, 26)), SHADE)
    turns = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    for _ in range(count[3]):
        right = random.uniform(0.6, max(segment.width_m - 0.4, 0.7))
        place = _points_along(segment, np.array([random.uniform(0, length)]), np.array([right]))
        canvas.add([place + ring * 0.42], 8, SHADE)
        canvas.add([place + ring * 0.32], -38, SHADE)


def _points_along(segment: RoadSegment, along_m: FloatArray, right_m: FloatArray) -> FloatArray:
    """Return (S, 2) points by distance along a segment and to the right of its left border."""
    heading = directions_at(segment.left_m, along_m)
    right = np.stack([heading[:, 1], -heading[:, 0]], axis=1)
    return np.asarray(points_at(segment.left_m, along_m) + right_m[:, None] * right)


def _patch(segment: RoadSegment, random: np.random.Generator, length: float) -> FloatArray:
    start, long = random.uniform(0, length), random.uniform(1.2, 9.0)
    right = random.uniform(0.1, max(segment.width_m - 1.5, 0.2))
    wide = random.uniform(0.8, 2.6)
    return _points_along(segment, start + long * np.array([0, 1, 1, 0]), right + wide * np.array([0, 0, 1, 1]))


def _wavy_line(line_m: FloatArray, left_m: float, random: np.random.Generator) -> FloatArray:
    if length_m(line_m) < 1.0:
        return np.zeros((0, 2))
    fine = points_at(line_m, np.linspace(0, length_m(line_m), max(3, round(length_m(line_m) / 2))))
    return shifted(fine, left_m) + random.normal(0, 0.06, fine.shape)


def _crack(segment: RoadSegment, along_m: float, width_m: float, random: np.random.Generator) -> FloatArray:
    steps = max(3, round(width_m / 0.35))
    along = along_m + np.cumsum(random.normal(0, 0.16, steps))
    right = np.linspace(0, width_m, steps) + random.uniform(0, segment.width_m - width_m + 1e-6)
    return clean(_points_along(segment, along, right))


def _draw_pavement_joints(canvas: Canvas, segment: RoadSegment, pavement_m: float) -> None:
    """Draw the joints between the slabs of the pavement; other surfaces hide their part."""
    border = _right_border(segment, 0.0)
    length = length_m(border)
    if length < 3.0:
        return
    along = np.arange(0.5, length, 1.5)
    heading = directions_at(border, along)
    right = np.stack([heading[:, 1], -heading[:, 0]], axis=1)
    near, far = points_at(border, along) + right * 0.2, points_at(border, along) + right * pavement_m
    half = heading * (_JOINT_M / 2)
    canvas.add([np.stack([near - half, near + half, far + half, far - half], axis=1)], -14, SHADE)
    for share in (1 / 3, 2 / 3):
        border = _right_border(segment, 0.2 + share * (pavement_m - 0.2))
        canvas.add([strip(border, _JOINT_M / 2, -_JOINT_M / 2)], -11, SHADE)


def _draw_car_park_wear(canvas: Canvas, plan: TownPlan, random: np.random.Generator) -> None:
    """Draw the asphalt of the car parks, and drops of oil in the bays."""
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    for car_park in plan.car_parks:
        _fill_asphalt(canvas, [car_park.outline_m], int(random.integers(78, 104)))
        for x, y, yaw in car_park.bays:
            ahead = np.array([np.cos(yaw), np.sin(yaw)])
            for _ in range(int(random.integers(0, 4))):
                spot = np.array([x, y]) + ahead * random.normal(0.8, 0.7) + random.normal(0, 0.25, 2)
                canvas.add([spot + ring * random.uniform(0.15, 0.5)], -int(random.integers(8, 22)), SHADE)
