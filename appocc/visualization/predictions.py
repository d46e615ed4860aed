"""Figures of maps as in the paper: cameras on the left, occupancy and appearance on the right."""

from __future__ import annotations

from collections.abc import Collection

import cv2
import numpy as np

from appocc.bevmap import BEVMap
from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.frame import Frame
from appocc.visualization.canvas import UNKNOWN_LEGEND, BEVCanvas, put_text

_SCALE, _GAP_PX, _MIN_WIDTH_PX = 4, 8, 300
# Labels are next to their vehicles, on the side away from the ego.
_ASIDE_M = 3.0
# Cameras with a larger yaw belong to the rear row.
_FRONT_ROW_RAD = np.radians(80.0)
_CAPTIONS = {
    "occupancy": f"occupancy: road grey, line markings yellow, vehicles blue; {UNKNOWN_LEGEND}",
    "appearance": f"appearance: the colour of each cell, from above, ahead is up; {UNKNOWN_LEGEND}",
}


def prediction_figure(frame: Frame, bev: BEVMap, places_m: FloatArray) -> ByteArray:
    """Return a figure (H, W, 3) RGB: the images of a frame on the left, occupancy and appearance on the right.

    Args:
        frame: frame with the images.
        bev: map of the frame.
        places_m: (N, 2) centroids of vehicles, ego frame; each is labelled with its distance along x.
    """
    panels = [map_panel(bev, title, places_m, frame.rig.ego_vehicle) for title in _CAPTIONS]
    # Maps of the front half are wide: they are stacked vertically.
    high, wide = panels[0].shape[:2]
    axis = 0 if wide > high else 1
    gap = np.full((_GAP_PX, wide, 3) if axis == 0 else (high, _GAP_PX, 3), 255, np.uint8)
    right = np.concatenate([panels[0], gap, panels[1]], axis=axis)
    left = _cameras(frame, bev.meta.get("cameras", frame.images), right.shape[0])
    return np.ascontiguousarray(np.hstack([left, np.full((right.shape[0], _GAP_PX, 3), 255, np.uint8), right]))


def map_panel(bev: BEVMap, title: str, places_m: FloatArray, ego: EgoVehicle) -> ByteArray:
    """Draw `occupancy` or `appearance` of a map; vehicles are labelled with their distance along x, metres."""
    canvas = BEVCanvas(bev.grid, _SCALE)
    getattr(canvas, title)(bev)
    canvas.ego(ego)
    for x, y in places_m:
        canvas.label((x, y + np.copysign(_ASIDE_M, y)), f"{x:+.1f} m")
    put_text(canvas.picture, _CAPTIONS[title], (8, 20), scale=0.5)
    return canvas.picture


def camera_image(image: ByteArray, title: str, height_px: int) -> ByteArray:
    """Return a camera image resized to a height, with a title."""
    width_px = max(round(image.shape[1] * height_px / image.shape[0]), 1)
    how = cv2.INTER_AREA if image.shape[0] > height_px else cv2.INTER_CUBIC
    picture = np.asarray(cv2.resize(image, (width_px, height_px), interpolation=how), np.uint8)
    put_text(picture, title, (8, 20), scale=0.5)
    return picture


def camera_rows(rig: CameraRig) -> list[list[Camera]]:
    """Return the cameras in a front row, left to right, and a rear row, from left over the back to the right."""
    ahead = {camera.channel: camera.ego_from_cam[:2, 2] for camera in rig}
    yaw = {channel: float(np.arctan2(axis[1], axis[0])) for channel, axis in ahead.items()}
    front = [camera for camera in rig if abs(yaw[camera.channel]) <= _FRONT_ROW_RAD]
    rear = [camera for camera in rig if abs(yaw[camera.channel]) > _FRONT_ROW_RAD]
    front.sort(key=lambda camera: -yaw[camera.channel])
    rear.sort(key=lambda camera: yaw[camera.channel] % (2 * np.pi))
    return [row for row in (front, rear) if row]


def _cameras(frame: Frame, channels: Collection[str], height_px: int) -> ByteArray:
    """Stack the camera images vertically: the front row, then the rear row, each from left to right.

    If that makes them too small, the rear row becomes a second column.
    """
    rows = camera_rows(frame.rig.select(channels))
    whole = [camera for row in rows for camera in row]
    across = max(camera.width_px / camera.height_px for camera in whole)
    columns = [whole] if across * (height_px // len(whole)) >= _MIN_WIDTH_PX else rows
    each = height_px // max(len(column) for column in columns)
    drawn = [[camera_image(frame.images[c.channel], c.channel, each) for c in column] for column in columns]
    widest = [max(picture.shape[1] for picture in column) for column in drawn]
    left = np.full((height_px, sum(widest), 3), 255, np.uint8)
    for column, start in zip(drawn, np.cumsum([0, *widest[:-1]]), strict=True):
        for row, picture in enumerate(column):
            left[row * each : (row + 1) * each, start : start + picture.shape[1]] = picture
    return left
