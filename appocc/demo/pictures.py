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
    upper = mosaic([_image(frame, channel, lower.shape[1] // 3) for channel in _ORDER], 3)
    upper = np.pad(upper, ((0, 0), (0, lower.shape[1] - upper.shape[1]), (0, 0)))
    return np.ascontiguousarray(np.vstack([upper, np.full((_GAP_PX, lower.shape[1], 3), 255, np.uint8), lower]))


def _image(frame: Frame, channel: str, width_px: int) -> ByteArray:
    """A camera's picture at some width, with its name."""
    image = frame.images[channel]
    height_px = round(image.shape[0] * width_px / image.shape[1])
    how = cv2.INTER_AREA if image.shape[1] > width_px else cv2.INTER_CUBIC
    picture = np.asarray(cv2.resize(image, (width_px, height_px), interpolation=how), np.uint8)
    put_text(picture, channel, (8, 20), scale=0.55)
    return picture


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
