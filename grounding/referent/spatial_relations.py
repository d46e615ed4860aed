"""How well one thing lies behind, beside or before another: soft, in the frames of reference that places have too."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.motion_state import STANDING_MPS
from grounding.referent.fuzzy import bell, falls, rises
from grounding.referent.object_table import Crowd

# A vehicle that faces us, stands, and lies so near to our path is seen along our way, not along its own.
_FACING_RAD, _OUR_PATH_M = np.radians(120), 4.5
# Each thing that stands between two makes the farther one less likely to be meant.
_NEXT_IN_LINE = 0.35
_LINED_UP_M, _LINE_FADES_M = 1.8, 15.0
_RANGES_M = {"next_to": (2.5, 1.0), "on": (0.8, 0.4), "in": (0.8, 0.4)}
_NEAR_M = (6.0, 2.0)
# Gaps that a car fits in: least room beside it, and from where on a gap is no gap any more.
_ROOM_M, _WIDE_M = 0.4, 16.0


def frame_of(crowd: Crowd, chosen: IntArray) -> FloatArray:
    """(M,) direction along which "behind" and "in front of" are measured from each chosen thing."""
    ours = crowd.lanes.direction_rad(crowd.xy_m[chosen])
    stands = ~(crowd.speed_mps[chosen] >= STANDING_MPS)
    seen_along_our_way = (
        (np.abs(crowd.turn_rad[chosen]) > _FACING_RAD) & stands & (np.abs(crowd.sideways_m[chosen]) < _OUR_PATH_M)
    )
    own = crowd.front_known[chosen] & crowd.vehicle[chosen] & ~seen_along_our_way
    return np.where(own, crowd.yaw_rad[chosen], ours)


def related(relation: str, crowd: Crowd, chosen: IntArray) -> FloatArray:
    """(N, M) how well each of N things is <relation> each of M chosen ones; 0 to itself."""
    if relation in ("behind", "in_front_of"):
        result = _in_line(crowd, chosen, frame_of(crowd, chosen), -1 if relation == "behind" else 1)
    elif relation in ("before", "past"):
        ours = crowd.lanes.direction_rad(crowd.xy_m[chosen])
        result = _in_line(crowd, chosen, ours, -1 if relation == "before" else 1)
    elif relation in ("left_of", "right_of"):
        along, sideways = _apart(crowd, chosen)
        sign = 1 if relation == "left_of" else -1
        result = rises(sign * sideways, 1.0, 0.3) * bell(np.maximum(np.abs(along) - 4, 0), 4.0)
        result = result * falls(gaps(crowd, chosen), 6.0, 1.5)
    elif relation == "opposite":
        along, _ = _apart(crowd, chosen)
        across = crowd.sideways_m[:, None] * crowd.sideways_m[chosen] < 0
        result = np.where(across, 1.0, 0.15) * bell(np.maximum(np.abs(along) - 4, 0), 4.0)
    else:
        result = falls(gaps(crowd, chosen), *_RANGES_M.get(relation, _NEAR_M))
        if relation == "same_as":
            result = result * np.cos(crowd.turn_rad[:, None] - crowd.turn_rad[chosen]).clip(0.05)
    result[chosen, np.arange(len(chosen))] = 0
    return result


def _apart(crowd: Crowd, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
    """(N, M) metres along and to the left of our direction at each chosen thing, from it."""
    return _turned(crowd, chosen, crowd.lanes.direction_rad(crowd.xy_m[chosen]))


def _turned(crowd: Crowd, chosen: IntArray, angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    x, y = np.moveaxis(crowd.xy_m[:, None] - crowd.xy_m[chosen], -1, 0)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return x * cos + y * sin, y * cos - x * sin


def _half_extent(crowd: Crowd, angle_rad: FloatArray) -> FloatArray:
    """(N, M) half of what things measure along a direction (M,)."""
    off = crowd.yaw_rad[:, None] - angle_rad
    length, width = crowd.size_m[:, :1], crowd.size_m[:, 1:2]
    return np.asarray((length * np.abs(np.cos(off)) + width * np.abs(np.sin(off))) / 2)


def _in_line(crowd: Crowd, chosen: IntArray, angle_rad: FloatArray, sign: int) -> FloatArray:
    """(N, M) how well things stand on an end of the chosen ones, nobody between."""
    along, sideways = _turned(crowd, chosen, angle_rad)
    half = _half_extent(crowd, angle_rad)
    gap = sign * along - half - half[chosen, np.arange(len(chosen))]
    lined = rises(gap, -0.5, 0.3) * bell(sideways, _LINED_UP_M)
    nearer = (gap[None] < gap[:, None]) & crowd.vehicle[None, :, None]
    between = (np.where(lined > 0.3, lined, 0.0)[None] * nearer).sum(axis=1)
    return np.asarray(lined * np.exp(-np.maximum(gap, 0) / _LINE_FADES_M) * _NEXT_IN_LINE**between)


def gaps(crowd: Crowd, chosen: IntArray) -> FloatArray:
    """(N, M) metres between footprints, 0 where they meet."""
    apart = [np.maximum(each, 0) for each in _gaps(crowd, chosen)]
    return np.asarray(np.hypot(*apart))


def _gaps(crowd: Crowd, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
    """(N, M) metres between the extents along our direction at each chosen thing, and across it; negative inside."""
    angle, own = crowd.lanes.direction_rad(crowd.xy_m[chosen]), np.arange(len(chosen))
    found = []
    for apart, turn in zip(_apart(crowd, chosen), (0.0, np.pi / 2), strict=True):
        half = _half_extent(crowd, angle + turn)
        found.append(np.abs(apart) - half - half[chosen, own])
    return found[0], found[1]


def room_between(crowd: Crowd, chosen: IntArray) -> FloatArray:
    """(M, M) how well a car fits between two of M: one behind the other or side by side, with nothing there."""
    along, sideways = _apart(crowd, chosen)
    lengthwise, crosswise = (each[chosen] for each in _gaps(crowd, chosen))
    own = np.arange(len(chosen))
    behind = bell(sideways[chosen], 1.5) * _fits_in(lengthwise, crowd.ego.length_m)
    beside = bell(along[chosen], 2.0) * _fits_in(crosswise, crowd.ego.width_m)
    # A third one (last axis), in the frame of the second of the pair, takes the place if it stands there.
    taken = (np.abs(sideways.T) < _LINED_UP_M)[None] & _within(along.T[None], along[chosen][..., None])
    taken[own, :, chosen] = taken[:, own, chosen] = False
    return np.maximum(behind * ~(taken & crowd.vehicle).any(axis=2), beside)


def _within(value: FloatArray, end: FloatArray) -> BoolArray:
    """Whether values lie between 0 and an end on either side of it."""
    return (value * np.sign(end) > 0) & (np.abs(value) < np.abs(end))


def _fits_in(gap_m: FloatArray, need_m: float) -> FloatArray:
    return rises(gap_m, need_m + _ROOM_M, 0.3) * falls(gap_m, _WIDE_M, 2.0)
