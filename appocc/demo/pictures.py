"""Overview image of the demo: six camera images, the predicted map, and the true map."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.bevmap import BEVMap
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.frame import Frame
from appocc.visualization.canvas import mosaic, put_text
from appocc.visualization.predictions import camera_image, camera_rows, map_panel

_GAP_PX, _CAMERA_PX = 8, 533


def overview(frame: Frame, predicted: BEVMap, exact: BEVMap, places_m: FloatArray) -> ByteArray:
    """Return (H, W, 3) RGB: six images, the predicted map with vehicles at `places_m` (N, 2), and the true map."""
    boxes = frame.boxes_ego
    centres_m = np.zeros((0, 2)) if boxes is None else boxes.vehicles().centre_m[:, :2]
    centres_m = centres_m[exact.grid.contains(exact.grid.cell_of(centres_m))]
    cameras = [camera for row in camera_rows(frame.rig) for camera in row]
    height_px = cameras[0].height_px * _CAMERA_PX // cameras[0].width_px
    upper = mosaic([camera_image(frame.images[c.channel], c.channel, height_px) for c in cameras], 3)
    rows = [
        _maps(predicted, "predicted from the six images", places_m, frame.rig.ego_vehicle),
        _maps(exact, "the truth", centres_m, frame.rig.ego_vehicle),
    ]
    width_px = max(upper.shape[1], *(row.shape[1] for row in rows))
    return np.ascontiguousarray(np.vstack([_centred(part, width_px) for part in (upper, *rows)]))


def _maps(bev: BEVMap, title: str, places_m: FloatArray, ego: EgoVehicle) -> ByteArray:
    """Draw colour and occupancy of a map side by side below a title."""
    colour, occupancy = (map_panel(bev, side, places_m, ego) for side in ("appearance", "occupancy"))
    gap = np.full((colour.shape[0], _GAP_PX, 3), 255, np.uint8)
    both = np.hstack([colour, gap, occupancy])
    head = np.full((40, both.shape[1], 3), 255, np.uint8)
    put_text(head, title, (0, 28), (0, 0, 0), 0.8)
    return np.vstack([head, both])


def _centred(picture: ByteArray, width_px: int) -> ByteArray:
    left = (width_px - picture.shape[1]) // 2
    right = width_px - picture.shape[1] - left
    return np.asarray(cv2.copyMakeBorder(picture, 0, 0, left, right, cv2.BORDER_CONSTANT, value=(255,) * 3), np.uint8)
