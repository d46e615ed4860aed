"""Where cameras of vehicles are and look: units and axes that were mistaken are told at once, not by poor maps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.rigs.fields import Fields
from appocc.rigs.poses import MATRIX_KEYS, read_pose

_LEAST_HEIGHT_M, _MOST_HEIGHT_M, _FARTHEST_M = 0.1, 10.0, 30.0
_STEEPEST_DEG = 45.0
_EXPECTED = (
    f"a camera {_LEAST_HEIGHT_M:g} to {_MOST_HEIGHT_M:g} m above the ground, at most {_FARTHEST_M:g} m from the rear "
    f"axle, that looks at most {_STEEPEST_DEG:g} degrees up"
)
_UPRIGHT = f"an upright camera, rolled by at most {_STEEPEST_DEG:g} degrees (beside position_m, roll_deg may be any)"
_EXAMPLE = "position_m: [1.7, 0, 1.5] with yaw_deg: 0"
# Yaws of cameras around a vehicle in radians are within a turn of 2 pi, and apart by more than the yaws in degrees of
# cameras that all look ahead.
_TURN_RAD, _APART = 6.3, 3.5


def read_mounting(fields: Fields) -> FloatArray:
    """Return the (4, 4) pose ego_from_cam of a camera of a rig file that is mounted on a vehicle.

    Raises:
        DataError: if the file has none, several, or one that no camera of a vehicle has.
    """
    pose = read_pose(fields)
    key = next(key for key in ("position_m", *MATRIX_KEYS) if key in fields)
    upright = key != "position_m"
    if fault := mounting_fault(pose, upright):
        others = [(read_pose(other), hint) for hint, other in _other_readings(fields, key)]
        # Of the readings that fit, the most level one: its camera's y axis points down.
        fits = sorted((float(other[2, 1]), hint) for other, hint in others if not mounting_fault(other, upright))
        expected, got = fault
        hint = f"; is it {fits[0][1]}?" if fits else ""
        raise DataError(f"{fields.name(key)}: expected {expected}, such as {_EXAMPLE}, got {got}{hint}")
    return pose


def mounting_fault(pose: FloatArray, upright: bool) -> tuple[str, str] | None:
    """Return what is expected of a mounted camera, and what it is instead; None if it is as expected.

    Args:
        pose: (4, 4) ego_from_cam.
        upright: whether its rows must be about level.
    """
    x, y, z = pose[:3, 3]
    up_deg = np.degrees(np.arcsin(np.clip(pose[2, 2], -1, 1)))
    if not _LEAST_HEIGHT_M <= z <= _MOST_HEIGHT_M or np.hypot(x, y) > _FARTHEST_M:
        return _EXPECTED, f"one at [{x:.2f}, {y:.2f}, {z:.2f}]"
    if up_deg > _STEEPEST_DEG:
        return _EXPECTED, f"one that looks {up_deg:.0f} degrees up"
    roll_deg = np.degrees(np.arctan2(-pose[2, 0], -pose[2, 1]))
    # A camera that looks down has no roll.
    if upright and up_deg > -80 and abs(roll_deg) > _STEEPEST_DEG:
        return _UPRIGHT, f"one rolled by {roll_deg:.0f} degrees"
    return None


def check_degrees(cameras: Fields) -> None:
    """Check that the yaws of a rig file's cameras, as they are written, are not in radians.

    Raises:
        DataError: if they are.
    """
    yaws = [yaw for name in cameras.keys if (yaw := _written_yaw(cameras.inside(name))) is not None]
    if len(yaws) > 2 and max(map(abs, yaws)) < _TURN_RAD and max(yaws) - min(yaws) > _APART:
        listed = ", ".join(f"{yaw:g}" for yaw in yaws)
        raise DataError(f"{cameras.where}: expected yaw_deg in degrees, such as 90, got {listed}, as of radians")


def _written_yaw(camera: Fields) -> float | None:
    parts = next((camera.inside(key) for key in MATRIX_KEYS if isinstance(camera[key], dict)), camera)
    return parts.number("yaw_deg", "an angle in degrees", -360, 360, 90) if "yaw_deg" in parts else None


def _other_readings(fields: Fields, key: str) -> Iterator[tuple[str, Fields]]:
    """Yield what else a pose may be: the inverse, of other axes, a quaternion of the other order."""
    if key not in MATRIX_KEYS:
        return
    value: Any = fields[key]
    for one, other in (("quaternion_wxyz", "quaternion_xyzw"), ("quaternion_xyzw", "quaternion_wxyz")):
        if isinstance(value, dict) and one in value:
            renamed = {other if name == one else name: each for name, each in value.items()}
            yield other, fields.having(**{key: renamed})
    axes = "optical" if fields["axes"] == "body" else "body"
    yield f"axes: {axes}", fields.having(axes=axes)
    (inverse,) = set(MATRIX_KEYS) - {key}
    yield inverse, fields.having(**{key: None, inverse: value})
    yield f"{inverse} with axes: {axes}", fields.having(**{key: None, inverse: value, "axes": axes})
