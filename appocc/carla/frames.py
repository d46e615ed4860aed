"""CARLA's coordinates and ours: the only place where one becomes the other.

CARLA's frames are left-handed: x ahead, y right, z up; yaw turns clockwise seen from above, a positive pitch lifts
the nose, a positive roll lowers the right side; degrees. Ours have y to the left: the same places with -y. A sensor
looks along its x.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import transform

_MIRROR = np.array([1.0, -1.0, 1.0])
# The camera frame (x right, y down, z ahead) in the body frame (x ahead, y left, z up) of a sensor.
BODY_FROM_CAM = transform(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [0, 0, 0])
# Beyond, yaw and roll turn about the same axis.
_VERTICAL = 1 - 1e-9


def point_of(location: Any) -> FloatArray:
    """Return the (3,) point or vector of a carla.Location or carla.Vector3D."""
    return np.asarray(np.array([location.x, location.y, location.z]) * _MIRROR)


def pose_of(carla_transform: Any) -> FloatArray:
    """Return the (4, 4) pose of a carla.Transform, or anything else with a location and a rotation."""
    angles = carla_transform.rotation
    (sp, cp), (sy, cy), (sr, cr) = (
        (np.sin(a), np.cos(a)) for a in np.radians([angles.pitch, angles.yaw, angles.roll])
    )
    turn = np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
            [sp, -cp * sr, cp * cr],
        ]
    )
    return transform(turn * np.outer(_MIRROR, _MIRROR), point_of(carla_transform.location))


def carla_numbers(pose: FloatArray) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return x, y, z in metres and pitch, yaw, roll in degrees of CARLA for a (4, 4) pose."""
    turn = pose[:3, :3] * np.outer(_MIRROR, _MIRROR)
    pitch = np.arcsin(np.clip(turn[2, 0], -1, 1))
    if abs(turn[2, 0]) > _VERTICAL:
        yaw, roll = np.arctan2(-turn[0, 1], turn[1, 1]), 0.0
    else:
        yaw, roll = np.arctan2(turn[1, 0], turn[0, 0]), np.arctan2(-turn[2, 1], turn[2, 2])
    x, y, z = (pose[:3, 3] * _MIRROR).tolist()
    return (x, y, z), (float(np.degrees(pitch)), float(np.degrees(yaw)), float(np.degrees(roll)))


def carla_transform(carla: Any, pose: FloatArray) -> Any:
    """Return the carla.Transform of a (4, 4) pose."""
    (x, y, z), (pitch, yaw, roll) = carla_numbers(pose)
    return carla.Transform(carla.Location(x=x, y=y, z=z), carla.Rotation(pitch=pitch, yaw=yaw, roll=roll))
