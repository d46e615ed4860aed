"""Camera images of a rig, arranged as one looks out of the vehicle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray
from appocc.visualization.canvas import put_text
from appocc.visualization.layout import resized, side_by_side, stack_centred

# Cameras with a larger yaw belong to the rear row.
_FRONT_ROW_RAD = np.radians(80.0)
# A row of fewer cameras is as wide, so that a single image does not fill the sheet.
_COLUMNS = 3


def camera_rows(rig: CameraRig) -> list[list[Camera]]:
    """Return the cameras in a front row, left to right, and a rear row, from left over the back to the right."""
    ahead = {camera.channel: camera.ego_from_cam[:2, 2] for camera in rig}
    yaw = {channel: float(np.arctan2(axis[1], axis[0])) for channel, axis in ahead.items()}
    front = [camera for camera in rig if abs(yaw[camera.channel]) <= _FRONT_ROW_RAD]
    rear = [camera for camera in rig if abs(yaw[camera.channel]) > _FRONT_ROW_RAD]
    front.sort(key=lambda camera: -yaw[camera.channel])
    rear.sort(key=lambda camera: yaw[camera.channel] % (2 * np.pi))
    return [row for row in (front, rear) if row]


def camera_sheet(images: Mapping[str, ByteArray], rig: CameraRig, width_px: int) -> ByteArray:
    """Return a sheet (H, W, 3) of the images of a rig in the rows of `camera_rows`, each with its channel.

    Args:
        images: RGB images by channel, one for each camera.
        rig: any number of cameras, at least one, in any order.
        width_px: width of a row, at most.
    """
    rows = camera_rows(rig)
    across = width_px // max(_COLUMNS, *(len(row) for row in rows))
    tiles = [[_tile(images[camera.channel], camera.channel, across) for camera in row] for row in rows]
    return stack_centred([side_by_side(row) for row in tiles])


def _tile(image: ByteArray, title: str, across_px: int) -> ByteArray:
    """Return an image with its title in the upper left corner, at most as high as wide."""
    picture = resized(image, across_px / max(image.shape[:2]))
    put_text(picture, title, (6, 16))
    return picture
