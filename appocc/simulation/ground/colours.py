"""Albedo of the ground, sRGB."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np

from appocc.checks import ByteArray, Float32Array
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.land import Lot
from appocc.simulation.ground.noise import tileable_noise
from appocc.simulation.ground.road_segments import RoadSegment
from appocc.simulation.ground.wear import NEUTRAL, draw_wear
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import Surface

_TILE = 1024
_PLAIN_TONE = 90


@dataclass(frozen=True)
class SurfaceAppearance:
    """Appearance of a surface.

    Attributes:
        rgb: mean colour; for asphalt, relative to its tone.
        grain: standard deviation of brightness from cell to cell, of 255.
        mottle: standard deviation of brightness from metre to metre.
        hue: standard deviation of warmth, green to brown on grass.
        cover: opacity over the asphalt below; 0 for asphalt itself.
        shaded: share of the wear shade that is visible.
    """

    rgb: tuple[float, float, float]
    grain: float
    mottle: float
    hue: float
    cover: float = 1.0
    shaded: float = 0.0


_WHITE = SurfaceAppearance((222, 221, 214), 5, 5, 1, 0.92, 0.6)
APPEARANCES: Mapping[Surface, SurfaceAppearance] = {
    Surface.GRASS: SurfaceAppearance((92, 101, 60), 8, 7, 7, 1.0, 1.0),
    Surface.EARTH: SurfaceAppearance((131, 114, 90), 8, 7, 3, 1.0, 1.0),
    Surface.YARD: SurfaceAppearance((139, 134, 126), 5, 6, 3, 1.0, 1.0),
    Surface.PAVEMENT: SurfaceAppearance((157, 153, 145), 4, 6, 2, 1.0, 1.0),
    Surface.KERB: SurfaceAppearance((176, 174, 168), 4, 4, 1, 1.0, 0.5),
    Surface.ROAD: SurfaceAppearance((1.0, 1.0, 1.02), 4, 4, 1, 0.0, 1.0),
    Surface.PARKING: SurfaceAppearance((1.0, 0.99, 0.99), 4, 5, 1, 0.0, 1.0),
    Surface.CYCLE_PATH: SurfaceAppearance((138, 78, 66), 4, 6, 3, 0.95, 0.6),
    Surface.ZEBRA: _WHITE,
    Surface.ARROW: _WHITE,
    Surface.BAY_LINE: SurfaceAppearance((214, 213, 207), 5, 5, 1, 0.85, 0.6),
    Surface.LINE_WHITE: _WHITE,
    Surface.LINE_YELLOW: SurfaceAppearance((214, 170, 52), 5, 5, 1, 0.9, 0.6),
    Surface.STOP_LINE: _WHITE,
}


def colour_ground(canvas: Canvas, plan: TownPlan, segments: Sequence[RoadSegment], lots: Sequence[Lot]) -> ByteArray:
    """Return (H, W, 3) colours of a label canvas."""
    label = canvas.raster[:, :, 0]
    # The output array first holds tone and shade of the asphalt, which saves memory.
    colour = np.empty((*label.shape, 3), np.uint8)
    colour[:1] = (_PLAIN_TONE, NEUTRAL, 0)
    colour[1:] = colour[:1]
    draw_wear(Canvas(canvas.low_m, colour), plan, segments, lots)
    random = np.random.default_rng([plan.seed, 55])
    fine = tileable_noise(random, _TILE, (1, 2, 4), (1.0, 0.6, 0.4))
    broad = tileable_noise(random, _TILE, (128, 64, 32, 16, 8), (1.0, 0.9, 0.7, 0.5, 0.35))
    table = np.array(
        [[*p.rgb, p.grain, p.mottle, p.hue, p.cover, p.shaded] for _, p in sorted(APPEARANCES.items())], np.float32
    )
    _apply_colours(label, colour, table, fine, broad, float(random.uniform(0.0, 0.35)))
    return colour


@numba.njit(cache=True, nogil=True)
def _apply_colours(
    label: ByteArray, colour: ByteArray, table: Float32Array, fine: Float32Array, broad: Float32Array, wear: float
) -> None:
    """Convert tone and shade in `colour` to colours, by label."""
    height, width = label.shape
    mask = _TILE - 1
    worn = np.float32(wear)
    for row in range(height):
        # Other rows and columns of the same tiles, at offsets without a common period.
        one, two, three = row & mask, (row + row // 3 + 311) & mask, (row // 2 + 517) & mask
        for column in range(width):
            appearance = table[label[row, column]]
            grain = fine[one, column & mask]
            mottle = broad[one, (column + 97) & mask] + broad[two, (column + column // 4) & mask]
            hue = broad[three, (column // 2) & mask]
            tone = np.float32(colour[row, column, 0])
            shade = np.float32(colour[row, column, 1]) - np.float32(128)
            cover = appearance[6]
            bright = grain * appearance[3] + np.float32(0.7) * mottle * appearance[4] + shade * appearance[7]
            if cover > 0 and cover < 1:
                # Paint peels in flakes, on some segments more than on others.
                lost = worn + np.float32(0.12) * mottle + np.float32(0.22) * fine[two, (column + 40) & mask]
                cover *= min(max(np.float32(1.05) - max(lost, np.float32(0)), np.float32(0.3)), np.float32(1))
            for k in range(3):
                own = appearance[k] * (tone if cover == 0 else np.float32(1))
                value = own if cover == 0 else cover * own + (1 - cover) * tone
                value += bright + hue * appearance[5] * (
                    np.float32(1) if k == 0 else np.float32(0.55 - 0.1 * (k - 1))
                )
                colour[row, column, k] = np.uint8(min(max(value, np.float32(0)), np.float32(255)))
