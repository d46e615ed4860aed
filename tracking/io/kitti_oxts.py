"""Ego poses from KITTI's own `oxts` files: GPS and IMU, a row for each frame.

A row starts with latitude and longitude in degrees, altitude in metres, and roll, pitch and yaw in radians.
Positions are in a Mercator projection at the latitude of the first frame, relative to that frame, as in KITTI's
development kit. The world frame has x east, y north and z up.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.geometry import inverse, transform
from tracking.io.text_tables import parse_numbers, read_rows

EGO_FROM_CAM = transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
_EARTH_M = 6378137.0
_MIN_COLUMNS, _MAX_LATITUDE = 6, 89.0
# Names of the transforms in the two versions of KITTI's calibration files.
_RECTIFY, _CAM_FROM_LIDAR, _LIDAR_FROM_IMU = (
    ("R_rect", "R0_rect"),
    ("Tr_velo_cam", "Tr_velo_to_cam"),
    (
        "Tr_imu_velo",
        "Tr_imu_to_velo",
    ),
)


def read_oxts(path: Path, calib_path: Path) -> list[FloatArray]:
    """Return world_from_ego (4, 4) of each frame; the ego frame is that of the camera, see `tracking.io.kitti`.

    Raises:
        DataError: if a file is missing or damaged.
    """
    imu_from_ego = inverse(_cam_from_imu(calib_path)) @ EGO_FROM_CAM.T
    poses: list[FloatArray] = []
    scale, origin_m = 1.0, np.zeros(3)
    for place, columns in read_rows(path, None, _MIN_COLUMNS):
        latitude, longitude, altitude_m, roll, pitch, yaw = parse_numbers(place, columns[:_MIN_COLUMNS])
        if abs(latitude) > _MAX_LATITUDE:
            raise DataError(f"{place}: expected a latitude of up to {_MAX_LATITUDE:g} degrees, got {latitude:g}")
        if not poses:
            scale = float(np.cos(np.radians(latitude)))
        east_m = scale * _EARTH_M * np.radians(longitude)
        north_m = scale * _EARTH_M * np.log(np.tan(np.radians(90 + latitude) / 2))
        position_m = np.array([east_m, north_m, altitude_m])
        if not poses:
            origin_m = position_m
        world_from_imu = transform(_rotation(roll, pitch, yaw), position_m - origin_m)
        poses.append(world_from_imu @ imu_from_ego)
    if not poses:
        raise DataError(f"{path}: expected poses, got an empty file")
    return poses


def _rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> FloatArray:
    """Return the rotation (3, 3) by roll about x, then pitch about y, then yaw about z."""
    (cr, cp, cy), (sr, sp, sy) = ([f(angle) for angle in (roll_rad, pitch_rad, yaw_rad)] for f in (np.cos, np.sin))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def _cam_from_imu(path: Path) -> FloatArray:
    rows = {columns[0].rstrip(":"): (place, columns[1:]) for place, columns in read_rows(path)}
    rectify = transform(_matrix(path, rows, _RECTIFY, 3)[:, :3], [0, 0, 0])
    cam_from_lidar, lidar_from_imu = (
        np.vstack([_matrix(path, rows, names, 4), [0, 0, 0, 1]]) for names in (_CAM_FROM_LIDAR, _LIDAR_FROM_IMU)
    )
    return np.asarray(rectify @ cam_from_lidar @ lidar_from_imu)


def _matrix(path: Path, rows: dict[str, tuple[str, list[str]]], names: tuple[str, ...], columns: int) -> FloatArray:
    """Return the matrix (3, columns) of a calibration file under one of its names."""
    name = next((name for name in names if name in rows), None)
    if name is None:
        raise DataError(f"{path}: expected a line {names[0]}, got none; poses from oxts need it")
    place, words = rows[name]
    if len(words) != 3 * columns:
        raise DataError(f"{place}: expected {3 * columns} numbers after {name}, got {len(words)}")
    return np.array(parse_numbers(place, words)).reshape(3, columns)
