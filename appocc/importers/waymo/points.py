"""Points of range images, as in Waymo's `range_image_utils`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from appocc.checks import FloatArray
from appocc.geometry import apply, inverse
from appocc.importers.waymo.segment import Laser, RangeImage

TOP = 1
_UNKNOWN_RING = -1.0


def points_of(images: Iterable[RangeImage], lasers: Mapping[int, Laser], world_from_ego: FloatArray) -> FloatArray:
    """Return the points (N, 5) of all returns in the ego frame of a pose.

    Columns are x, y, z, the hyperbolic tangent of the intensity times 255 (Waymo's has no upper limit), and the row
    of the upper LiDAR (-1 for the others, whose rows are other beams).

    Raises:
        ValueError: if a range image does not fit its calibration.
    """
    found = [_points(image, lasers[image.laser], world_from_ego) for image in images if image.laser in lasers]
    return np.concatenate([np.empty((0, 5)), *found])


def _points(image: RangeImage, laser: Laser, world_from_ego: FloatArray) -> FloatArray:
    if image.values.ndim != 3 or image.values.shape[2] < 2:
        raise ValueError(f"range image of LiDAR {image.laser}: expected (H, W, 4) values, got {image.values.shape}")
    height, width = image.values.shape[:2]
    rows, columns = np.nonzero((image.values[..., 0] > 0) & np.isfinite(image.values[..., :2]).all(axis=2))
    distance = image.values[rows, columns, 0].astype(np.float64)
    pose = laser.ego_from_laser
    azimuth = ((width - columns - 0.5) / width * 2 - 1) * np.pi - np.arctan2(pose[1, 0], pose[0, 0])
    up = _inclinations(laser, image.laser, height)[rows]
    flat = distance * np.cos(up)
    places = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(up)], axis=1)
    places = apply(pose, places)
    if image.poses is not None:
        if image.poses.shape != (height, width, 6):
            raise ValueError(f"poses of pixels: expected shape {(height, width, 6)}, got {image.poses.shape}")
        places = _compensated(places, image.poses[rows, columns].astype(np.float64), world_from_ego)
    ring = rows if image.laser == TOP else np.full(len(rows), _UNKNOWN_RING)
    intensity = np.tanh(np.maximum(image.values[rows, columns, 1], 0)) * 255
    return np.column_stack([places, intensity, ring])


def _inclinations(laser: Laser, name: int, height: int) -> FloatArray:
    """Return the inclination (H,) of each row, the highest first."""
    if laser.uniform:
        low, high = laser.inclinations_rad
        return np.asarray(low + (np.arange(height)[::-1] + 0.5) / height * (high - low))
    if len(laser.inclinations_rad) != height:
        raise ValueError(f"LiDAR {name}: expected {height} beam inclinations, got {len(laser.inclinations_rad)}")
    return laser.inclinations_rad[::-1]


def _compensated(places: FloatArray, poses: FloatArray, world_from_ego: FloatArray) -> FloatArray:
    """Return places (N, 3) of ego frames at poses (N, 6), zeros if unknown, in the ego frame of one pose."""
    known = poses.any(axis=1) & np.isfinite(poses).all(axis=1)
    turns = Rotation.from_euler("ZYX", poses[known, 2::-1])  # yaw, then pitch, then roll
    moved = places.copy()
    moved[known] = apply(inverse(world_from_ego), turns.apply(places[known]) + poses[known, 3:])
    return moved
