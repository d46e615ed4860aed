"""The street seen from straight above in the light of the scene: the colour of every cell around the ego."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray, frozen
from appocc.grid import BEVGrid
from appocc.simulation.mesh import Material
from appocc.simulation.rendering.camera_response import tone_map
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.tracing import TOWN
from appocc.simulation.surface import CELL_M
from appocc.simulation.town import Town

# Rays start this far above the highest roof or crown.
_ABOVE_M = 5.0
# A ray through the centre of a cell, and three extra rays; in cells from the centre.
_CENTRE = np.zeros((1, 2))
_AROUND = np.array([[0.32, 0.10], [-0.25, 0.26], [-0.09, -0.33]])
# A cell whose colour (0..255) differs more from a neighbour's contains an edge and needs the extra rays.
_EDGE = 24


@dataclass(frozen=True, eq=False)
class BirdsEyeImage:
    """Colours seen from above, sRGB, under the exposure of the cameras.

    Attributes:
        appearance: (3, X, Y) uint8 without trees.
        covered: (3, X, Y) uint8 with the crowns of trees, which cover the street.
        valid: (X, Y) bool: whether the cell is on the town's ground.
    """

    appearance: ByteArray
    covered: ByteArray
    valid: BoolArray

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.appearance, self.covered, self.valid):
            frozen(array)


def render_birdseye(renderer: Renderer, town: Town, grid: BEVGrid, town_from_ego: FloatArray) -> BirdsEyeImage:
    """Render the mean colours of a grid's cells in the scene the renderer is set to.

    Args:
        renderer: renderer of that town, with its scene set.
        town: the town, for the height of its scenery, its trees and the extent of its ground.
        grid: cells in the ego frame.
        town_from_ego: (4, 4) pose.
    """
    view = _CellRays(renderer, town, grid, town_from_ego)
    every = np.arange(grid.shape[0] * grid.shape[1])
    free = view.radiance(every, _CENTRE, True)
    edges = np.flatnonzero(_find_edges(tone_map(free, renderer.gains).reshape(*grid.shape, 3)))
    free[edges] = (free[edges] + 3 * view.radiance(edges, _AROUND, True)) / 4
    covered = free.copy()
    crowns = np.flatnonzero(_dilate(view.crowns().reshape(grid.shape)))
    covered[crowns] = view.radiance(crowns, np.concatenate([_CENTRE, _AROUND]), False)
    images = [tone_map(light, renderer.gains).reshape(*grid.shape, 3) for light in (free, covered)]
    appearance, with_trees = (np.ascontiguousarray(np.moveaxis(image, 2, 0)) for image in images)
    return BirdsEyeImage(appearance, with_trees, view.on_ground())


class _CellRays:
    """Vertical rays onto the cells of a grid, which are numbered row by row."""

    def __init__(self, renderer: Renderer, town: Town, grid: BEVGrid, town_from_ego: FloatArray) -> None:
        self._renderer, self._town, self._grid, self._pose = renderer, town, grid, town_from_ego
        self._height_m = float(town.solid.vertices_m[:, 2].max(initial=0.0)) + _ABOVE_M
        centres = grid.centres().reshape(-1, 2)
        self._centres = centres @ town_from_ego[:2, :2].T + town_from_ego[:2, 3]

    def _rays(self, cells: IntArray, shift: FloatArray) -> tuple[Float32Array, Float32Array]:
        """Return origins and directions (N, 3) of rays onto cells (N,), `shift` (2,) cells off their centres."""
        origins = np.empty((len(cells), 3), np.float32)
        origins[:, :2] = self._centres[cells] + self._pose[:2, :2] @ (shift * self._grid.cell_m)
        origins[:, 2] = self._height_m
        return origins, np.tile(np.array([0, 0, -1], np.float32), (len(cells), 1))

    def radiance(self, cells: IntArray, shifts: FloatArray, through_leaves: bool) -> Float32Array:
        """Return (N, 3) linear radiance of cells (N,), averaged over rays at the shifts (K, 2)."""
        rays = [self._rays(cells, shift) for shift in shifts]
        origins, directions = (np.concatenate(parts) for parts in zip(*rays, strict=True))
        # Each ray covers its share of the cell.
        spread = self._grid.cell_m / np.sqrt(len(shifts)) / self._height_m
        radiance = self._renderer.radiance(origins, directions, float(spread), through_leaves)
        return np.asarray(radiance.reshape(len(shifts), -1, 3).mean(axis=0), np.float32)

    def crowns(self) -> BoolArray:
        """Return (X * Y,) whether foliage covers the centre of a cell."""
        hits = self._renderer.tracer.nearest(*self._rays(np.arange(len(self._centres)), np.zeros(2)))
        leaves = hits.source == TOWN
        leaves[leaves] = self._town.solid.material[hits.face[leaves]] == Material.FOLIAGE
        return np.asarray(leaves)

    def on_ground(self) -> BoolArray:
        """Return (X, Y) whether the centre of a cell is on the town's ground."""
        place = (self._centres - self._town.ground.low_m) / CELL_M
        high, wide = self._town.ground.label.shape
        return np.asarray(((place >= 0) & (place < [wide, high])).all(axis=1).reshape(self._grid.shape))


def _find_edges(image: ByteArray) -> BoolArray:
    """Return (X, Y) whether a cell of an image (X, Y, 3) differs strongly from a neighbour."""
    level = image.astype(np.int16)
    found = np.zeros(image.shape[:2], np.bool_)
    for axis in (0, 1):
        step = (np.abs(np.diff(level, axis=axis)) > _EDGE).any(axis=2)
        before, after = ([slice(None), slice(None)] for _ in range(2))
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        found[tuple(before)] |= step
        found[tuple(after)] |= step
    return found


def _dilate(flags: BoolArray) -> BoolArray:
    """Dilate flags (X, Y) by one cell in four directions."""
    grown = flags.copy()
    grown[1:] |= flags[:-1]
    grown[:-1] |= flags[1:]
    grown[:, 1:] |= flags[:, :-1]
    grown[:, :-1] |= flags[:, 1:]
    return grown
