"""The map of Lyft Level 5: a coloured picture, 0.1 m a pixel, with a colour for each kind of ground.

Lyft's devkit (`map_mask.py`) takes white for the background and all else for "drivable surface and sidewalks". The
other colours are not published; that light grey is pavement was found by hand by users. The colours of lane lines
are unknown: they count as the road that they are painted on.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appocc.checks import ByteArray
from appocc.nuscenes.lyft.png_window import png_window

LYFT_MAP = "map_raster_palette.png"
LYFT_SOURCE = "colours of Lyft's map"
_NOT_ROAD = ((255, 255, 255), (211, 211, 211))
_DRIVABLE = 255


def drivable_grey(path: Path, area: tuple[int, int, int, int]) -> ByteArray:
    """Return a mask (H, W), 255 where cars may drive and else 0, of columns and rows (left, top, right, bottom).

    Raises:
        DataError: if the picture is missing or damaged.
    """
    picture = png_window(path, area)
    others = [(picture == np.array(colour, np.uint8)).all(axis=2) for colour in _NOT_ROAD]
    return np.where(np.any(others, axis=0), 0, _DRIVABLE).astype(np.uint8)
