"""Decoding of object heads: peaks of the centre heatmaps become boxes, with score and paint of their cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from scipy.spatial.distance import cdist
from scipy.special import expit, logit
from torch.nn import functional

from appocc.bevmap import VEHICLE
from appocc.checks import BoolArray, Float32Array, FloatArray, IntArray
from appocc.colours import lab_from_rgb
from appocc.geometry import wrap_angle
from appocc.grid import BEVGrid
from appocc.models.base import VELOCITY_UNIT_MPS, ObjectOutput
from appocc.objects import KINDS, PEOPLE, BEVObjects

# Peaks below this probability, and all but the highest ones, are no objects.
LEAST_SCORE, MOST_PEAKS = 0.05, 200
# Logistic regression of found vehicles (centre within 2 m) on the log-odds of the peak and the mean vehicle
# probability of the cells in the box: their weights and the constant, from validation maps of the training's towns.
_PEAK_WEIGHT, _CELL_WEIGHT, _CONSTANT = 0.86, 1.70, -0.50
# Logistic regression of vehicle cells on the log-odds of their probability and, in a box, one and the log-odds of the
# score of the box: weights and constant, from validation maps of the training's towns; range of the log-odds.
_FUSED_CELL, _FUSED_BOX, _FUSED_SCORE, _FUSED_CONSTANT = 0.79, 0.66, 0.28, -0.47
_LEAST_PROBABILITY, _LEAST_FUSED_SCORE = 1e-6, 0.02
# Sizes of boxes are kept in this range.
_SMALLEST_M, _LARGEST_M = 0.2, 30.0


def decode_objects(output: ObjectOutput, grid: BEVGrid, seen: BoolArray, moving: bool) -> BEVObjects:
    """Return the objects of one map, the best first, without paint.

    Args:
        output: head outputs of a batch of one.
        grid: grid of the map; the heads have cells of twice the size.
        seen: (X, Y) cells that a camera sees; centres elsewhere are guesses and left out.
        moving: whether earlier frames were known: velocities are unknown without them.
    """
    half, kind, cell, score = _peaks(output, grid)
    maps = torch.cat([each[0].float() for each in output[1:]]).cpu().numpy()
    values = maps[:, cell[:, 0], cell[:, 1]].T.astype(np.float64)
    xy = half.centre_of(cell) + values[:, :2] * half.cell_m
    size = np.exp(np.clip(values[:, 3:6], np.log(_SMALLEST_M), np.log(_LARGEST_M)))
    at = grid.cell_of(xy)
    keep = grid.contains(at)
    keep[keep] = seen[tuple(at[keep].T)]
    keep &= _is_first(xy, size[:, 0], kind, keep)
    return BEVObjects(
        centre_m=np.column_stack([xy, values[:, 2]])[keep],
        size_wlh_m=size[keep],
        yaw_rad=_headings(values[:, 6:8], values[:, 10:12])[keep],
        velocity_mps=values[keep, 8:10] * (VELOCITY_UNIT_MPS if moving else np.nan),
        kind=tuple(KINDS[i] for i in kind[keep]),
        rgb=np.full((int(keep.sum()), 3), np.nan),
        score=score[keep],
    )


def _headings(heading: FloatArray, axis: FloatArray) -> FloatArray:
    """Return headings (K,) along the axis, in the direction that is nearer to `heading`; sines and cosines (K, 2)."""
    along = np.arctan2(axis[:, 0], axis[:, 1]) / 2
    ahead = np.sin(along) * heading[:, 0] + np.cos(along) * heading[:, 1] >= 0
    return wrap_angle(np.where(ahead, along, along + np.pi))


def _peaks(output: ObjectOutput, grid: BEVGrid) -> tuple[BEVGrid, IntArray, IntArray, FloatArray]:
    """Return the heads' grid, and kind, cell (K, 2) and probability of the highest peaks, the best first."""
    probability = output.centre[:1].float().sigmoid()
    peak = functional.max_pool2d(probability, 3, 1, 1) == probability
    found = torch.where(peak, probability, 0.0)[0].cpu().numpy()
    order = np.argsort(-found, axis=None, kind="stable")[:MOST_PEAKS]
    order = order[found.ravel()[order] >= LEAST_SCORE]
    kind, x, y = np.unravel_index(order, found.shape)
    return grid.halved(), np.asarray(kind), np.stack([x, y], axis=1), found.ravel()[order].astype(np.float64)


def _is_first(xy: FloatArray, width_m: FloatArray, kind: IntArray, among: BoolArray) -> BoolArray:
    """(K,) objects that no better one duplicates, the best first.

    Two vehicles are duplicates if their bodies would overlap side by side: their centres are closer than the mean of
    their widths. People and cyclists are duplicates of their own kind only, closer than half the smaller width.
    """
    group = np.array([i if name in PEOPLE else -1 for i, name in enumerate(KINDS)])[kind]
    first = among.copy()
    for i in range(1, len(xy)):
        near = np.hypot(*(xy[:i] - xy[i]).T)
        reach = (width_m[:i] + width_m[i]) / 2 if group[i] < 0 else np.minimum(width_m[:i], width_m[i]) / 2
        first[i] &= not (first[:i] & (group[:i] == group[i]) & (near < reach)).any()
    return first


def rescore_objects(objects: BEVObjects, grid: BEVGrid, occupancy: Float32Array) -> BEVObjects:
    """Return the objects, the best first, with scores of vehicles from their peak and the cells of their box.

    Two heads that agree are right more often than one (late fusion).

    Args:
        objects: objects of a map; their scores are probabilities of the peaks.
        grid: grid of the map.
        occupancy: (3, X, Y) probabilities.
    """
    owner = objects.vehicle_owner(grid)
    inside, number = owner >= 0, len(objects)
    cells = np.bincount(owner[inside], minlength=number)
    vehicle = np.bincount(owner[inside], occupancy[VEHICLE][inside], minlength=number) / np.maximum(cells, 1)
    combined = expit(_PEAK_WEIGHT * logit(objects.score) + _CELL_WEIGHT * vehicle + _CONSTANT)
    score = np.where(objects.are_vehicles, combined, objects.score)
    return replace(objects, score=score).select(np.argsort(-score, kind="stable"))


def fuse_vehicles(objects: BEVObjects, grid: BEVGrid, occupancy: Float32Array) -> Float32Array:
    """Return the probabilities (3, X, Y) with those of vehicles from the cell and the box over it (late fusion).

    Boxes know the shape of vehicles; cells know those that no box was found for.

    Args:
        objects: objects of a map with their final scores.
        grid: grid of the map.
        occupancy: (3, X, Y) probabilities.
    """
    owner = objects.vehicle_owner(grid)
    inside = owner >= 0
    cell = logit(occupancy[VEHICLE].clip(_LEAST_PROBABILITY, 1 - _LEAST_PROBABILITY).astype(np.float64))
    score = logit(objects.score.clip(_LEAST_FUSED_SCORE, 1 - _LEAST_FUSED_SCORE))
    log_odds = _FUSED_CELL * cell + _FUSED_CONSTANT
    log_odds[inside] += _FUSED_BOX + _FUSED_SCORE * score[owner[inside]]
    fused = occupancy.copy()
    fused[VEHICLE] = expit(log_odds)
    return fused


def paint_objects(
    objects: BEVObjects, grid: BEVGrid, occupancy: Float32Array, rgb: FloatArray, seen: BoolArray
) -> BEVObjects:
    """Return vehicles with their paint: the seen cell whose colour is nearest to all others (medoid in CIELAB).

    Cells weigh the square of their vehicle probability. A mean would mix paint, glass and the ground beside.

    Args:
        objects: objects of a map.
        grid: grid of the map.
        occupancy: (3, X, Y) probabilities.
        rgb: (3, X, Y) predicted colours, 0..255.
        seen: (X, Y) cells that a camera sees.
    """
    owner = objects.vehicle_owner(grid)
    paint = np.full((len(objects), 3), np.nan)
    for number in np.unique(owner[(owner >= 0) & seen]).tolist():
        inside = (owner == number) & seen
        colours, weight = rgb[:, inside].T, occupancy[VEHICLE][inside].astype(np.float64) ** 2
        lab = lab_from_rgb(colours)
        paint[number] = colours[(cdist(lab, lab) @ weight).argmin()]
    return objects.painted(paint)
