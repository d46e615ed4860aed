"""The ground of a town: what each decimetre is, and how it looks; picture and truth come from the same raster."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray, check_dtype, check_shape, frozen


class Surface(IntEnum):
    """What the ground is; the order is that of drawing, later ones cover earlier ones."""

    GRASS = 0
    EARTH = 1
    YARD = 2  # paved ground between houses, driveways
    PAVEMENT = 3
    KERB = 4
    ROAD = 5
    PARKING = 6  # parking lanes and car parks
    CYCLE_PATH = 7
    ZEBRA = 8
    ARROW = 9
    BAY_LINE = 10
    LINE_WHITE = 11
    LINE_YELLOW = 12
    STOP_LINE = 13


# Conventions (docs/conventions.md): road is where cars may drive; zebras, arrows and bay lines are no lane markings.
ROAD_SURFACES = tuple(s for s in Surface if s >= Surface.ROAD)
LANE_SURFACES = (Surface.LINE_WHITE, Surface.LINE_YELLOW, Surface.STOP_LINE)
CELL_M = 0.1


def surface_table(surfaces: tuple[Surface, ...]) -> BoolArray:
    """(256,) whether a label is one of some surfaces."""
    table = np.zeros(256, np.bool_)
    table[list(surfaces)] = True
    return table


@dataclass(frozen=True)
class Ground:
    """Labels and colours in cells of 0.1 m on the plane z = 0; cell (0, 0) has its lower corner at `low_m`.

    Attributes:
        low_m: (2,) town frame; whole multiples of the cell size.
        label: (H, W) uint8 `Surface`; first index y (north), second x (east).
        colour: (H, W, 3) uint8 sRGB albedo.
    """

    low_m: FloatArray
    label: ByteArray
    colour: ByteArray

    def __post_init__(self) -> None:
        """Check shapes and types.

        Raises:
            ShapeError: if one does not fit.
        """
        check_shape("label", self.label, (None, None))
        check_shape("colour", self.colour, (*self.label.shape, 3))
        check_dtype("label", self.label, np.uint8)
        check_dtype("colour", self.colour, np.uint8)
        for array in (self.low_m, self.label, self.colour):
            frozen(array)
