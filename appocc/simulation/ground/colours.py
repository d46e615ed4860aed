"""How the ground looks: colours without light, sRGB."""

from __future__ import annotations

import numpy as np

from appocc.checks import ByteArray
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import Surface

BASE = {
    Surface.GRASS: (92, 104, 62),
    Surface.EARTH: (128, 112, 90),
    Surface.YARD: (142, 138, 130),
    Surface.PAVEMENT: (160, 156, 148),
    Surface.KERB: (176, 173, 166),
    Surface.ROAD: (88, 88, 90),
    Surface.PARKING: (97, 96, 95),
    Surface.CYCLE_PATH: (140, 80, 70),
    Surface.ZEBRA: (215, 214, 208),
    Surface.ARROW: (215, 214, 208),
    Surface.BAY_LINE: (205, 204, 198),
    Surface.LINE_WHITE: (215, 214, 208),
    Surface.LINE_YELLOW: (206, 166, 58),
    Surface.STOP_LINE: (215, 214, 208),
}


def coloured(canvas: Canvas, plan: TownPlan) -> ByteArray:
    """(H, W, 3) colours of a canvas of labels."""
    table = np.zeros((256, 3), np.uint8)
    for surface, rgb in BASE.items():
        table[surface] = rgb
    return np.asarray(table[canvas.raster[:, :, 0]])
