"""Road and lane layers of a sample, each from the best available source."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.groundtruth.surface import GroundSurface
from appocc.nuscenes.maps import Area, MaskWindow, VectorMap
from appocc.rasterise import LANE_SHARE, ROAD_SHARE, ROUNDING, line_cover, polygon_cover

_MARKING_WIDTH_M = 0.15
# Minimum number of labelled fine cells (16 per cell of 0.4 m) for a valid cell.
_MIN_LABELLED_CELLS = 3
_SUBSAMPLES = 4


class OccupancyLayer(NamedTuple):
    """One class: occupied cells (X, Y), valid cells (X, Y), and the source."""

    on: BoolArray
    valid: BoolArray
    source: str


class RoadSources(NamedTuple):
    """Sources of road and lanes around a scene; `surface_labels`: has road labels, has lane labels, label set."""

    vector: VectorMap | None
    mask: MaskWindow | None
    surface: GroundSurface
    surface_labels: tuple[bool, bool, str]


def road_layer(grid: BEVGrid, world_from_ego: FloatArray, sources: RoadSources) -> OccupancyLayer:
    """Return the drivable area from the map expansion, else the mask, else labelled LiDAR points, else unknown."""
    if sources.vector is not None and sources.vector.drivable is not None:
        return _vector_road(grid, world_from_ego, sources.vector.drivable)
    if sources.mask is not None:
        return mask_road(grid, world_from_ego, sources.mask)
    if sources.surface_labels[0]:
        return _labelled(grid, world_from_ego, sources, "road", ROAD_SHARE)
    return _unknown(grid)


def lane_layer(grid: BEVGrid, world_from_ego: FloatArray, sources: RoadSources) -> OccupancyLayer:
    """Return the lane markings from the map expansion, else labelled LiDAR points, else unknown."""
    if sources.vector is not None and sources.vector.markings is not None:
        return vector_lane(grid, world_from_ego, sources.vector.markings)
    if sources.surface_labels[1]:
        return _labelled(grid, world_from_ego, sources, "lane", LANE_SHARE)
    return _unknown(grid)


def _unknown(grid: BEVGrid) -> OccupancyLayer:
    empty = np.zeros(grid.shape, dtype=np.bool_)
    return OccupancyLayer(empty, empty.copy(), "none")


def _to_ego(world_from_ego: FloatArray, xy_world_m: FloatArray) -> FloatArray:
    """Transform world points (N, 2) at the ground height of the ego to the ego frame (N, 2)."""
    height = np.full((len(xy_world_m), 1), world_from_ego[2, 3])
    return apply(inverse(world_from_ego), np.hstack([xy_world_m, height]))[:, :2]


def _vector_road(grid: BEVGrid, world_from_ego: FloatArray, drivable: tuple[Area, ...]) -> OccupancyLayer:
    cover = np.zeros(grid.shape)
    for outline, holes in drivable:
        area = polygon_cover(grid, _to_ego(world_from_ego, outline))
        for hole in holes:
            area -= polygon_cover(grid, _to_ego(world_from_ego, hole))
        cover += np.maximum(area, 0.0)
    return OccupancyLayer(cover >= ROAD_SHARE - ROUNDING, np.ones(grid.shape, dtype=np.bool_), "map_expansion")


def touched_cells(grid: BEVGrid, world_from_ego: FloatArray, outlines: Sequence[FloatArray]) -> BoolArray:
    """Return the cells (X, Y) that polygons (K, 2), world frame, touch."""
    touched = np.zeros(grid.shape, dtype=np.bool_)
    for outline in outlines:
        touched |= np.abs(polygon_cover(grid, _to_ego(world_from_ego, outline))) > ROUNDING
    return touched


def vector_lane(grid: BEVGrid, world_from_ego: FloatArray, markings: tuple[FloatArray, ...]) -> OccupancyLayer:
    """Return the cells under painted lines (K, 2), world frame."""
    cover = np.zeros(grid.shape)
    for line in markings:
        cover += line_cover(grid, _to_ego(world_from_ego, line), _MARKING_WIDTH_M)
    return OccupancyLayer(cover >= LANE_SHARE - ROUNDING, np.ones(grid.shape, dtype=np.bool_), "map_expansion")


def mask_road(grid: BEVGrid, world_from_ego: FloatArray, mask: MaskWindow) -> OccupancyLayer:
    """Return the road from the drivable share of 4 x 4 points per cell; valid where the mask knows at least half."""
    part = (np.arange(_SUBSAMPLES) + 0.5) / _SUBSAMPLES - 0.5
    offset = np.stack(np.meshgrid(part, part, indexing="ij"), axis=-1).reshape(-1, 2) * grid.cell_m
    places = grid.centres()[:, :, None] + offset
    flat = np.pad(places, ((0, 0), (0, 0), (0, 0), (0, 1)))
    drivable, known = mask.sample(apply(world_from_ego, flat)[..., :2])
    seen = known.sum(axis=2)
    on = drivable.sum(axis=2) >= ROAD_SHARE * np.maximum(seen, 1)
    valid = seen >= _SUBSAMPLES**2 / 2
    return OccupancyLayer(on & valid, valid, f"mask ({mask.source})" if mask.source else "mask")


def _labelled(
    grid: BEVGrid, world_from_ego: FloatArray, sources: RoadSources, name: str, share: float
) -> OccupancyLayer:
    """Return a class from the share of labelled fine cells with its label; valid with enough labelled fine cells."""
    surface = sources.surface
    cell, inside = cells_of(grid, world_from_ego, surface.xyz_m[surface.labelled])
    labelled = (surface.road if name == "road" else surface.lane)[surface.labelled][inside] >= 0.5
    size = grid.shape[0] * grid.shape[1]
    seen = np.bincount(cell, minlength=size)
    on = np.bincount(cell, labelled, minlength=size) >= share * np.maximum(seen, 1)
    valid = seen >= _MIN_LABELLED_CELLS
    label_set = sources.surface_labels[2]
    return OccupancyLayer(
        (on & valid).reshape(grid.shape), valid.reshape(grid.shape), f"semantic_lidar ({label_set})"
    )


def cells_of(grid: BEVGrid, world_from_ego: FloatArray, xyz_world_m: FloatArray) -> tuple[IntArray, BoolArray]:
    """Return the flat cell indices of the world points (N, 3) inside the grid, and the mask of these points."""
    cell = grid.cell_of(apply(inverse(world_from_ego), xyz_world_m)[:, :2])
    inside = grid.contains(cell)
    return cell[inside, 0] * grid.shape[1] + cell[inside, 1], inside
