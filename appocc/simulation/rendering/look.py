"""Recoloured materials of a town: the ground, the buildings and the plants of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import ByteArray, Float32Array, frozen
from appocc.nuscenes.view_targets import ViewClass
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.rendering.compiled import kernel
from appocc.simulation.rendering.noise import TILE
from appocc.simulation.surface import Ground

# Buildings take turns with this many recolourings, by their number; leaves and wood have one each.
BUILDINGS = 16
_LEAVES, _WOOD = BUILDINGS, BUILDINGS + 1


@dataclass(frozen=True, eq=False)
class Look:
    """Materials of a scene.

    Attributes:
        ground: (256, 3, 256) uint8 new sRGB value by `Surface`, channel and old value.
        scenery: (G, 3, 256) uint8 the same by group: buildings in turn, leaves, wood.
        blotch: strength of blotches on the ground, 0 for none.
        blotch_cells: ground cells per cell of the noise tile.
        blotch_start: rows and columns by which the noise tile is shifted.
    """

    ground: ByteArray
    scenery: ByteArray
    blotch: float
    blotch_cells: int
    blotch_start: tuple[int, int]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        frozen(self.ground)
        frozen(self.scenery)

    def recolour_ground(self, ground: Ground, noise: Float32Array) -> Ground:
        """Return the ground in the colours of this look; labels stay."""
        tile = np.roll(noise, self.blotch_start, axis=(0, 1))
        colour = _recolour(ground.label, ground.colour, self.ground, tile, self.blotch, self.blotch_cells)
        return Ground(ground.low_m, ground.label, colour)

    def recolour_scenery(self, scenery: Mesh, kind: ByteArray) -> ByteArray:
        """Return the tints (F, 3) uint8 of the scenery's faces in the colours of this look.

        Args:
            scenery: static mesh of the town.
            kind: (F,) uint8 `ViewClass` of its faces; only buildings and vegetation change.
        """
        group = np.full(len(kind), -1)
        group[kind == ViewClass.BUILDING] = scenery.tag[kind == ViewClass.BUILDING] % BUILDINGS
        group[kind == ViewClass.VEGETATION] = _LEAVES
        group[scenery.material == Material.BARK] = _WOOD
        changed = self.scenery[group[:, None], np.arange(3), scenery.tint]
        return np.where(group[:, None] < 0, scenery.tint, changed)


@kernel
def _recolour(
    label: ByteArray, colour: ByteArray, table: ByteArray, noise: Float32Array, blotch: float, size: int
) -> ByteArray:
    """Return the ground's colours (H, W, 3) by table, then lighter and darker by noise of `size` cells."""
    result = np.empty_like(colour)
    for row in range(label.shape[0]):
        above, b = (row // size) % TILE, (row % size) / size
        below = (above + 1) % TILE
        for column in range(label.shape[1]):
            left, a = (column // size) % TILE, (column % size) / size
            right = (left + 1) % TILE
            first = noise[above, left] * (1 - a) + noise[above, right] * a
            second = noise[below, left] * (1 - a) + noise[below, right] * a
            factor = 1 + blotch * (first * (1 - b) + second * b - 0.5)
            for k in range(3):
                value = table[label[row, column], k, colour[row, column, k]] * factor
                result[row, column, k] = np.uint8(min(value + 0.5, 255.0))
    return result
