"""Cameras of CameraInfo messages and the tree of frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError, ShapeError
from appocc.geometry import transform
from appocc.importers.ros.topics import CameraTopics, channel_of
from appocc.rigs.calibration.matrices import camera_keys
from appocc.rigs.calibration.wanted import Wanted
from appocc.rigs.fields import Fields
from appocc.rigs.optics import read_lens
from appocc.rigs.source_camera import SourceCamera

# The optical frame (x right, y down, z ahead) in a body frame (x ahead, y left, z up), REP 103.
_BODY_FROM_OPTICAL = transform(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [0, 0, 0])
# A camera whose z axis is within 45 degrees of up does not see the street.
_UP = np.cos(np.pi / 4)


class Mounted(NamedTuple):
    """A camera of the rig.

    Attributes:
        camera: the camera.
        is_body: whether its frame is taken for a body frame, as its z axis points up.
    """

    camera: SourceCamera
    is_body: bool


def is_calibrated(info: Any) -> bool:
    """Return whether a CameraInfo is that of a calibrated camera; others have K = 0."""
    return bool(info.k[0] > 0 and info.width > 0 and info.height > 0)


def mounted_camera(where: str, topics: CameraTopics, info: Any, ego_from_frame: FloatArray) -> Mounted:
    """Return the camera of a CameraInfo in a frame of tf.

    Its lens is K and D; that of rectified pictures P, with axes turned by R.

    Raises:
        DataError: if it is damaged, or its distortion is of an unknown model.
    """
    is_body = bool(ego_from_frame[2, 2] > _UP)
    pose = ego_from_frame @ _BODY_FROM_OPTICAL if is_body else ego_from_frame
    size, shift = _region(info)
    if topics.is_rectified:
        k, d, model = info.p.reshape(3, 4)[:, :3], [], "plumb_bob"
        turn = info.r.reshape(3, 3)
        pose = pose @ transform(turn.T if turn.any() else np.eye(3), [0, 0, 0])
    else:
        k, d, model = info.k.reshape(3, 3), info.d.tolist(), info.distortion_model
    intrinsic = (k - shift).ravel().tolist()
    keys = camera_keys(
        {"K": intrinsic, "D": d or None, "distortion_model": model}, Wanted(Path(where), None, None, {})
    )
    try:
        lens = read_lens(Fields(keys, where), size)
        camera = SourceCamera(topics.name, channel_of(topics.name), *size, lens, pose)
    except ShapeError as error:
        raise DataError(f"{where}: {error}") from error
    return Mounted(camera, is_body)


def _region(info: Any) -> tuple[tuple[int, int], FloatArray]:
    """Return width and height of the region that is read of the sensor, and by what K is shifted for it."""
    roi, shift = info.roi, np.zeros((3, 3))
    if not (roi.width and roi.height):
        return (int(info.width), int(info.height)), shift
    shift[:2, 2] = roi.x_offset, roi.y_offset
    return (int(roi.width), int(roi.height)), shift
