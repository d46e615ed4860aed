"""The demo's first picture: six cameras over the map made from them."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.bevmap import BEVMap
from appocc.checks import ByteArray
from appocc.drawing import BEVCanvas, mosaic, put_text
from appocc.frame import Frame

# Left to right as the cameras look out of the car: the upper row ahead, the lower row behind.
_ORDER = ("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK_LEFT", "CAM_BACK", "CAM_BACK_RIGHT")
_SCALE, _GAP_PX = 4, 8
# Labels stand beside their vehicles, on the far side from the ego.
_ASIDE_M = 3.0


def overview(frame: Frame, bev: BEVMap) -> ByteArray:
    """(H, W, 3) RGB: the six images of a frame, and below them colour and occupancy of its map, all labelled."""
    panels = [_panel(frame, bev, title) for title in ("appearance", "occupancy")]
    gap = np.full((panels[0].shape[0], _GAP_PX, 3), 255, np.uint8)
    lower = np.hstack([panels[0], gap, panels[1]])
    images = []
    for channel in _ORDER:
        image = frame.images[channel].copy()
        put_text(image, channel, (8, 20), scale=0.55)
        images.append(image)
    upper = mosaic(images, 3)
    height = round(upper.shape[0] * lower.shape[1] / upper.shape[1])
    upper = np.asarray(cv2.resize(upper, (lower.shape[1], height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return np.ascontiguousarray(np.vstack([upper, np.full((_GAP_PX, lower.shape[1], 3), 255, np.uint8), lower]))


def _panel(frame: Frame, bev: BEVMap, title: str) -> ByteArray:
    """A map from above; vehicles carry the distance along the ego's axis, in metres."""
    canvas = BEVCanvas(bev.grid, _SCALE)
    if title == "appearance":
        canvas.appearance(bev)
        caption = "appearance: the colour of each cell, from above, ahead is up"
    else:
        canvas.occupancy(bev)
        caption = "occupancy: road grey, line markings yellow, vehicles blue"
    canvas.ego()
    if frame.boxes_ego is not None:
        vehicles = frame.boxes_ego.vehicles()
        near = bev.grid.contains(bev.grid.cell_of(vehicles.centre_m[:, :2]))
        for x, y in vehicles.centre_m[near, :2]:
            canvas.label((x, y + np.copysign(_ASIDE_M, y)), f"{x:+.0f} m")
    put_text(canvas.picture, caption, (8, 20), scale=0.5)
    return canvas.picture
