"""Ego poses from KITTI's own `oxts` files: GPS and IMU, a row for each frame, see `appocc.kitti_files`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.geometry import inverse, transform
from appocc.kitti_files import CAM_FROM_LIDAR, LIDAR_FROM_IMU, RECTIFY, oxts_poses, read_calibration
from appocc.text_tables import read_rows

EGO_FROM_CAM = transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])


def read_oxts(path: Path, calib_path: Path) -> list[FloatArray]:
    """Return world_from_ego (4, 4) of each frame; the ego frame is that of the camera, see `tracking.io.kitti`.

    Raises:
        DataError: if a file is missing or damaged.
    """
    calibration = read_calibration(calib_path)
    rectify = transform(calibration.numbers(RECTIFY, 3, 3), [0, 0, 0])
    cam_from_imu = rectify @ calibration.pose(CAM_FROM_LIDAR) @ calibration.pose(LIDAR_FROM_IMU)
    poses = oxts_poses(read_rows(path)) @ inverse(cam_from_imu) @ EGO_FROM_CAM.T
    if not len(poses):
        raise DataError(f"{path}: expected poses, got an empty file")
    return list(np.asarray(poses))
