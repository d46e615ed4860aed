"""Where the ego's whole footprint may stand: every cell under it on known, free road, and a margin to vehicles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EGO_LENGTH_M, EGO_WIDTH_M, body_cells
from appocc.grid import BEVGrid
from grounding.scene_object import SceneObject

# What forbids a cell under the footprint; flags, so that several can hold.
OFF_MAP, UNKNOWN, OFF_ROAD, TAKEN = 1, 2, 4, 8
# Free space around the footprint to cells and boxes of vehicles.
MARGIN_M = 0.3
# Headings of places are whole multiples of this, so that the cells under a footprint are known beforehand.
_STEP_RAD = np.pi / 90
# A centre that lies on the rim of the footprint, give or take rounding, lies under it.
_RIM_M = 1e-6
_HALF_M = np.array([EGO_LENGTH_M, EGO_WIDTH_M]) / 2


def whole_steps(heading_rad: FloatArray) -> FloatArray:
    """The nearest headings that a place can have."""
    return np.asarray(np.round(heading_rad / _STEP_RAD) * _STEP_RAD)


@dataclass(frozen=True)
class Footing:
    """What lies in the cells of a map.

    Attributes:
        grid: cells.
        forbids: (X + 2R, Y + 2R) uint8 flags of each cell, with a rim of R cells OFF_MAP all around.
        objects: vehicles.
    """

    grid: BEVGrid
    forbids: np.ndarray[tuple[int, int], np.dtype[np.uint8]]
    objects: tuple[SceneObject, ...]

    @classmethod
    def of(cls, bev: BEVMap, objects: Sequence[SceneObject]) -> Footing:
        """The cells of a map and the vehicles on it."""
        # No camera sees below the ego, but it stands on road that it may stand on.
        below = bev.unseen & body_cells(bev.grid)
        known = (bev.occupancy_valid[ROAD] & bev.occupancy_valid[VEHICLE]) | below
        taken = bev.on[VEHICLE] | covered(bev.grid, objects)
        inner = UNKNOWN * ~known + OFF_ROAD * (known & ~bev.on[ROAD] & ~below) + TAKEN * taken
        rim = _reach(bev.grid.cell_m)
        return cls(bev.grid, np.pad(inner.astype(np.uint8), rim, constant_values=OFF_MAP), tuple(objects))

    @property
    def inner(self) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
        """(X, Y) flags of the map's own cells."""
        rim = _reach(self.grid.cell_m)
        return self.forbids[rim:-rim, rim:-rim]

    def flags(self, cells: IntArray, heading_rad: FloatArray) -> IntArray:
        """What forbids the ego's middle in cells (N, 2) of the map at headings (N,) in whole steps: flags (N,).

        A cell is under the footprint if its centre is. For TAKEN the footprint is grown by the margin.
        """
        rim, width = _reach(self.grid.cell_m), self.forbids.shape[1]
        foot, grown = _offsets(self.grid.cell_m, width)
        turn = np.round(heading_rad / _STEP_RAD).astype(np.int64) % len(foot)
        at = (cells[:, 0] + rim) * width + cells[:, 1] + rim
        flat = self.forbids.ravel()
        under = [np.bitwise_or.reduce(flat[at[:, None] + offsets[turn]], axis=1) for offsets in (foot, grown)]
        flags = (under[0] | (under[1] & TAKEN)).astype(np.int64)
        return np.asarray(flags | OFF_MAP * self._over_the_rim(cells, heading_rad))

    def _over_the_rim(self, cells: IntArray, heading_rad: FloatArray) -> BoolArray:
        """Whether a corner of the footprint leaves the map, if only by part of a cell."""
        cos, sin = np.abs(np.cos(heading_rad)), np.abs(np.sin(heading_rad))
        half = np.stack([_HALF_M[0] * cos + _HALF_M[1] * sin, _HALF_M[0] * sin + _HALF_M[1] * cos], axis=-1)
        low = (cells + 0.5) * self.grid.cell_m - half
        return np.asarray(((low < 0) | (low + 2 * half > np.array(self.grid.shape) * self.grid.cell_m)).any(axis=1))

    def nearest(self, middle_m: FloatArray, heading_rad: float) -> tuple[SceneObject | None, float]:
        """The vehicle whose box is nearest to the ego at a place (2,), None without any, and the gap in metres."""
        if not self.objects:
            return None, np.inf
        gaps = _gaps(*self._boxes, middle_m, np.asarray(heading_rad))
        least = int(np.argmin(gaps))
        return self.objects[least], float(gaps[least])

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Middles (K, 2), headings (K,) and half lengths and widths (K, 2) of all vehicles."""
        middles = np.array([item.centre_m for item in self.objects])
        halves = np.array([[item.length_m, item.width_m] for item in self.objects]) / 2
        return middles, np.array([item.yaw_rad for item in self.objects]), halves


def covered(grid: BEVGrid, objects: Sequence[SceneObject]) -> BoolArray:
    """(X, Y) whether a cell's centre lies in the box of a vehicle."""
    cover = np.zeros(grid.shape, np.bool_)
    for item in objects:
        corners = grid.cell_of(item.footprint())
        (i0, j0), (i1, j1) = np.clip(corners.min(axis=0), 0, None), np.clip(corners.max(axis=0) + 1, 0, None)
        window = cover[i0:i1, j0:j1]
        cells = np.stack(np.meshgrid(np.arange(window.shape[0]), np.arange(window.shape[1]), indexing="ij"), axis=-1)
        window |= item.covers(grid.centre_of(cells + np.array([i0, j0])))
    return cover


def gap_m(item: SceneObject, middle_m: FloatArray, heading_rad: FloatArray) -> FloatArray:
    """Metres (...) between a vehicle and the ego at middles (..., 2) and headings (...), negative where they overlap.

    The widest gap that a line between the two can be laid through; corner to corner they are a little farther apart.
    """
    half = np.array([item.length_m, item.width_m]) / 2
    return _gaps(item.centre_m, np.asarray(item.yaw_rad), half, middle_m, heading_rad)


def _gaps(
    centre_m: FloatArray, yaw_rad: FloatArray, half_m: FloatArray, middle_m: FloatArray, heading_rad: FloatArray
) -> FloatArray:
    """Gaps between boxes and the ego along the four directions of their sides, of which the widest counts."""
    offset = middle_m - centre_m
    turned = heading_rad - yaw_rad
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    gaps = []
    for angle, own, other in ((yaw_rad, half_m, _HALF_M), (heading_rad, _HALF_M, half_m)):
        ux, uy = np.cos(angle), np.sin(angle)
        along = np.abs(offset[..., 0] * ux + offset[..., 1] * uy)
        across = np.abs(offset[..., 1] * ux - offset[..., 0] * uy)
        gaps.append(along - own[..., 0] - other[..., 0] * cos - other[..., 1] * sin)
        gaps.append(across - own[..., 1] - other[..., 0] * sin - other[..., 1] * cos)
    return np.asarray(np.maximum(np.maximum(gaps[0], gaps[1]), np.maximum(gaps[2], gaps[3])))


def _reach(cell_m: float) -> int:
    """Cells from the middle of the ego that its grown footprint can cover."""
    return int(np.hypot(*(_HALF_M + MARGIN_M)) / cell_m) + 1


@cache
def _offsets(cell_m: float, width: int) -> tuple[IntArray, IntArray]:
    """Cells under the ego, itself and grown, (90, M) each, a row for each step of half a turn.

    Numbers from the middle cell on, in arrays that are `width` cells wide; rows are filled up with the middle cell.
    """
    reach = _reach(cell_m)
    cells = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    steps = np.arange(round(np.pi / _STEP_RAD)) * _STEP_RAD
    unit = np.exp(1j * steps)[:, None]
    along = cells[:, 0] * unit.real + cells[:, 1] * unit.imag
    across = cells[:, 1] * unit.real - cells[:, 0] * unit.imag
    tables = []
    for margin_m in (0.0, MARGIN_M):
        half = (_HALF_M + margin_m + _RIM_M) / cell_m
        under = (np.abs(along) <= half[0]) & (np.abs(across) <= half[1])
        table = np.zeros((len(steps), int(under.sum(axis=1).max())), np.int64)
        for row, inside in zip(table, under, strict=True):
            row[: inside.sum()] = cells[inside] @ [width, 1]
        tables.append(table)
    return tables[0], tables[1]
