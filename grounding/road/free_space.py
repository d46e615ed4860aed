"""Free space: at which poses the ego footprint covers only known, free road cells, with a margin to vehicles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.grid import BEVGrid
from grounding.road.style import DEFAULT_STYLE
from grounding.scene_object import SceneObject

# Flags for what makes a pose invalid; several can hold at once.
OFF_MAP, UNKNOWN, OFF_ROAD, TAKEN = 1, 2, 4, 8
# Headings are whole multiples of this, so that the cells under a footprint can be tabulated.
_STEP_RAD = np.pi / 90
# Tolerance for cell centres on the border of the footprint.
_BORDER_M = 1e-6


def round_heading(heading_rad: FloatArray) -> FloatArray:
    """Round headings to whole multiples of the heading step."""
    return np.asarray(np.round(heading_rad / _STEP_RAD) * _STEP_RAD)


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Which cells of a map the ego footprint may cover.

    Attributes:
        grid: cells.
        ego: size of the ego vehicle.
        padded_flags: (X + 2R, Y + 2R) uint8 flags of the cells, with a border of R cells OFF_MAP on all sides.
        objects: vehicles.
        margin_m: margin of the footprint to vehicle cells and boxes.
    """

    grid: BEVGrid
    ego: EgoVehicle
    padded_flags: np.ndarray[tuple[int, int], np.dtype[np.uint8]]
    objects: tuple[SceneObject, ...]
    margin_m: float

    @classmethod
    def from_map(
        cls, bev: BEVMap, objects: Sequence[SceneObject], ego: EgoVehicle, margin_m: float = DEFAULT_STYLE.clearance_m
    ) -> FreeSpace:
        """Return the free space of a map and the vehicles on it, to which the ego keeps a margin."""
        # No camera sees the cells below the ego; they count as known road.
        below = bev.unseen & ego.body_cells(bev.grid)
        known = (bev.occupancy_valid[ROAD] & bev.occupancy_valid[VEHICLE]) | below
        taken = bev.on[VEHICLE] | cover_cells(bev.grid, objects)
        flags = UNKNOWN * ~known + OFF_ROAD * (known & ~bev.on[ROAD] & ~below) + TAKEN * taken
        border = _reach(bev.grid.cell_m, ego, margin_m)
        padded = np.pad(flags.astype(np.uint8), border, constant_values=OFF_MAP)
        return cls(bev.grid, ego, padded, tuple(objects), margin_m)

    def without(self, some: Sequence[SceneObject], under: BoolArray) -> FreeSpace:
        """Return the free space without some vehicles, which take the cells `under` (X, Y)."""
        border = _reach(self.grid.cell_m, self.ego, self.margin_m)
        padded = self.padded_flags & np.where(np.pad(under, border), 255 - TAKEN, 255).astype(np.uint8)
        return replace(self, padded_flags=padded, objects=tuple(one for one in self.objects if one not in some))

    @property
    def cell_flags(self) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
        """(X, Y) flags of the cells of the map."""
        border = _reach(self.grid.cell_m, self.ego, self.margin_m)
        return self.padded_flags[border:-border, border:-border]

    def flags(self, cells: IntArray, heading_rad: FloatArray) -> IntArray:
        """Return flags (N,) of ego poses with the centre in cells (N, 2) and rounded headings (N,).

        A cell is under the footprint if its centre is. For TAKEN the footprint is grown by the margin.
        """
        border, width = _reach(self.grid.cell_m, self.ego, self.margin_m), self.padded_flags.shape[1]
        footprint, grown = _footprint_offsets(self.grid.cell_m, width, self.ego, self.margin_m)
        turn = np.round(heading_rad / _STEP_RAD).astype(np.int64) % len(footprint)
        at = (cells[:, 0] + border) * width + cells[:, 1] + border
        flat = self.padded_flags.ravel()
        under = [np.bitwise_or.reduce(flat[at[:, None] + offsets[turn]], axis=1) for offsets in (footprint, grown)]
        flags = (under[0] | (under[1] & TAKEN)).astype(np.int64)
        return np.asarray(flags | OFF_MAP * self._leaves_map(cells, heading_rad))

    def _leaves_map(self, cells: IntArray, heading_rad: FloatArray) -> BoolArray:
        """(N,) whether a corner of the footprint is outside the map, even by part of a cell."""
        cos, sin = np.abs(np.cos(heading_rad)), np.abs(np.sin(heading_rad))
        length, width = _half_size_m(self.ego)
        half = np.stack([length * cos + width * sin, length * sin + width * cos], axis=-1)
        low = (cells + 0.5) * self.grid.cell_m - half
        return np.asarray(((low < 0) | (low + 2 * half > np.array(self.grid.shape) * self.grid.cell_m)).any(axis=1))

    def nearest_object(self, centre_m: FloatArray, heading_rad: float) -> tuple[SceneObject | None, float]:
        """Return the vehicle nearest to the ego at a pose, None without vehicles, and the gap in metres."""
        if not self.objects:
            return None, np.inf
        gaps = _box_gaps_m(*self._boxes, _half_size_m(self.ego), centre_m, np.asarray(heading_rad))
        least = int(np.argmin(gaps))
        return self.objects[least], float(gaps[least])

    def is_clear(self, centre_m: FloatArray, heading_rad: float) -> bool:
        """Return whether the ego at a pose keeps the margin to all vehicles."""
        return self.nearest_object(centre_m, heading_rad)[1] >= self.margin_m

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Centres (K, 2), headings (K,) and half sizes (K, 2) of all vehicles."""
        centres = np.array([item.centre_m for item in self.objects])
        halves = np.array([[item.length_m, item.width_m] for item in self.objects]) / 2
        return centres, np.array([item.yaw_rad for item in self.objects]), halves


def cover_cells(grid: BEVGrid, objects: Sequence[SceneObject]) -> BoolArray:
    """Return which cells (X, Y) have their centre inside the box of a vehicle."""
    cover = np.zeros(grid.shape, np.bool_)
    for item in objects:
        corners = grid.cell_of(item.footprint())
        (i0, j0), (i1, j1) = np.clip(corners.min(axis=0), 0, None), np.clip(corners.max(axis=0) + 1, 0, None)
        window = cover[i0:i1, j0:j1]
        cells = np.stack(np.meshgrid(np.arange(window.shape[0]), np.arange(window.shape[1]), indexing="ij"), axis=-1)
        window |= item.covers(grid.centre_of(cells + np.array([i0, j0])))
    return cover


def gap_m(item: SceneObject, ego: EgoVehicle, centre_m: FloatArray, heading_rad: FloatArray) -> FloatArray:
    """Return the gap (...) between a vehicle and the ego at centres (..., 2) and headings (...), metres.

    It is the widest gap along the normals of both boxes (separating axes), negative where they overlap. Corner to
    corner, the true distance is slightly larger.
    """
    half = np.array([item.length_m, item.width_m]) / 2
    return _box_gaps_m(item.centre_m, np.asarray(item.yaw_rad), half, _half_size_m(ego), centre_m, heading_rad)


def _box_gaps_m(
    centre_m: FloatArray,
    yaw_rad: FloatArray,
    half_m: FloatArray,
    ego_half_m: FloatArray,
    ego_centre_m: FloatArray,
    ego_heading_rad: FloatArray,
) -> FloatArray:
    """Return the widest gap between boxes and the ego along the four normals of their sides."""
    offset = ego_centre_m - centre_m
    turned = ego_heading_rad - yaw_rad
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    gaps = []
    for angle, own, other in ((yaw_rad, half_m, ego_half_m), (ego_heading_rad, ego_half_m, half_m)):
        ux, uy = np.cos(angle), np.sin(angle)
        along = np.abs(offset[..., 0] * ux + offset[..., 1] * uy)
        across = np.abs(offset[..., 1] * ux - offset[..., 0] * uy)
        gaps.append(along - own[..., 0] - other[..., 0] * cos - other[..., 1] * sin)
        gaps.append(across - own[..., 1] - other[..., 0] * sin - other[..., 1] * cos)
    return np.asarray(np.maximum(np.maximum(gaps[0], gaps[1]), np.maximum(gaps[2], gaps[3])))


def _half_size_m(ego: EgoVehicle) -> FloatArray:
    """(2,) half of length and width."""
    return np.array([ego.length_m, ego.width_m]) / 2


def _reach(cell_m: float, ego: EgoVehicle, margin_m: float) -> int:
    """Return how many cells from its centre the grown footprint can reach."""
    return int(np.hypot(*(_half_size_m(ego) + margin_m)) / cell_m) + 1


@cache
def _footprint_offsets(cell_m: float, width: int, ego: EgoVehicle, margin_m: float) -> tuple[IntArray, IntArray]:
    """Return the cells under the footprint and under the grown one, (90, M) each, one row per step of half a turn.

    Cells are flat offsets from the centre cell in arrays `width` cells wide; rows are padded with the centre cell.
    """
    reach = _reach(cell_m, ego, margin_m)
    cells = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    steps = np.arange(round(np.pi / _STEP_RAD)) * _STEP_RAD
    unit = np.exp(1j * steps)[:, None]
    along = cells[:, 0] * unit.real + cells[:, 1] * unit.imag
    across = cells[:, 1] * unit.real - cells[:, 0] * unit.imag
    tables = []
    for grown_m in (0.0, margin_m):
        half = (_half_size_m(ego) + grown_m + _BORDER_M) / cell_m
        under = (np.abs(along) <= half[0]) & (np.abs(across) <= half[1])
        table = np.zeros((len(steps), int(under.sum(axis=1).max())), np.int64)
        for row, inside in zip(table, under, strict=True):
            row[: inside.sum()] = cells[inside] @ [width, 1]
        tables.append(table)
    return tables[0], tables[1]
