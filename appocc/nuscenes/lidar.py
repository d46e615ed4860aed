"""LiDAR files of the nuScenes schema: float32 x, y, z, intensity, ring in the sensor frame; lidarseg labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appocc.checks import ByteArray, FloatArray, check_shape
from appocc.errors import DataError
from appocc.files import read_file, write_bytes


def read_lidar(path: Path) -> FloatArray:
    """Read the (N, 5) float64 points of a .pcd.bin file.

    Raises:
        DataError: if the file is missing, its length is not a multiple of five float32, or no point is finite.
    """
    raw = read_file(path)
    if len(raw) % 20:
        raise DataError(f"{path}: expected rows of 5 float32 (20 bytes), got {len(raw)} bytes: truncated?")
    points = np.frombuffer(raw, np.float32).reshape(-1, 5).astype(np.float64)
    if len(points) and not np.isfinite(points[:, :3]).all(axis=1).any():
        raise DataError(f"{path}: expected finite points, got {len(points)} that are not")
    return points


def write_lidar(path: Path, points: FloatArray) -> None:
    """Write points (N, 5) as float32 x, y, z, intensity, ring.

    Raises:
        ShapeError: if they are not (N, 5).
        DataError: if the file cannot be written.
    """
    check_shape("lidar points", points, (None, 5))
    write_bytes(path, points.astype(np.float32).tobytes())


def read_labels(path: Path, points: int) -> ByteArray:
    """Read the (N,) uint8 labels of a lidarseg file.

    Raises:
        DataError: if the file is missing or does not have one byte per point.
    """
    raw = read_file(path)
    if len(raw) != points:
        raise DataError(f"{path}: expected {points} labels, one per point, got {len(raw)}")
    return np.frombuffer(raw, np.uint8)
