"""Which way the road runs at every cell: from its edges, its markings and the vehicles that stand along it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, FloatArray
from appocc.grid import BEVGrid
from grounding.scene_object import SceneObject

# What is seen within some metres counts most; where that is nothing, what is farther away.
_NEAR_M, _FAR_M, _FAR_WEIGHT = 2.8, 8.0, 0.02
# A vehicle says as much as so many cells of a straight edge beside the place; the ego as much.
_VEHICLE_WEIGHT = 6.0
# What is shorter, people and bicycles, stands anyhow.
SHORTEST_M = 2.5
# One that stands across a road that is plain without it says nothing of the road.
_ALONG_RAD = np.radians(30)
_PLAIN = 0.3
# Cells along each side of one in which votes are gathered.
_COARSE = 3

ComplexArray = NDArray[np.complexfloating]


def axes(
    grid: BEVGrid, road: BoolArray, known: BoolArray, lane: BoolArray, objects: Sequence[SceneObject]
) -> tuple[FloatArray, FloatArray]:
    """Axis of the road (X, Y), radians in [-pi/2, pi/2] from the ego's heading, and how sure it is (X, Y), 0..1.

    Edges and markings vote by the structure tensor of their gradients, each vehicle by its own axis. Where the votes
    contradict each other, as in a junction, the axis is not sure.

    Args:
        grid: cells.
        road: (X, Y) what is road.
        known: (X, Y) where that is known; an edge to what is unknown says less.
        lane: (X, Y) markings.
        objects: vehicles, ego frame.
    """
    votes, weight = _edge_votes(road, known, lane)
    plain, sure = _smoothed(grid, votes, weight)
    for item in objects:
        i, j = (int(v) for v in grid.cell_of(item.centre_m))
        on_map = 0 <= i < grid.shape[0] and 0 <= j < grid.shape[1]
        if not on_map or item.length_m < SHORTEST_M:
            continue
        doubled = np.exp(2j * item.yaw_rad)
        off_rad = abs(np.angle(doubled * np.conj(plain[i, j]))) / 2
        if off_rad < _ALONG_RAD or sure[i, j] < _PLAIN:
            votes[i, j] += _VEHICLE_WEIGHT * doubled
            weight[i, j] += _VEHICLE_WEIGHT
    i, j = np.clip(grid.cell_of([0.0, 0.0]), 0, np.array(grid.shape) - 1).tolist()
    votes[i, j] += _VEHICLE_WEIGHT
    weight[i, j] += _VEHICLE_WEIGHT
    doubled, sure = _smoothed(grid, votes, weight)
    return np.angle(doubled) / 2, sure


def _edge_votes(road: BoolArray, known: BoolArray, lane: BoolArray) -> tuple[ComplexArray, FloatArray]:
    """Doubled directions along edges and markings, complex (X, Y), and their weights."""
    # An edge to the unknown may be the end of what was seen and not of the road.
    height = np.where(road, 1.0, np.where(known, 0.0, 0.5)).astype(np.float32)
    votes = np.zeros(road.shape, np.complex128)
    weight = np.zeros(road.shape)
    for layer in (height, lane.astype(np.float32)):
        smooth = cv2.GaussianBlur(layer, (0, 0), 1.0, borderType=cv2.BORDER_REPLICATE)
        # OpenCV's x runs along the last axis of the array, which is y of the grid.
        along_x = cv2.Scharr(smooth, -1, 0, 1, scale=1 / 32, borderType=cv2.BORDER_REPLICATE)
        along_y = cv2.Scharr(smooth, -1, 1, 0, scale=1 / 32, borderType=cv2.BORDER_REPLICATE)
        gradient = along_x + 1j * along_y
        # A road runs across its gradient: turned by a right angle, which doubled is the opposite.
        votes -= gradient**2
        weight += np.abs(gradient) ** 2
    return votes, weight


def _smoothed(grid: BEVGrid, votes: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Votes (X, Y) and how well they agree, gathered over the neighbourhood."""
    x, y = grid.shape
    layers = np.stack([votes.real, votes.imag, weight], axis=-1).astype(np.float32)
    # A blur that wide needs no fine cells.
    coarse = cv2.resize(layers, (-(-y // _COARSE), -(-x // _COARSE)), interpolation=cv2.INTER_AREA)
    total = np.zeros_like(coarse)
    for sigma_m, share in ((_NEAR_M, 1.0), (_FAR_M, _FAR_WEIGHT)):
        sigma = sigma_m / grid.cell_m / _COARSE
        total = total + share * cv2.GaussianBlur(coarse, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
    real, imag, all_votes = np.moveaxis(cv2.resize(total, (y, x), interpolation=cv2.INTER_LINEAR), -1, 0)
    doubled = real + 1j * imag
    return doubled, np.abs(doubled) / (all_votes + 1e-12)
