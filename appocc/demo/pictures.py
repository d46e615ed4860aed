"""The demo's first picture: six cameras over the map made from them."""

from __future__ import annotations

import numpy as np

from appocc.bevmap import BEVMap
from appocc.checks import ByteArray
from appocc.drawing import mosaic
from appocc.frame import Frame
from appocc.inference.pictures import camera_picture, map_panel

# Left to right as the cameras look out of the car: the upper row ahead, the lower row behind.
_ORDER = ("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK_LEFT", "CAM_BACK", "CAM_BACK_RIGHT")
_GAP_PX = 8


def overview(frame: Frame, bev: BEVMap) -> ByteArray:
    """(H, W, 3) RGB: the six images of a frame, and below them colour and occupancy of its map, all labelled."""
    places_m = np.zeros((0, 2))
    if frame.boxes_ego is not None:
        places_m = frame.boxes_ego.vehicles().centre_m[:, :2]
        places_m = places_m[bev.grid.contains(bev.grid.cell_of(places_m))]
    panels = [map_panel(bev, title, places_m) for title in ("appearance", "occupancy")]
    gap = np.full((panels[0].shape[0], _GAP_PX, 3), 255, np.uint8)
    lower = np.hstack([panels[0], gap, panels[1]])
    camera = frame.rig[_ORDER[0]]
    height_px = camera.height_px * (lower.shape[1] // 3) // camera.width_px
    upper = mosaic([camera_picture(frame.images[channel], channel, height_px) for channel in _ORDER], 3)
    upper = np.pad(upper, ((0, 0), (0, lower.shape[1] - upper.shape[1]), (0, 0)))
    return np.ascontiguousarray(np.vstack([upper, np.full((_GAP_PX, lower.shape[1], 3), 255, np.uint8), lower]))
