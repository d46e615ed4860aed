"""Admissible goals of a command: one short function per relation, by plain geometry on the true key frame.

Definitions, gaps and limits of the relations are those of docs/grounding.md, implemented independently. Headings
are along the lane, in either direction outside our own lane. If a queue is in the way, the product may choose a
farther place, which people might not call "behind" any more: such cases are skipped, like all others on which two
people might disagree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from appocc.checks import BoolArray
from benchmarks.grounding_truth.key_frames import ALONG_DEG, HALF_CELL_M, TrueFrame, Vehicle
from benchmarks.grounding_truth.places import (
    ALIGNED_M,
    LEAST_GAP_M,
    MARGIN_M,
    Ask,
    Region,
    in_line,
    is_accepted_gap,
    lanes_near,
    places,
    unit,
    wanted_m,
)
from benchmarks.grounding_truth.roads import EGO, kerbs, to_kerb

# Between these angles people might disagree whether it faces us; between those it is across our way. A vehicle that
# faces us is in our way up to this distance from our path, within a tolerance.
FACES_DEG, ACROSS_DEG, IN_WAY_M, IN_WAY_DOUBT_M = (100.0, 140.0), (50.0, 130.0), 4.5, 0.8
SIDE_GAP_M, SIDE_GAPS_M, SIDE_OFFSET_M = 0.8, (0.4, 2.3), 1.0
NEAR_M, TOWARD_M = 6.0, 1.0
# A vehicle this close to the middle of our lane is in it. Beyond this slope of the lane, the ego is changing lanes
# and its own lane is undefined.
IN_LANE_M, CHANGING = 1.0, 0.05
# Opposite: longitudinal tolerance, and for parking the largest distance to the kerb.
LEVEL_M, EDGE_M = 2.0, 1.5
# Between: free space at both ends, largest gap, and largest lateral offset.
ROOM_M, LONGEST_GAP_M, WIDEST_GAP_M = 0.4, 15.0, 12.0
# Goals without a vehicle: distances ahead, and their tolerance.
AHEAD_M, AHEAD_SLACK_M = (4.0, 30.0), 1.0


def region(relation: str, moment: TrueFrame, vehicles: Sequence[Vehicle], ask: Ask) -> Region | None:
    """Return the goals in a relation to vehicles (two for "between", none for "none"); None if there are none."""
    return RELATIONS[relation](moment, *vehicles, ask)


# Relative to a vehicle --------------------------------------------------------------------------------------------


def behind(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region in line with the vehicle, behind it."""
    return _at_end(moment, v, ask, -1)


def in_front_of(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region in line with the vehicle, in front of it."""
    return _at_end(moment, v, ask, 1)


def follow(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region behind the vehicle in its lane, or in line with it, at the gap of its speed."""
    return _in_its_lane(moment, v, ask, -1)


def overtake(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region beyond the vehicle in its lane."""
    return _in_its_lane(moment, v, ask, 1)


def _in_its_lane(moment: TrueFrame, v: Vehicle, ask: Ask, sign: int) -> Region | None:
    """Return the region before or beyond a vehicle of our direction, along our lane or along its heading."""
    if moment.path is None or abs(moment.turn_deg(v)) > ALONG_DEG or not moment.has_lane_to(v.xy_m[0] - v.length_m):
        return None
    x, aside = moment.centres[..., 0], moment.sideways_m(v)
    half = (v.length_m + EGO.length_m) / 2
    per_x = np.hypot(1.0, moment.path.bend[1] + moment.path.bend[2] * (x + v.xy_m[0]))  # arc length per x
    off = moment.centres[..., 1] - moment.path.y(x)
    same_lane = np.abs(off - aside) <= ALIGNED_M + HALF_CELL_M
    if abs(aside) < IN_LANE_M:
        same_lane |= np.abs(off) <= ALIGNED_M + HALF_CELL_M  # in our own
    ahead = sign * (x - v.xy_m[0])
    where = same_lane & is_accepted_gap(ahead * per_x - half, ask, v) & (ahead < _next_in_lane(moment, v, sign))
    along, _ = moment.local(v.xy_m, v.yaw_rad)
    where |= in_line(moment, v, v.yaw_rad, sign) & is_accepted_gap(sign * along - half, ask, v)
    slope = np.array([np.cos(moment.our_yaw(v.xy_m[0])), np.sin(moment.our_yaw(v.xy_m[0]))])
    ideal_x = float((v.xy_m + sign * slope * (wanted_m(ask, v) + half))[0])
    if not moment.has_lane_to(ideal_x):
        return None  # at a crossing
    ideal = np.array([ideal_x, moment.path.y(ideal_x) + aside])
    return places(moment, where, ideal, (v.yaw_rad, moment.our_yaw(ideal_x)))


def _next_in_lane(moment: TrueFrame, v: Vehicle, sign: int) -> float:
    """Return the distance along x to the next vehicle ahead (1) or behind (-1) in its lane, infinity without one."""
    same = [one for one in moment.vehicles if abs(moment.sideways_m(one) - moment.sideways_m(v)) < ALIGNED_M]
    apart = [sign * float(one.xy_m[0] - v.xy_m[0]) for one in same]
    return min((each for each in apart if each > 0.5), default=np.inf)


def _at_end(moment: TrueFrame, v: Vehicle, ask: Ask, sign: int) -> Region | None:
    yaw = frame_yaw(moment, v, ask.blobs)
    if yaw is None:
        return None
    along, _ = moment.local(v.xy_m, yaw)
    gap = sign * along - (v.length_m + EGO.length_m) / 2
    where = in_line(moment, v, yaw, sign) & is_accepted_gap(gap, ask, v)
    ideal = v.xy_m + sign * unit(yaw) * (wanted_m(ask, v) + (v.length_m + EGO.length_m) / 2)
    return places(moment, where, ideal, (yaw, yaw + np.pi))


def frame_yaw(moment: TrueFrame, v: Vehicle, blobs: bool) -> float | None:
    """Return the direction of "in front of" the vehicle; None where people might disagree."""
    turn = moment.turn_deg(v)
    axis = moment.our_axis(v)
    if blobs:  # front unknown: our own direction, if it is along one of its axes
        return None if ACROSS_DEG[0] < abs(turn) < ACROSS_DEG[1] else axis
    if abs(turn) <= FACES_DEG[0]:
        return v.yaw_rad
    if abs(turn) < FACES_DEG[1]:
        return None
    if not v.stationary:
        return v.yaw_rad
    aside = np.abs([moment.sideways_m(v), v.xy_m[1]])  # relative to our lane, and straight on
    in_way, beside = aside.max() < IN_WAY_M - IN_WAY_DOUBT_M, aside.min() > IN_WAY_M + IN_WAY_DOUBT_M
    if not (in_way or beside) or not moment.has_lane_to(v.xy_m[0]):
        return None
    return axis if in_way else v.yaw_rad


def next_to(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region at either side of the vehicle; the side towards us is better."""
    return _beside(moment, v, (1, -1))


def left_of(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region left of the vehicle as seen from the ego."""
    return _beside(moment, v, (1,)) if moment.is_along(v) else None


def right_of(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region right of the vehicle as seen from the ego."""
    return _beside(moment, v, (-1,)) if moment.is_along(v) else None


def _beside(moment: TrueFrame, v: Vehicle, sides: Sequence[int]) -> Region | None:
    yaw = moment.our_axis(v)
    along, across = moment.local(v.xy_m, yaw)
    level = np.abs(along) <= v.length_m / 2 + SIDE_OFFSET_M + HALF_CELL_M
    where = np.zeros_like(level)
    for side in sides:
        gap = side * across - (v.width_m + EGO.width_m) / 2
        where |= level & (gap >= SIDE_GAPS_M[0] - HALF_CELL_M) & (gap <= SIDE_GAPS_M[1] + HALF_CELL_M)
    left = unit(yaw + np.pi / 2)
    towards = max(sides, key=lambda side: -side * float((v.xy_m - [EGO.centre_m, 0.0]) @ left))
    ideal = v.xy_m + towards * left * (SIDE_GAP_M + (v.width_m + EGO.width_m) / 2)
    return places(moment, where, ideal, (yaw, yaw + np.pi))


def near(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region around the vehicle; nearer is better."""
    return places(moment, _around(moment, v), v.xy_m, lanes_near(moment, v))


def toward(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region around the vehicle and short of it, along our way or in our line of sight."""
    yaw = moment.our_yaw(v.xy_m[0])
    sight = float(np.arctan2(v.xy_m[1], v.xy_m[0] - EGO.centre_m))
    way = yaw if moment.is_along(v) else sight
    short = (moment.local(v.xy_m, way)[0] <= TOWARD_M) | (moment.local(v.xy_m, sight)[0] <= TOWARD_M)
    ideal = v.xy_m - unit(way) * (wanted_m(ask, v) + (v.extent_m(way) + EGO.length_m) / 2)
    return places(moment, _around(moment, v) & short, ideal, lanes_near(moment, v))


def _around(moment: TrueFrame, v: Vehicle) -> BoolArray:
    """Return the cells where the ego's footprint, aligned with a vehicle, is near it."""
    along, across = moment.local(v.xy_m, v.yaw_rad)
    short = np.maximum(np.abs(along) - (v.length_m + EGO.length_m) / 2, 0)
    aside = np.maximum(np.abs(across) - (v.width_m + EGO.width_m) / 2, 0)
    return np.asarray(np.hypot(short, aside) <= NEAR_M + HALF_CELL_M)


def between(moment: TrueFrame, v: Vehicle, w: Vehicle, ask: Ask) -> Region | None:
    """Return the region in the gap between two vehicles in a row or side by side, clear of both."""
    along, across = (float((w.xy_m - v.xy_m) @ unit(v.yaw_rad + turn)) for turn in (0.0, np.pi / 2))
    askew = abs((np.degrees(w.yaw_rad - v.yaw_rad) + 90) % 180 - 90)
    row = abs(along) > abs(across)
    if not row and ask.action == "park":
        return None  # parking in the middle of a road is not allowed
    apart, slant = (along, across) if row else (across, along)
    way = v.yaw_rad + (0.0 if row else np.pi / 2) + (0.0 if apart > 0 else np.pi)
    ends = [(one.length_m if row else one.width_m) / 2 for one in (v, w)]
    free, needed = abs(apart) - sum(ends), EGO.length_m if row else EGO.width_m
    most = LONGEST_GAP_M if row else WIDEST_GAP_M
    if askew > ALONG_DEG or abs(slant) > ALIGNED_M or not needed + 2 * ROOM_M <= free <= most:
        return None
    middle = (v.xy_m + w.xy_m) / 2 + unit(way) * (ends[0] - ends[1]) / 2
    lengthwise, aside = (np.abs(one) for one in moment.local(middle, way))
    if (moment.occupied & (lengthwise <= free / 2 - ROOM_M) & (aside <= ROOM_M)).any():
        return None  # a third vehicle is in the gap
    wide = ALIGNED_M if row else v.length_m / 2 + SIDE_OFFSET_M
    inside = (lengthwise <= (free - needed) / 2) & (aside <= wide + HALF_CELL_M)
    return places(moment, inside, middle, (v.yaw_rad, v.yaw_rad + np.pi))


# Relative to our road ---------------------------------------------------------------------------------------------


def before(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region short of the vehicle, in line with it or in our own lane."""
    return _along_road(moment, v, ask, -1)


def past(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region beyond the vehicle, in line with it or in our own lane."""
    return _along_road(moment, v, ask, 1)


def drive_past(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region beyond the vehicle in our own lane."""
    return _along_road(moment, v, ask, 1)


def _along_road(moment: TrueFrame, v: Vehicle, ask: Ask, sign: int) -> Region | None:
    """Return the region before or beyond a vehicle along our road: for parking in line with it, else in our lane."""
    if moment.path is None or not moment.is_along(v) or not moment.has_lane_to(v.xy_m[0]):
        return None
    yaw = moment.our_yaw(v.xy_m[0])
    along, _ = moment.local(v.xy_m, yaw)
    half = (v.extent_m(yaw) + EGO.length_m) / 2
    where = is_accepted_gap(sign * along - half, ask, v)
    ideal = v.xy_m + sign * unit(yaw) * (wanted_m(ask, v) + half)
    lined = where & in_line(moment, v, yaw, sign)
    if ask.action in ("park", "pull_over"):
        return places(moment, lined, ideal, (yaw, yaw + np.pi))
    ideal = np.array([ideal[0], moment.path.y(ideal[0])])
    there = moment.our_yaw(ideal[0])  # our lane may curve
    own = np.abs(moment.centres[..., 1] - moment.path.y(moment.centres[..., 0])) <= ALIGNED_M + HALF_CELL_M
    ours = places(moment, where & own, ideal, (yaw, there))
    if ours is None or ask.action != "stop":
        return ours
    both = places(moment, where & (own | lined), ours.best_m, (yaw, yaw + np.pi, there))
    return both and both._replace(best_m=ours.best_m)


def opposite(moment: TrueFrame, v: Vehicle, ask: Ask) -> Region | None:
    """Return the region level with the vehicle on the other side of the road; for parking, at the kerb."""
    road = kerbs(moment.bev.grid, moment.ground, v.xy_m, v.yaw_rad) if moment.is_along(v) else None
    if road is None:
        return None
    left, right = road
    side = -1 if (left + right) / 2 < 0 else 1
    middle, edge = side * (left + right) / 2, left if side > 0 else -right
    if middle < ROOM_M + v.width_m / 2:
        return None  # the vehicle is in the middle of the road
    along, across = moment.local(v.xy_m, v.yaw_rad)
    where = (np.abs(along) <= v.length_m / 2 + LEVEL_M + HALF_CELL_M) & (side * across >= middle)
    best = edge - EGO.width_m / 2 - LEAST_GAP_M
    where &= side * across <= edge
    if ask.action == "stop":
        best = (middle + edge) / 2
    else:
        where &= side * across >= edge - EGO.width_m / 2 - EDGE_M - HALF_CELL_M
    ideal = v.xy_m + side * best * unit(v.yaw_rad + np.pi / 2)
    return places(moment, where, ideal, (v.yaw_rad, v.yaw_rad + np.pi))


# Without a vehicle ------------------------------------------------------------------------------------------------


def without_vehicle(moment: TrueFrame, ask: Ask) -> Region | None:
    """Return the region at a distance ahead in our lane, or at the kerb of a side, nearest first."""
    return _in_lane(moment, ask) if ask.action == "stop" else _at_kerb(moment, ask)


def _in_lane(moment: TrueFrame, ask: Ask) -> Region | None:
    if ask.said_m is None or moment.path is None or abs(moment.path.bend[1]) > CHANGING:
        return None
    way = np.arange(0.0, ask.said_m + 0.1, 0.5)
    x = EGO.centre_m + way * np.cos(moment.our_yaw(EGO.centre_m + ask.said_m / 2))
    cells = moment.bev.grid.cell_of(np.stack([x, moment.path.y(x)], axis=-1))
    if not moment.stands_free(cells, moment.our_yaw(EGO.centre_m + ask.said_m / 2), MARGIN_M).all():
        return None  # a vehicle is in the way
    if not moment.has_lane_to(x[-1]):
        return None
    end_m = np.array([x[-1], float(moment.path.y(x[-1]))])
    yaw = moment.our_yaw(end_m[0])
    along, across = moment.local(end_m, yaw)
    where = (np.abs(along) <= 1 + ask.said_m / 10 + HALF_CELL_M) & (np.abs(across) <= ALIGNED_M + HALF_CELL_M)
    return places(moment, where, end_m, (yaw,))


def _at_kerb(moment: TrueFrame, ask: Ask) -> Region | None:
    if moment.path is None:
        return None
    side = 1 if ask.side == "left" else -1
    away, kerb_y = to_kerb(moment.bev.grid, moment.ground, side)
    x, y = moment.centres[:, 0, 0], moment.centres[..., 1]
    # Only the kerb of our road: it is also that of the middle of our lane.
    lane = np.argmin(np.abs(y - moment.path.y(x)[:, None]), axis=1)
    where = np.abs(kerb_y - kerb_y[np.arange(len(x)), lane][:, None]) < HALF_CELL_M
    where &= (away >= EGO.width_m / 2) & (away <= EGO.width_m / 2 + EDGE_M)
    ahead = (x >= EGO.centre_m + AHEAD_M[0] - AHEAD_SLACK_M) & (x <= EGO.centre_m + AHEAD_M[1] + AHEAD_SLACK_M)
    yaw = moment.our_yaw(EGO.centre_m + sum(AHEAD_M) / 2)
    return places(moment, where & ahead[:, None], np.array([EGO.centre_m + AHEAD_M[0], 0.0]), (yaw, yaw + np.pi))


Relation = Callable[..., Region | None]
RELATIONS: Mapping[str, Relation] = {
    "behind": behind,
    "in_front_of": in_front_of,
    "next_to": next_to,
    "near": near,
    "left_of": left_of,
    "right_of": right_of,
    "toward": toward,
    "before": before,
    "past": past,
    "opposite": opposite,
    "between": between,
    "at": near,
    "follow": follow,
    "overtake": overtake,
    "drive_past": drive_past,
    "none": without_vehicle,
}
