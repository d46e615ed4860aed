"""Packed objects: annotated boxes as rows of numbers, with the paint of vehicles read from the true map."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import ByteArray, Float32Array, FloatArray, IntArray
from appocc.geometry import yaw_of
from appocc.objects import KINDS, PEOPLE, kind_of
from appocc.rasterise import vehicle_owner

# Largest number of objects of a sample, the nearest ones; their indices fit into a byte.
MAX_OBJECTS = 96
# Columns of a row.
KIND, XY, Z, WLH, YAW, VELOCITY, RGB = 0, slice(1, 3), 3, slice(4, 7), 7, slice(8, 10), slice(10, 13)
COLUMNS = 13


def pack_objects(boxes_ego: Boxes, bev: BEVMap) -> tuple[Float32Array, ByteArray]:
    """Return the objects of a sample inside its map, the nearest first, and the vehicle of each cell.

    The paint of a vehicle is the median colour of its cells in the true map.

    Returns:
        (K, COLUMNS) rows, K <= MAX_OBJECTS, and (X, Y) 1 + row of the vehicle that covers the cell, 0 for none.
    """
    kinds = [kind_of(category) for category in boxes_ego.category]
    known = np.array([kind is not None for kind in kinds], np.bool_)
    inside = bev.grid.contains(bev.grid.cell_of(boxes_ego.centre_m[:, :2]))
    distance = np.linalg.norm(boxes_ego.centre_m[:, :2], axis=1)
    order = np.argsort(distance, kind="stable")
    chosen = order[(known & inside)[order]][:MAX_OBJECTS]
    kept = boxes_ego.select(chosen)
    rows = np.full((len(kept), COLUMNS), np.nan, np.float32)
    rows[:, KIND] = [KINDS.index(kinds[i] or "") for i in chosen]
    rows[:, XY], rows[:, Z], rows[:, WLH] = kept.centre_m[:, :2], kept.centre_m[:, 2], kept.size_wlh_m
    rows[:, YAW], rows[:, VELOCITY] = yaw_of(kept.rotation), kept.velocity_mps
    vehicles = np.flatnonzero([kinds[i] not in PEOPLE for i in chosen])
    owner = _vehicle_cells(kept, vehicles, bev)
    rows[:, RGB] = _paints(owner, len(kept), bev)
    return rows, owner


def _vehicle_cells(boxes: Boxes, vehicles: IntArray, bev: BEVMap) -> ByteArray:
    """Return (X, Y) 1 + index of the vehicle among the boxes, 0 where there is none."""
    number = vehicle_owner(bev.grid, boxes.select(vehicles))
    owner = np.append(vehicles + 1, 0)[number]  # -1 takes the last
    return np.asarray(owner * ((bev.occupancy[VEHICLE] >= 0.5) & bev.occupancy_valid[VEHICLE]), np.uint8)


def _paints(owner: ByteArray, count: int, bev: BEVMap) -> FloatArray:
    """Return the median colours (count, 3) of the cells of each vehicle; NaN without known colours."""
    paints = np.full((count, 3), np.nan)
    known = owner * bev.appearance_valid
    for number in np.unique(known[known > 0]).tolist():
        paints[number - 1] = np.median(bev.appearance[:, known == number], axis=1)
    return paints


def move_objects(rows: Float32Array, new_from_ego: FloatArray) -> Float32Array:
    """Transform rows to an ego frame rotated about z and shifted on the ground."""
    moved = rows.copy()
    rotation = new_from_ego[:2, :2]
    moved[:, XY] = rows[:, XY] @ rotation.T + new_from_ego[:2, 3]
    moved[:, VELOCITY] = rows[:, VELOCITY] @ rotation.T
    moved[:, YAW] = rows[:, YAW] + yaw_of(new_from_ego)
    return moved


def mirror_objects(rows: Float32Array) -> Float32Array:
    """Mirror rows at the plane y = 0."""
    signs = np.ones(COLUMNS, np.float32)
    signs[[XY.stop - 1, YAW, VELOCITY.stop - 1]] = -1
    return rows * signs


def repaint_objects(rows: Float32Array, recolour: Callable[[ByteArray], ByteArray]) -> Float32Array:
    """Return rows with known paints changed by a function of colours (H, W, 3); unknown paints stay unknown."""
    repainted, known = rows.copy(), np.isfinite(rows[:, RGB]).all(axis=1)
    if known.any():
        repainted[known, RGB] = recolour(np.rint(rows[known, RGB]).astype(np.uint8)[None])[0]
    return repainted
