"""Geometry of polylines (N, 2): arc length, cutting, offsets and strips."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray

_SHORTEST_M = 0.01
# Limit of the distance of a mitred corner, in units of the offset.
_MITRE_LIMIT = 2.0
_ZERO = np.zeros(1)


def clean(line_m: FloatArray) -> FloatArray:
    """Remove points closer than a centimetre to their predecessor; keep both ends."""
    if len(line_m) < 2:
        return line_m
    keep = np.ones(len(line_m), np.bool_)
    keep[1:] = np.hypot(*np.diff(line_m, axis=0).T) > _SHORTEST_M
    kept = line_m[keep]
    if not keep[-1] and len(kept) > 1:
        kept[-1] = line_m[-1]
    return np.asarray(kept)


def arc_m(line_m: FloatArray) -> FloatArray:
    """Return the arc length (N,) at each point, metres."""
    return np.concatenate([_ZERO, np.cumsum(np.hypot(*(line_m[1:] - line_m[:-1]).T))])


def length_m(line_m: FloatArray) -> float:
    """Return the length of the line in metres; 0 for fewer than two points."""
    return float(np.hypot(*(line_m[1:] - line_m[:-1]).T).sum()) if len(line_m) > 1 else 0.0


def points_at(line_m: FloatArray, along_m: FloatArray) -> FloatArray:
    """Return points (S, 2) at arc lengths (S,), clamped to the ends of the line."""
    arc = arc_m(line_m)
    return np.stack([np.interp(along_m, arc, line_m[:, axis]) for axis in (0, 1)], axis=-1)


def directions_at(line_m: FloatArray, along_m: FloatArray) -> FloatArray:
    """Return unit directions (S, 2) of the line at arc lengths (S,)."""
    steps = np.diff(line_m, axis=0)
    piece = np.searchsorted(arc_m(line_m), along_m, side="right") - 1
    step = steps[np.clip(piece, 0, len(steps) - 1)]
    return np.asarray(step / np.hypot(step[:, :1], step[:, 1:]))


def cut(line_m: FloatArray, start_m: float, end_m: float) -> FloatArray:
    """Return the piece between two arc lengths; (0, 2) if it is empty."""
    arc = arc_m(line_m)
    start, end = max(start_m, 0.0), min(end_m, float(arc[-1]))
    if end - start <= _SHORTEST_M:
        return np.zeros((0, 2))
    between = (arc > start + _SHORTEST_M) & (arc < end - _SHORTEST_M)
    ends = points_at(line_m, np.array([start, end]))
    return np.concatenate([ends[:1], line_m[between], ends[1:]])


def dashes(line_m: FloatArray, dash_m: float, gap_m: float) -> list[FloatArray]:
    """Return the dashes of a broken line; it starts with half a gap, so that consecutive lines are evenly dashed."""
    starts = np.arange(gap_m / 2, length_m(line_m) - dash_m / 3, dash_m + gap_m)
    return [piece for start in starts if len(piece := cut(line_m, float(start), float(start) + dash_m))]


def normals(line_m: FloatArray) -> FloatArray:
    """Return mitred normals (N, 2) to the left: an offset by a normal shifts both neighbouring segments by 1."""
    step = np.diff(line_m, axis=0)
    step /= np.hypot(step[:, :1], step[:, 1:])
    left = np.stack([-step[:, 1], step[:, 0]], axis=1)
    both = np.concatenate([left[:1], left]) + np.concatenate([left, left[-1:]])
    square = np.maximum((both**2).sum(axis=1, keepdims=True), 1e-9)
    both = both * np.minimum(2 / square, _MITRE_LIMIT / np.sqrt(square))
    return np.asarray(both)


def shifted(line_m: FloatArray, left_m: float) -> FloatArray:
    """Offset the line to its left by some metres (to the right if negative)."""
    return np.asarray(line_m + normals(line_m) * left_m) if len(line_m) > 1 else line_m


def strip(line_m: FloatArray, left_m: float, right_m: float) -> FloatArray:
    """Return quadrilaterals (N - 1, 4, 2) between the line offset left by `left_m` and by `right_m`."""
    if len(line_m) < 2:
        return np.zeros((0, 4, 2))
    across = normals(line_m)
    left, right = line_m + across * left_m, line_m + across * right_m
    return np.stack([left[:-1], left[1:], right[1:], right[:-1]], axis=1)


def outline(line_m: FloatArray, left_m: float, right_m: float) -> FloatArray:
    """Return the outline (2 N, 2) of the strip between the line offset left by `left_m` and by `right_m`."""
    across = normals(line_m)
    return np.concatenate([line_m + across * right_m, (line_m + across * left_m)[::-1]])
