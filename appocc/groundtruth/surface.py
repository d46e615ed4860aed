"""Ground surface of a scene: coloured points of all sweeps averaged in a fine raster of the world."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, Float32Array, FloatArray, IntArray
from appocc.groundtruth.colouring import LANE, NO_CAMERA, ROAD, UNLABELLED, ColouredPoints
from appocc.groundtruth.store import FINE_M, PointStore

# Cell size and quantile of the local ground height; points outside this height range are not ground.
_GROUND_CELL_M, _GROUND_SHARE = 0.4, 0.1
_BELOW_M, _ABOVE_M = 0.3, 0.25
# Exposure gains: minimum number of shared points of a camera pair, weight of the prior (gain 1) in points, and the
# largest gain: for larger exposure differences, colours close to the original images are preferred.
_MIN_PAIRS, _GAIN_PRIOR, _MAX_GAIN = 30, 2000.0, 1.2


class GroundSurface(NamedTuple):
    """Occupied fine cells (0.1 m) of the ground of a scene, world frame.

    Attributes:
        xyz_m: (N, 3) cell centres at the height of the ground.
        rgb: (N, 3) float32 sRGB 0..255, mean of the middle half of the observations by brightness.
        coloured: (N,) whether any image saw the cell.
        labelled: (N,) whether any observation has a label (nuScenes labels only key frames).
        road: (N,) share of the labelled observations that are road (lane included); 0 without labels.
        lane: (N,) share of the labelled observations that are lane marking.
    """

    xyz_m: FloatArray
    rgb: Float32Array
    coloured: BoolArray
    labelled: BoolArray
    road: Float32Array
    lane: Float32Array


@dataclass(frozen=True, eq=False)
class ExposureGains:
    """Factors (cameras, 3) that bring the cameras to a common exposure; their mean over all points is 1."""

    factors: FloatArray


def exposure_gains(sweeps: Iterable[ColouredPoints], cameras: int) -> ExposureGains:
    """Estimate gains from points seen by two cameras: regularised least squares on the log ratios.

    A camera pair is weighted by its number of common points; cameras without common points have gain 1. Gains are
    limited to a factor of 1.2.
    """
    normal = np.zeros((cameras, cameras))
    right = np.zeros((cameras, 3))
    ratios: dict[tuple[int, int], list[Float32Array]] = {}
    seen = np.zeros(cameras)
    for points in sweeps:
        seen += np.bincount(points.camera, minlength=256)[:cameras]
        for pair, values in _pair_ratios(points).items():
            ratios.setdefault(pair, []).append(values)
    for (a, b), parts in sorted(ratios.items()):
        values = np.concatenate(parts)
        if len(values) < _MIN_PAIRS:
            continue
        ratio, weight = np.median(values, axis=0), float(len(values))
        normal[[a, b], [a, b]] += weight
        normal[[a, b], [b, a]] -= weight
        right[a] -= weight * ratio
        right[b] += weight * ratio
    log_gain = np.linalg.solve(normal + _GAIN_PRIOR * np.eye(cameras), right)
    limit = np.log(_MAX_GAIN)
    paired = normal.diagonal() > 0
    seen = np.where(paired, seen, 0.0)
    mean = seen @ log_gain / max(seen.sum(), 1.0)  # keeps the overall brightness
    log_gain[paired] -= mean
    return ExposureGains(np.exp(np.clip(log_gain, -limit, limit)))


def _pair_ratios(points: ColouredPoints) -> dict[tuple[int, int], Float32Array]:
    """Return the (M, 3) log colour ratios of the points seen by two cameras, by camera pair."""
    rows = np.flatnonzero(
        (points.camera != NO_CAMERA) & (points.rgb.min(axis=1) > 10) & (points.rgb.max(axis=1) < 245)
    )
    order = rows[np.lexsort((points.camera[rows], *points.xyz_m[rows].T))]
    first, second = order[:-1], order[1:]
    same = (points.xyz_m[first] == points.xyz_m[second]).all(axis=1) & (points.camera[first] != points.camera[second])
    first, second = first[same], second[same]
    ratio = np.log(points.rgb[first].astype(np.float32)) - np.log(points.rgb[second].astype(np.float32))
    pairs = points.camera[first].astype(int) * 256 + points.camera[second]
    return {(int(p) // 256, int(p) % 256): ratio[pairs == p] for p in np.unique(pairs)}


def build_surface(store: PointStore, origin_m: FloatArray, gains: ExposureGains) -> GroundSurface:
    """Build the surface: keep ground points, apply exposure gains, average in fine cells; empty without points."""
    parts = [_surface_of(store, strip, origin_m, gains) for strip in sorted(store.strips) or [0]]
    return GroundSurface(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _surface_of(store: PointStore, strip: int, origin_m: FloatArray, gains: ExposureGains) -> GroundSurface:
    """Return the surface in a strip; points of the neighbouring strips define the ground height at its edges."""
    points = store.strip(strip)
    keep = _is_ground(np.concatenate([points.xyz_m, *(store.strip(near).xyz_m for near in (strip - 1, strip + 1))]))
    keep = keep[: len(points.xyz_m)]
    xyz, camera, ground = points.xyz_m[keep], points.camera[keep], points.ground[keep]
    rgb = points.rgb[keep].astype(np.float32)
    coloured = camera != NO_CAMERA
    rgb[coloured] *= gains.factors.astype(np.float32)[camera[coloured]]
    cell, unique = _cell_indices(xyz, FINE_M)
    cells = len(unique)
    count = np.bincount(cell, minlength=cells)
    mean, has_colour = _middle_mean(cell[coloured], np.minimum(rgb[coloured], 255), cells)
    centre = np.empty((cells, 3))
    centre[:, :2] = (unique + 0.5) * FINE_M + origin_m[:2]
    centre[:, 2] = np.bincount(cell, xyz[:, 2], minlength=cells) / count + origin_m[2]
    labels = np.bincount(cell, ground != UNLABELLED, minlength=cells)
    road = np.bincount(cell, (ground == ROAD) | (ground == LANE), minlength=cells) / np.maximum(labels, 1)
    lane = np.bincount(cell, ground == LANE, minlength=cells) / np.maximum(labels, 1)
    return GroundSurface(centre, mean, has_colour, labels > 0, road.astype(np.float32), lane.astype(np.float32))


def _cell_indices(xyz: Float32Array, cell_m: float) -> tuple[IntArray, IntArray]:
    """Return the index of the cell of each point, and the world indices (cells, 2) of the cells."""
    index = np.floor(xyz[:, :2] / cell_m).astype(np.int64)
    low = index.min(axis=0) if len(index) else np.zeros(2, np.int64)
    width = int(index[:, 1].max() - low[1] + 1) if len(index) else 1
    key = (index[:, 0] - low[0]) * width + index[:, 1] - low[1]
    unique, number = np.unique(key, return_inverse=True)
    return number, np.stack([unique // width, unique % width], axis=1) + low


def _is_ground(xyz: Float32Array) -> BoolArray:
    """Whether each point is near the lowest tenth of its 0.4 m cell: keeps roads under trees, removes the trees."""
    cell, unique = _cell_indices(xyz, _GROUND_CELL_M)
    order = np.lexsort((xyz[:, 2], cell))
    count = np.bincount(cell, minlength=len(unique))
    start = np.cumsum(count) - count
    low = xyz[order[start + (count * _GROUND_SHARE).astype(np.int64)], 2] if len(xyz) else np.zeros(0)
    height = xyz[:, 2] - low[cell]
    return np.asarray((height > -_BELOW_M) & (height < _ABOVE_M))


def _middle_mean(cell: IntArray, rgb: Float32Array, cells: int) -> tuple[Float32Array, BoolArray]:
    """Return the mean colour (cells, 3) of the middle half of the observations by brightness, and its validity."""
    order = np.lexsort((rgb.sum(axis=1), cell))
    cell, rgb = cell[order], rgb[order]
    count = np.bincount(cell, minlength=cells)
    start = np.cumsum(count) - count
    rank = (np.arange(len(cell)) - start[cell] + 0.5) / count[cell]
    middle = np.abs(rank - 0.5) <= np.maximum(0.25, 0.5 / count[cell])
    kept = np.maximum(np.bincount(cell[middle], minlength=cells), 1)
    mean = np.stack([np.bincount(cell[middle], rgb[middle, c], minlength=cells) / kept for c in range(3)], axis=1)
    return mean.astype(np.float32), count > 0
