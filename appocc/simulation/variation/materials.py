"""Random materials of a town: brightness, hue, contrast and blotches of its ground, buildings and plants."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from appocc.checks import ByteArray
from appocc.simulation.rendering.look import BUILDINGS, Look
from appocc.simulation.rendering.noise import TILE
from appocc.simulation.surface import CELL_M, Surface
from appocc.srgb import encode_srgb, linear_from_srgb


class _Spread(NamedTuple):
    """Spread of a material.

    Attributes:
        brightness: standard deviation of the logarithm of linear light.
        hue: standard deviation of the logarithm of each channel.
        contrast: half-width of the logarithm of the contrast around `pivot`.
        pivot: sRGB byte that contrast leaves.
    """

    brightness: float
    hue: float
    contrast: float
    pivot: float


# Surfaces of a group change together: a lane line stays lighter than its road, a kerb than the pavement.
_GROUND: Mapping[tuple[Surface, ...], _Spread] = {
    (Surface.GRASS,): _Spread(0.35, 0.25, 0.4, 95.0),
    (Surface.EARTH, Surface.YARD): _Spread(0.35, 0.15, 0.4, 130.0),
    (Surface.PAVEMENT, Surface.KERB): _Spread(0.3, 0.12, 0.4, 150.0),
    (Surface.ROAD, Surface.PARKING): _Spread(0.35, 0.08, 0.6, 90.0),
    (Surface.CYCLE_PATH,): _Spread(0.35, 0.35, 0.3, 100.0),
    (Surface.ZEBRA, Surface.ARROW, Surface.BAY_LINE, Surface.LINE_WHITE, Surface.STOP_LINE): _Spread(
        0.12, 0.04, 0.1, 220.0
    ),
    (Surface.LINE_YELLOW,): _Spread(0.15, 0.1, 0.1, 200.0),
}
_WALLS, _FOLIAGE, _BARK = (
    _Spread(0.35, 0.22, 0.4, 150.0),
    _Spread(0.35, 0.22, 0.3, 80.0),
    _Spread(0.3, 0.15, 0.0, 80.0),
)
# Blotches of the ground: range of their strength (share of the sRGB value) and of their size (metres per noise cell).
_BLOTCH, _BLOTCH_M = (0.0, 0.35), (0.1, 2.5)
_SAME = np.arange(256, dtype=np.uint8)


def draw_look(random: np.random.Generator) -> Look:
    """Draw the materials of a scene."""
    ground = np.tile(_SAME, (256, 3, 1))
    for surfaces, spread in _GROUND.items():
        ground[list(surfaces)] = _draw_table(random, spread)
    scenery = [_draw_table(random, spread) for spread in (*(_WALLS,) * BUILDINGS, _FOLIAGE, _BARK)]
    blotch, size_m = random.uniform(*_BLOTCH), np.exp(random.uniform(*np.log(_BLOTCH_M)))
    row, column = (int(start) for start in random.integers(TILE, size=2))
    return Look(ground, np.stack(scenery), float(blotch), max(round(size_m / CELL_M), 1), (row, column))


def _draw_table(random: np.random.Generator, spread: _Spread) -> ByteArray:
    """Draw the new value (3, 256) uint8 of each channel by its old value; no deviation is beyond two sigma."""
    drawn = np.clip(random.normal(size=4), -2, 2)
    gains = np.exp(spread.brightness * drawn[0] + spread.hue * drawn[1:])
    contrast = np.exp(random.uniform(-spread.contrast, spread.contrast))
    old = np.clip(spread.pivot + (np.arange(256.0) - spread.pivot) * contrast, 3, 252)
    light = np.minimum(gains[:, None] * linear_from_srgb(old), 1.0)
    return np.asarray(np.rint(255 * encode_srgb(light)), np.uint8)
