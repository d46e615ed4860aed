"""The ground of a town: surface class and colour of each 0.1 m cell; images and ground truth use the same raster."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray, check_dtype, check_shape, frozen


class Surface(IntEnum):
    """Class of a ground surface; the order is the drawing order, later classes cover earlier ones."""

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


# Conventions (docs/conventions.md): road is where cars may drive; zebras, arrows and bay lines are not lane markings.
ROAD_SURFACES = tuple(s for s in Surface if s >= Surface.ROAD)
LANE_SURFACES = (Surface.LINE_WHITE, Surface.LINE_YELLOW, Surface.STOP_LINE)
CELL_M = 0.1


def surface_table(surfaces: tuple[Surface, ...]) -> BoolArray:
    """Return (256,) whether a label is one of the surfaces."""
    table = np.zeros(256, np.bool_)
    table[list(surfaces)] = True
    return table


@dataclass(frozen=True, eq=False)
class Ground:
    """Labels and colours in cells of 0.1 m on the plane z = 0; the lower corner of cell (0, 0) is at `low_m`.

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
