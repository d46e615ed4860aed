"""One sample's colour BEV: the scene's ground, the sample's vehicles, and what is known of road and lanes."""

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
from appocc.groundtruth.occupancy import Layer, RoadSources, cells_of, lane_layer, road_layer
from appocc.groundtruth.painting import Paint, Painted
from appocc.groundtruth.surface import Surface
from appocc.rasterise import vehicle_owner

# An unknown cell is filled when at least this many of its eight neighbours are known, twice over.
_NEIGHBOURS, _ROUNDS = 5, 2


class Settings(NamedTuple):
    """What a run is asked to do; part of each map's meta, so that a later run knows whether a map is still right."""

    grid: BEVGrid
    paint: Paint

    def as_meta(self) -> dict[str, Any]:
        """JSON form."""
        return {"grid": self.grid.as_array().tolist(), "paint": self.paint, "format": 3}


def compose(sample: SampleInput, sources: RoadSources, painted: Painted | None, settings: Settings) -> BEVMap:
    """The colour BEV of a sample; `painted` holds the colours of its boxes, None where the dataset has no boxes.

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


def ground_colours(grid: BEVGrid, world_from_ego: FloatArray, surface: Surface) -> tuple[Float32Array, BoolArray]:
    """Colours (X, Y, 3) of the ground, means over the fine cells, small holes filled; and which are known (X, Y)."""
    cell, inside = cells_of(grid, world_from_ego, surface.xyz_m[surface.coloured])
    size = grid.shape[0] * grid.shape[1]
    count = np.bincount(cell, minlength=size)
    rgb = surface.rgb[surface.coloured][inside]
    total = np.stack([np.bincount(cell, rgb[:, c], minlength=size) for c in range(3)], axis=1)
    mean = (total / np.maximum(count, 1)[:, None]).reshape(*grid.shape, 3).astype(np.float32)
    return _filled(mean, (count > 0).reshape(grid.shape))


def _filled(rgb: Float32Array, known: BoolArray) -> tuple[Float32Array, BoolArray]:
    """Fill unknown cells that known ones all but surround with the mean of those."""
    ring = np.ones((3, 3))
    for _ in range(_ROUNDS):
        near = ndimage.convolve(known.astype(np.float64), ring, mode="constant")
        fill = ~known & (near >= _NEIGHBOURS)
        for c in range(3):
            total = ndimage.convolve(np.where(known, rgb[..., c], 0.0), ring, mode="constant")
            rgb[fill, c] = total[fill] / near[fill]
        known = known | fill
    return rgb, known


def vehicles_near(sample: SampleInput, grid: BEVGrid) -> BoolArray:
    """(B,) which boxes of a sample are vehicles that may reach into the grid."""
    boxes = sample.boxes_world
    corners = apply(inverse(sample.world_from_ego), boxes.corners())[..., :2]
    low, high = [grid.x_min_m, grid.y_min_m], [grid.x_max_m, grid.y_max_m]
    touches = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
    of_class = np.array([is_vehicle(name) for name in boxes.category], dtype=np.bool_)
    return np.asarray(of_class & touches)


def _vehicles(
    sample: SampleInput, painted: Painted | None, grid: BEVGrid, rgb: Float32Array, known: BoolArray
) -> Layer:
    """The vehicle layer; puts the vehicles' colours into `rgb` and `known` in place."""
    if painted is None:
        nothing = np.zeros(grid.shape, dtype=np.bool_)
        return Layer(nothing, nothing.copy(), "none")
    near = vehicles_near(sample, grid)
    owner = vehicle_owner(grid, sample.boxes_world.select(near).transformed(inverse(sample.world_from_ego)))
    on = owner >= 0
    which = np.flatnonzero(near)[owner[on]]
    rgb[on], known[on] = painted.rgb[which], painted.known[which]
    return Layer(on, np.ones(grid.shape, dtype=np.bool_), "cuboids")
