"""Land between the streets: lots along them, open ground elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from appocc.checks import FloatArray
from appocc.polylines import directions_at, length_m, points_at, shifted
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.land_styles import LandStyle
from appocc.simulation.ground.noise import value_noise
from appocc.simulation.ground.road_segments import RoadSegment
from appocc.simulation.surface import Surface

# The noise that places bare earth has cells of this many canvas cells.
_NOISE_CELLS = 4
_DRIVE_M = (2.6, 3.4)
_SHADES = 9


@dataclass(frozen=True, eq=False)
class Lot:
    """Ground that belongs to one house.

    Attributes:
        outline_m: (4, 2) street side first, town frame.
        surface: surface class.
        shade: brightness offset from other lots.
        driveway_m: (4, 2) outline of a paved driveway, (0, 2) if there is none.
    """

    outline_m: FloatArray
    surface: Surface
    shade: int
    driveway_m: FloatArray


def lay_lots(segments: Sequence[RoadSegment], land_style: LandStyle, seed: int) -> list[Lot]:
    """Draw lots to the right of all segments; later lots cover the backs of earlier ones."""
    random = np.random.default_rng([seed, 56])
    lots = []
    for segment in segments:
        outer = segment.lanes[0]
        kerb = shifted(outer.centre_m, -outer.width_m / 2)
        if segment.driving and segment.start.junction | segment.end.junction:
            lots += _lots_along(kerb, land_style, random)
    return lots


def _lots_along(kerb_m: FloatArray, land_style: LandStyle, random: np.random.Generator) -> list[Lot]:
    length = length_m(kerb_m)
    lots = []
    start = float(random.uniform(0.0, 6.0))
    while start + land_style.lot_width_m[0] < length:
        end = min(start + float(random.uniform(*land_style.lot_width_m)), length)
        deep = float(random.uniform(*land_style.lot_depth_m))
        kinds, shares = zip(*land_style.lot_surfaces, strict=True)
        surface = kinds[int(np.searchsorted(np.cumsum(shares), random.random() * sum(shares)))]
        drive = np.zeros((0, 2))
        wide = float(random.uniform(*_DRIVE_M))
        if surface == Surface.GRASS and random.random() < land_style.driveway_share and end - start > 2 * wide:
            begin = float(random.uniform(start + 0.5, end - wide - 0.5))
            drive = _area_behind(kerb_m, begin, begin + wide, float(random.uniform(0.3, 0.6)) * deep)
        shade = int(random.integers(-_SHADES, _SHADES + 1))
        lots.append(Lot(_area_behind(kerb_m, start, end, deep), surface, shade, drive))
        start = end
    return lots


def _area_behind(kerb_m: FloatArray, start_m: float, end_m: float, deep_m: float) -> FloatArray:
    """Return a (4, 2) area to the right of a kerb, between two distances along it."""
    along = np.array([start_m, end_m])
    heading = directions_at(kerb_m, np.full(2, (start_m + end_m) / 2))
    front = points_at(kerb_m, along)
    back = front + deep_m * np.stack([heading[:, 1], -heading[:, 0]], axis=1)
    return np.concatenate([front, back[::-1]])


def draw_land(canvas: Canvas, lots: Sequence[Lot], land_style: LandStyle, seed: int) -> None:
    """Draw open ground everywhere, then the lots; streets are drawn on top."""
    label = canvas.raster[:, :, 0]
    rows, columns = (size // _NOISE_CELLS + 2 for size in label.shape)
    bare = (
        value_noise(np.random.default_rng([seed, 52]), (rows, columns), (28, 12, 4), (1.0, 0.6, 0.3))
        > land_style.earth_threshold
    )
    coarse = np.where(bare, np.uint8(Surface.EARTH), np.uint8(Surface.GRASS))
    size = (columns * _NOISE_CELLS, rows * _NOISE_CELLS)
    label[:] = cv2.resize(coarse, size, interpolation=cv2.INTER_NEAREST)[: label.shape[0], : label.shape[1]]
    for lot in lots:
        canvas.fill([lot.outline_m], lot.surface)
        if len(lot.driveway_m):
            canvas.fill([lot.driveway_m], Surface.YARD)
