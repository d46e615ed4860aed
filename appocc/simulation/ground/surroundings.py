"""Kerbs, pavements, medians and islands next to the streets."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.checks import ByteArray, Float32Array
from appocc.simulation.ground.areas import disc_kernel, find_islands, road_mask
from appocc.simulation.surface import CELL_M, Surface

_KERB_M = 0.2
# Distance to the nearest street is computed in coarser cells and upsampled in bands of rows.
_COARSE, _BAND = 2, 256
_ISLAND_COARSE = 4
# Ground enclosed by roads is an island (grass, no pavement) up to this area or this half width.
_ISLAND_M2, _ISLAND_HALF_M, _LARGEST_ISLAND_M2 = 900.0, 6.0, 6000.0
_PAVED_HALF_M = 1.0


def draw_surroundings(label: ByteArray, pavement_m: float) -> None:
    """Draw pavements, islands and kerbs around the road drawn before."""
    road = road_mask(label)
    distance_m = _distance_to_road_m(road)
    for first in range(0, len(distance_m), _BAND):
        rows = slice(first * _COARSE, min((first + _BAND) * _COARSE, len(label)))
        fine_m = cv2.resize(
            distance_m[first : first + _BAND], label[rows].shape[::-1], interpolation=cv2.INTER_LINEAR
        )
        label[rows][(fine_m < pavement_m) & (road[rows] == 0)] = Surface.PAVEMENT
    _draw_islands(label, road, distance_m)
    draw_kerb(label)


def draw_kerb(label: ByteArray) -> None:
    """Draw kerb stones around all road."""
    road = road_mask(label)
    kerb = np.asarray(cv2.dilate(road, disc_kernel(_KERB_M)), dtype=np.uint8)
    kerb -= road
    label[kerb.view(np.bool_)] = Surface.KERB


def _distance_to_road_m(road: ByteArray) -> Float32Array:
    """Return the distance to the nearest road, metres, in coarse cells."""
    size = tuple(-(-n // _COARSE) for n in road.shape[::-1])
    small = cv2.resize(road, size, interpolation=cv2.INTER_AREA)
    away = np.asarray(cv2.distanceTransform(1 - small, cv2.DIST_L2, 5), dtype=np.float32)
    away *= _COARSE * CELL_M
    return away


def _draw_islands(label: ByteArray, road: ByteArray, distance_m: Float32Array) -> None:
    """Draw medians and the islands of roundabouts: grass, or paved where they are narrow."""
    step = _ISLAND_COARSE // _COARSE
    for rows, columns, inside in find_islands(road, _ISLAND_COARSE, 0.0, _LARGEST_ISLAND_M2):
        free = inside & (road[rows, columns] == 0)
        coarse = distance_m[_shrink(rows, _COARSE), _shrink(columns, _COARSE)][::step, ::step]
        mine = inside[::_ISLAND_COARSE, ::_ISLAND_COARSE][: coarse.shape[0], : coarse.shape[1]]
        half_m = float(coarse[: mine.shape[0], : mine.shape[1]][mine].max(initial=0.0))
        if free.sum() * CELL_M**2 <= _ISLAND_M2 or half_m <= _ISLAND_HALF_M:
            label[rows, columns][free] = Surface.PAVEMENT if half_m < _PAVED_HALF_M else Surface.GRASS


def _shrink(span: slice, factor: int) -> slice:
    return slice(span.start // factor, -(-span.stop // factor))
