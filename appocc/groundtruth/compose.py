"""Composition of the BEV map of a sample from the ground of the scene, vehicles, road and lanes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from appocc.bevmap import BEVMap
from appocc.boxes import is_vehicle
from appocc.checks import BoolArray, Float32Array, FloatArray
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.groundtruth.inputs import SampleInput
from appocc.groundtruth.occupancy import OccupancyLayer, RoadSources, cells_of, lane_layer, road_layer, touched_cells
from appocc.groundtruth.painting import BoxColours, PaintMethod
from appocc.groundtruth.surface import GroundSurface
from appocc.rasterise import vehicle_owner

# An unknown cell is filled if at least this many of its eight neighbours are known; repeated.
_MIN_NEIGHBOURS, _FILL_PASSES = 5, 2


class GroundTruthSettings(NamedTuple):
    """Settings of a run, stored in the meta of each map, so that a later run finds outdated maps."""

    grid: BEVGrid
    paint: PaintMethod

    def as_meta(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {"grid": self.grid.as_array().tolist(), "paint": self.paint, "format": 3}


def compose_map(
    sample: SampleInput, sources: RoadSources, painted: BoxColours | None, settings: GroundTruthSettings
) -> BEVMap:
    """Compose the BEV map of a sample; `painted` holds the colours of its boxes, None if the dataset has no boxes.

    Raises:
        DataError: if an image or a sweep of the sample is damaged.
    """
    grid = settings.grid
    ground, known = ground_colours(grid, sample.world_from_ego, sources.surface)
    road = road_layer(grid, sample.world_from_ego, sources)
    lane = lane_layer(grid, sample.world_from_ego, sources)
    vehicle = _vehicles(sample, painted, grid, ground, known)
    layers = (road, vehicle, lane)
    return BEVMap(
        grid,
        np.stack([layer.on for layer in layers]).astype(np.float32),
        np.stack([layer.valid for layer in layers]),
        np.moveaxis(np.where(known[..., None], np.round(ground), 0), -1, 0).astype(np.uint8),
        known,
        {
            "token": sample.token,
            "timestamp_us": sample.timestamp_us,
            "sources": {
                "road": road.source,
                "vehicle": vehicle.source,
                "lane": lane.source,
                "appearance_static": "lidar" if len(sources.surface.xyz_m) else "none",
                "appearance_vehicle": f"cuboids ({settings.paint})" if painted is not None else "none",
            },
            "settings": settings.as_meta(),
        },
    )


def ground_colours(
    grid: BEVGrid, world_from_ego: FloatArray, surface: GroundSurface
) -> tuple[Float32Array, BoolArray]:
    """Return ground colours (X, Y, 3), means over fine cells with small holes filled, and their validity (X, Y)."""
    cell, inside = cells_of(grid, world_from_ego, surface.xyz_m[surface.coloured])
    size = grid.shape[0] * grid.shape[1]
    count = np.bincount(cell, minlength=size)
    rgb = surface.rgb[surface.coloured][inside]
    total = np.stack([np.bincount(cell, rgb[:, c], minlength=size) for c in range(3)], axis=1)
    mean = (total / np.maximum(count, 1)[:, None]).reshape(*grid.shape, 3).astype(np.float32)
    return _filled(mean, (count > 0).reshape(grid.shape))


def _filled(rgb: Float32Array, known: BoolArray) -> tuple[Float32Array, BoolArray]:
    """Fill unknown cells that known cells mostly surround with the mean of these."""
    ring = np.ones((3, 3))
    for _ in range(_FILL_PASSES):
        near = ndimage.convolve(known.astype(np.float64), ring, mode="constant")
        fill = ~known & (near >= _MIN_NEIGHBOURS)
        for c in range(3):
            total = ndimage.convolve(np.where(known, rgb[..., c], 0.0), ring, mode="constant")
            rgb[fill, c] = total[fill] / near[fill]
        known = known | fill
    return rgb, known


def vehicles_near(sample: SampleInput, grid: BEVGrid) -> BoolArray:
    """Return the (B,) mask of boxes of a sample that are vehicles and may overlap the grid."""
    boxes = sample.boxes_world
    corners = apply(inverse(sample.world_from_ego), boxes.corners())[..., :2]
    low, high = [grid.x_min_m, grid.y_min_m], [grid.x_max_m, grid.y_max_m]
    touches = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
    of_class = np.array([is_vehicle(name) for name in boxes.category], dtype=np.bool_)
    return np.asarray(of_class & touches)


def _vehicles(
    sample: SampleInput, painted: BoxColours | None, grid: BEVGrid, rgb: Float32Array, known: BoolArray
) -> OccupancyLayer:
    """Return the vehicle layer, unknown in no-label zones; write their colours to `rgb` and `known` in place."""
    if painted is None:
        empty = np.zeros(grid.shape, dtype=np.bool_)
        return OccupancyLayer(empty, empty.copy(), "none")
    near = vehicles_near(sample, grid)
    owner = vehicle_owner(grid, sample.boxes_world.select(near).transformed(inverse(sample.world_from_ego)))
    on = owner >= 0
    which = np.flatnonzero(near)[owner[on]]
    rgb[on], known[on] = painted.rgb[which], painted.known[which]
    unlabelled = touched_cells(grid, sample.world_from_ego, sample.no_label_zones)
    return OccupancyLayer(on, on | ~unlabelled, "cuboids")
