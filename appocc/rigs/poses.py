"""Poses of cameras in rig files, in every form that calibration tools and robots write."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from appocc.checks import FloatArray, check_transform
from appocc.errors import DataError, ShapeError
from appocc.geometry import inverse, nearest_rigid, rotation_from_quaternion, transform
from appocc.rigs.fields import Fields

POSITION_KEYS = ("position_m", "yaw_deg", "pitch_deg", "roll_deg")
MATRIX_KEYS = ("ego_from_cam", "cam_from_ego")
POSE_KEYS = (*POSITION_KEYS, *MATRIX_KEYS, "axes")
_ROTATION_KEYS = ("quaternion_wxyz", "quaternion_xyzw", "rodrigues", "yaw_deg")
_TURN_RAD = 2 * np.pi + 1e-3
# Rotation from the optical axes (right, down, ahead) to the body axes (ahead, left, up).
BODY_FROM_OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
_TRANSLATION = "[1.7, 0.0, 1.5]"
_WRITTEN = "ego_from_cam: {quaternion_wxyz: [0.5, -0.5, 0.5, -0.5], translation_m: [1.7, 0, 1.5]}"


def read_pose(fields: Fields) -> FloatArray:
    """Return the (4, 4) pose ego_from_cam, metres, camera frame x right, y down, z ahead, of a camera of a rig file.

    Raises:
        DataError: if the file has none, several, or an invalid one.
    """
    key = fields.one_of("position_m", *MATRIX_KEYS, example="position_m: [1.7, 0, 1.5] with yaw_deg: 0")
    if key == "position_m":
        if "axes" in fields:
            raise fields.refusal("axes", "nothing, as yaw_deg, pitch_deg and roll_deg turn the camera's body")
        return transform(_mounted(fields), _translation(fields, "position_m"))
    for angle in POSITION_KEYS[1:]:
        if angle in fields:
            raise fields.refusal(angle, f"nothing beside {key}, which has the rotation")
    pose = read_transform(fields, key)
    if key == "cam_from_ego":
        pose = inverse(pose)
    if _axes(fields, key) == "body":
        pose = pose @ transform(BODY_FROM_OPTICAL, np.zeros(3))
    return pose


def mounting_rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> FloatArray:
    """Return ego-from-camera (3, 3), optical axes: yaw to the left, pitch down, roll clockwise seen from behind."""
    return np.asarray(_body_rotation(yaw_deg, pitch_deg, roll_deg) @ BODY_FROM_OPTICAL)


def _body_rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> FloatArray:
    (cy, cp, cr), (sy, sp, sr) = (f(np.radians([yaw_deg, pitch_deg, roll_deg])) for f in (np.cos, np.sin))
    yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return np.asarray(yaw @ pitch @ roll)


def _mounted(fields: Fields) -> FloatArray:
    return mounting_rotation(*_angles(fields))


def _angles(fields: Fields) -> tuple[float, float, float]:
    """Return yaw, pitch and roll in degrees; only the yaw must be there."""
    expected = "an angle in degrees"
    yaw = fields.number("yaw_deg", expected, -360, 360, 90)
    pitch, roll = (fields.number(key, expected, -360, 360, 5, 0.0) for key in ("pitch_deg", "roll_deg"))
    return yaw, pitch, roll


def _translation(fields: Fields, key: str) -> FloatArray:
    return fields.numbers(key, [3], "three coordinates in metres", _TRANSLATION)


def _axes(fields: Fields, key: str) -> str:
    written = fields[key]
    if "axes" not in fields and isinstance(written, dict) and "yaw_deg" in written:
        raise fields.refusal(
            "axes", f"optical or body beside the angles of {key}, that is which frame they turn", "axes: body"
        )
    return fields.text("axes", ("optical", "body"), "optical")


def read_transform(fields: Fields, key: str) -> FloatArray:
    """Return the (4, 4) transform of a key, metres: a matrix, or a rotation and a translation.

    Raises:
        DataError: if it is invalid.
    """
    if isinstance(fields[key], dict):
        parts = fields.inside(key, (*_ROTATION_KEYS, "pitch_deg", "roll_deg", "translation_m"))
        return transform(_rotation(parts), _translation(parts, "translation_m"))
    rows = fields.matrix(key, [(3, 4), (4, 4)], "3 or 4 rows of 4 numbers, or a rotation and translation_m", _WRITTEN)
    matrix = np.vstack([rows, [0.0, 0.0, 0.0, 1.0]])[:4]
    try:
        check_transform(key, matrix)
    except ShapeError as error:
        raise DataError(f"{fields.name(key)}{str(error).removeprefix(key)}, such as {_WRITTEN}") from error
    return nearest_rigid(matrix)


def _rotation(parts: Fields) -> FloatArray:
    key = parts.one_of(*_ROTATION_KEYS, example="quaternion_wxyz: [0.5, -0.5, 0.5, -0.5]")
    if key == "yaw_deg":
        return _body_rotation(*_angles(parts))
    if key == "rodrigues":
        turn = parts.numbers(key, [3], "a rotation vector in radians", "[-1.2, 1.2, -1.2]")
        if np.linalg.norm(turn) > _TURN_RAD:
            raise parts.refusal(key, "a rotation vector in radians, at most one turn long", "[-1.2, 1.2, -1.2]")
        return np.asarray(Rotation.from_rotvec(turn).as_matrix())
    numbers = parts.numbers(key, [4], "a unit quaternion", "[0.5, -0.5, 0.5, -0.5]")
    if abs(np.linalg.norm(numbers) - 1) > 1e-2:
        raise parts.refusal(key, "a unit quaternion", "[0.5, -0.5, 0.5, -0.5]")
    return rotation_from_quaternion(numbers if key.endswith("wxyz") else np.roll(numbers, 1))
