"""Fuzzy spatial relations between objects, in the reference frames that goal poses use too."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.motion_state import STANDING_MPS
from grounding.referent.fuzzy import falling, gaussian, rising
from grounding.referent.object_table import ObjectTable

# A standing vehicle that faces the ego this close to its path is described along the ego's direction, not its own.
_FACING_RAD, _EGO_PATH_M = np.radians(120), 4.5
# Factor for each object between two others: the nearer one is more likely meant.
_IN_BETWEEN_FACTOR = 0.35
_LINE_SIGMA_M, _LINE_FADE_M = 1.8, 15.0
# Midpoint and scale of the gap for relations of nearness.
_RANGES_M = {"next_to": (2.5, 1.0), "on": (0.8, 0.4), "in": (0.8, 0.4)}
_NEAR_M = (6.0, 2.0)
# Clearance that a car needs in a gap, and the length from which on a gap is too wide to be one.
_CLEARANCE_M, _WIDE_GAP_M = 0.4, 16.0


def reference_direction_rad(table: ObjectTable, chosen: IntArray) -> FloatArray:
    """Return the direction (M,) along which "behind" and "in front of" are measured from each chosen object."""
    road_direction = table.lanes.direction_rad(table.xy_m[chosen])
    standing = ~(table.speed_mps[chosen] >= STANDING_MPS)
    by_ego = (
        (np.abs(table.relative_heading_rad[chosen]) > _FACING_RAD)
        & standing
        & (np.abs(table.lateral_m[chosen]) < _EGO_PATH_M)
    )
    intrinsic = table.front_known[chosen] & table.is_vehicle[chosen] & ~by_ego
    return np.where(intrinsic, table.yaw_rad[chosen], road_direction)


def fit_relation(relation: str, table: ObjectTable, chosen: IntArray) -> FloatArray:
    """Return the membership (N, M) of each of N objects in "<relation> object m", for M chosen ones; 0 to itself."""
    if relation in ("behind", "in_front_of"):
        result = _fit_line(table, chosen, reference_direction_rad(table, chosen), -1 if relation == "behind" else 1)
    elif relation in ("before", "past"):
        road_direction = table.lanes.direction_rad(table.xy_m[chosen])
        result = _fit_line(table, chosen, road_direction, -1 if relation == "before" else 1)
    elif relation in ("left_of", "right_of"):
        along, lateral = _offsets_m(table, chosen)
        sign = 1 if relation == "left_of" else -1
        result = rising(sign * lateral, 1.0, 0.3) * gaussian(np.maximum(np.abs(along) - 4, 0), 4.0)
        result = result * falling(footprint_gap_m(table, chosen), 6.0, 1.5)
    elif relation == "opposite":
        along, _ = _offsets_m(table, chosen)
        across = table.lateral_m[:, None] * table.lateral_m[chosen] < 0
        result = np.where(across, 1.0, 0.15) * gaussian(np.maximum(np.abs(along) - 4, 0), 4.0)
    else:
        result = falling(footprint_gap_m(table, chosen), *_RANGES_M.get(relation, _NEAR_M))
        if relation == "same_as":
            turn_rad = table.relative_heading_rad[:, None] - table.relative_heading_rad[chosen]
            result = result * np.cos(turn_rad).clip(0.05)
    result[chosen, np.arange(len(chosen))] = 0
    return result


def _offsets_m(table: ObjectTable, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the offsets (N, M) from chosen objects, along the road direction there and to its left."""
    return _rotated_offsets_m(table, chosen, table.lanes.direction_rad(table.xy_m[chosen]))


def _rotated_offsets_m(table: ObjectTable, chosen: IntArray, angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    x, y = np.moveaxis(table.xy_m[:, None] - table.xy_m[chosen], -1, 0)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return x * cos + y * sin, y * cos - x * sin


def _half_extent_m(table: ObjectTable, angle_rad: FloatArray) -> FloatArray:
    """Return half the extent (N, M) of objects along directions (M,)."""
    off = table.yaw_rad[:, None] - angle_rad
    length, width = table.size_m[:, :1], table.size_m[:, 1:2]
    return np.asarray((length * np.abs(np.cos(off)) + width * np.abs(np.sin(off))) / 2)


def _fit_line(table: ObjectTable, chosen: IntArray, angle_rad: FloatArray, sign: int) -> FloatArray:
    """Return the membership (N, M) in "in line with object m, ahead (1) or behind (-1), nothing in between"."""
    along, lateral = _rotated_offsets_m(table, chosen, angle_rad)
    half = _half_extent_m(table, angle_rad)
    gap = sign * along - half - half[chosen, np.arange(len(chosen))]
    in_line = rising(gap, -0.5, 0.3) * gaussian(lateral, _LINE_SIGMA_M)
    nearer = (gap[None] < gap[:, None]) & table.is_vehicle[None, :, None]
    between = (np.where(in_line > 0.3, in_line, 0.0)[None] * nearer).sum(axis=1)
    return np.asarray(in_line * np.exp(-np.maximum(gap, 0) / _LINE_FADE_M) * _IN_BETWEEN_FACTOR**between)


def footprint_gap_m(table: ObjectTable, chosen: IntArray) -> FloatArray:
    """Return the metres (N, M) between the footprints of objects and of chosen ones; 0 where they touch."""
    apart = [np.maximum(each, 0) for each in _extent_gaps_m(table, chosen)]
    return np.asarray(np.hypot(*apart))


def _extent_gaps_m(table: ObjectTable, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the gaps (N, M) between extents, along the road direction and across it; negative if they overlap."""
    angle, own = table.lanes.direction_rad(table.xy_m[chosen]), np.arange(len(chosen))
    found = []
    for apart, turn in zip(_offsets_m(table, chosen), (0.0, np.pi / 2), strict=True):
        half = _half_extent_m(table, angle + turn)
        found.append(np.abs(apart) - half - half[chosen, own])
    return found[0], found[1]


def fit_between(table: ObjectTable, chosen: IntArray) -> FloatArray:
    """Return the degree (M, M) to which the ego fits between two of M objects, in line or abreast, unoccupied."""
    along, lateral = _offsets_m(table, chosen)
    lengthwise, crosswise = (each[chosen] for each in _extent_gaps_m(table, chosen))
    in_line = gaussian(lateral[chosen], 1.5) * _fit_gap(lengthwise, table.ego.length_m)
    abreast = gaussian(along[chosen], 2.0) * _fit_gap(crosswise, table.ego.width_m)
    return np.maximum(in_line * ~is_parted(table, chosen), abreast)


def is_parted(table: ObjectTable, chosen: IntArray) -> BoolArray:
    """Return whether a third vehicle stands in line between two of M objects, (M, M)."""
    along, lateral = _offsets_m(table, chosen)
    own = np.arange(len(chosen))
    # The third object is the last axis, in the frame of the second of the pair.
    occupied = (np.abs(lateral.T) < _LINE_SIGMA_M)[None] & _is_within(along.T[None], along[chosen][..., None])
    occupied[own, :, chosen] = occupied[:, own, chosen] = False
    return np.asarray((occupied & table.is_vehicle).any(axis=2))


def _is_within(value: FloatArray, end: FloatArray) -> BoolArray:
    """Return whether values are between 0 and an end of either sign."""
    return (value * np.sign(end) > 0) & (np.abs(value) < np.abs(end))


def _fit_gap(gap_m: FloatArray, needed_m: float) -> FloatArray:
    return rising(gap_m, needed_m + _CLEARANCE_M, 0.3) * falling(gap_m, _WIDE_GAP_M, 2.0)
