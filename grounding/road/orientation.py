"""Road axis of every cell, from road edges, lane markings and vehicles, and the direction of travel along it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import wrap_angle
from appocc.grid import BEVGrid
from grounding.road.pose import Pose2D
from grounding.road.routing import ShortestPaths
from grounding.scene_object import SceneObject

# Widths of the two smoothing kernels. The wide one has a small weight and matters where nothing is near.
_NEAR_M, _FAR_M, _FAR_WEIGHT = 2.8, 8.0, 0.02
# Weight of a vehicle, and of the ego, in cells of a straight edge.
_VEHICLE_WEIGHT = 6.0
# Shorter objects (people, bicycles) have any orientation.
MIN_VEHICLE_LENGTH_M = 2.5
# A vehicle at a larger angle to a confident road axis does not vote.
_ALONG_RAD = np.radians(30)
_CONFIDENT = 0.3
# Votes are smoothed on a grid this many times coarser.
_COARSE = 3
# Path direction is measured over this many steps. Thresholds on cosines: of path and axis, below which the path
# crosses the axis; of path and ego heading, below minus which it drives back; of two axes of the same road.
_STEPS = 8
_CROSSING, _BACKWARD, _STEADY = 0.6, 0.5, 0.5
# The direction of travel is a majority vote of paths in a neighbourhood of this size.
_SMOOTHING_M = 2.5

ComplexArray = NDArray[np.complexfloating]


def estimate_axes(
    grid: BEVGrid, drivable: BoolArray, known: BoolArray, marking: BoolArray, objects: Sequence[SceneObject]
) -> tuple[FloatArray, FloatArray]:
    """Return the road axis (X, Y), radians in [-pi/2, pi/2] from the ego heading, and its confidence (X, Y), 0..1.

    Edges and markings vote by the structure tensor of their gradients, vehicles by their long axis. The confidence
    is low where votes disagree, as in a junction.

    Args:
        grid: cells.
        drivable: (X, Y) road cells.
        known: (X, Y) cells whose state is known; an edge towards unknown cells has less weight.
        marking: (X, Y) lane markings.
        objects: vehicles, ego frame.
    """
    votes, weight = _edge_votes(drivable, known, marking)
    by_edges, confidence = _smooth(grid, votes, weight)
    for item in objects:
        i, j = (int(v) for v in grid.cell_of(item.centre_m))
        on_map = 0 <= i < grid.shape[0] and 0 <= j < grid.shape[1]
        if not on_map or item.length_m < MIN_VEHICLE_LENGTH_M:
            continue
        doubled = np.exp(2j * item.yaw_rad)
        off_rad = abs(np.angle(doubled * np.conj(by_edges[i, j]))) / 2
        if off_rad < _ALONG_RAD or confidence[i, j] < _CONFIDENT:
            votes[i, j] += _VEHICLE_WEIGHT * doubled
            weight[i, j] += _VEHICLE_WEIGHT
    i, j = np.clip(grid.cell_of([0.0, 0.0]), 0, np.array(grid.shape) - 1).tolist()
    votes[i, j] += _VEHICLE_WEIGHT
    weight[i, j] += _VEHICLE_WEIGHT
    doubled, confidence = _smooth(grid, votes, weight)
    return np.angle(doubled) / 2, confidence


def _edge_votes(drivable: BoolArray, known: BoolArray, marking: BoolArray) -> tuple[ComplexArray, FloatArray]:
    """Return doubled directions along edges and markings, complex (X, Y), and their weights (X, Y)."""
    # An edge towards unknown cells may be the limit of visibility rather than the road edge.
    height = np.where(drivable, 1.0, np.where(known, 0.0, 0.5)).astype(np.float32)
    votes = np.zeros(drivable.shape, np.complex128)
    weight = np.zeros(drivable.shape)
    for layer in (height, marking.astype(np.float32)):
        smooth = cv2.GaussianBlur(layer, (0, 0), 1.0, borderType=cv2.BORDER_REPLICATE)
        # OpenCV's x runs along the last axis of the array, which is y of the grid.
        along_x = cv2.Scharr(smooth, -1, 0, 1, scale=1 / 32, borderType=cv2.BORDER_REPLICATE)
        along_y = cv2.Scharr(smooth, -1, 1, 0, scale=1 / 32, borderType=cv2.BORDER_REPLICATE)
        gradient = along_x + 1j * along_y
        # The road is perpendicular to its gradient; a right angle, doubled, is a change of sign.
        votes -= gradient**2
        weight += np.abs(gradient) ** 2
    return votes, weight


def _smooth(grid: BEVGrid, votes: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Return votes (X, Y) summed over the neighbourhood, and their agreement (X, Y), 0..1."""
    x, y = grid.shape
    layers = np.stack([votes.real, votes.imag, weight], axis=-1).astype(np.float32)
    coarse = cv2.resize(layers, (-(-y // _COARSE), -(-x // _COARSE)), interpolation=cv2.INTER_AREA)
    total = np.zeros_like(coarse)
    for sigma_m, share in ((_NEAR_M, 1.0), (_FAR_M, _FAR_WEIGHT)):
        sigma = sigma_m / grid.cell_m / _COARSE
        total = total + share * cv2.GaussianBlur(coarse, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
    real, imag, all_votes = np.moveaxis(cv2.resize(total, (y, x), interpolation=cv2.INTER_LINEAR), -1, 0)
    doubled = real + 1j * imag
    return doubled, np.abs(doubled) / (all_votes + 1e-12)


def travel_directions(paths: ShortestPaths, axis: FloatArray, start: Pose2D) -> FloatArray:
    """Return the direction of travel (X, Y): the direction of the axis along which the shortest path arrives.

    Paths that drive back from the ego are reversed: traffic arrives at the ego along them. Where a path crosses the
    axis, as in a lane change, the direction of some steps before is kept.
    """
    back = paths.ancestors(_STEPS)
    ahead = np.exp(-1j * start.heading_rad)  # in axes of the start: x is ahead
    direction = np.angle(np.exp(1j * axis) * ahead)
    direction[np.cos(direction) < 0] += np.pi  # cells without a path keep the ego heading
    unit = np.exp(1j * axis.ravel()[paths.cells]) * ahead
    xy = paths.grid.centre_of(np.stack(np.unravel_index(paths.cells, axis.shape), axis=-1))
    xy_c = (xy @ [1, 1j]) * ahead
    step = xy_c - xy_c[back]
    step /= np.maximum(np.abs(step), 1e-9)
    along, with_before = (unit * np.conj(step)).real, (unit * np.conj(unit[back])).real
    ranks = _group_by_rank(back)
    forward = np.ones(len(back), np.bool_)
    sign = np.where(unit.real >= 0, 1.0, -1.0)
    for rank, cells in enumerate(ranks[1:]):
        onward = step[cells].real > -_BACKWARD if rank == 0 else forward[back[cells]]
        forward[cells] = onward | (xy_c[cells].real > xy_c[ranks[0][0]].real)
        arriving = np.sign(along[cells]) * np.where(forward[cells], 1.0, -1.0)
        crosses = (np.abs(along[cells]) < _CROSSING) & (np.abs(with_before[cells]) > _STEADY)
        sign[cells] = np.where(crosses, np.sign(with_before[cells]) * sign[back[cells]], arriving)
    # A path around a vehicle drives back into the corner behind it; the neighbourhood outvotes it.
    votes = np.zeros((*axis.shape, 2), np.float32)
    votes.reshape(-1, 2)[paths.cells] = np.stack([unit.real * sign, unit.imag * sign], axis=-1)
    mean = cv2.GaussianBlur(votes, (0, 0), _SMOOTHING_M / paths.grid.cell_m).reshape(-1, 2)[paths.cells]
    agrees = mean[:, 0] * unit.real + mean[:, 1] * unit.imag >= 0
    direction.ravel()[paths.cells] = np.angle(np.where(agrees, unit, -unit))
    return np.asarray(wrap_angle(direction + start.heading_rad))


def _group_by_rank(back: IntArray) -> list[IntArray]:
    """Return the indices of cells that are none, one, two, ... leaps away from the start."""
    rank = (back != np.arange(len(back))).astype(np.int64)
    while (rank[back] > 0).any():
        rank, back = rank + rank[back], back[back]
    order = np.argsort(rank, kind="stable")
    return np.split(order, np.cumsum(np.bincount(rank))[:-1]) if len(order) else []
