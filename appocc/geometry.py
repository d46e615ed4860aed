"""Rigid transforms and rotations: 4x4 float64 matrices named `target_from_source`, quaternions wxyz, radians."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from appocc.checks import BoolArray, FloatArray, check_finite, check_place, check_shape
from appocc.errors import ShapeError
from appocc.typing import Numbers, Points3, Rotations, Transform, Transforms

_ROUNDED = 1e-3


def rotation_from_quaternion(wxyz: ArrayLike) -> Rotations:
    """Return rotation matrices (..., 3, 3) of quaternions (..., 4) in wxyz order, which are normalised first.

    Raises:
        ShapeError: if the last axis is not 4, or a quaternion is not finite or nearly zero.
    """
    q = np.asarray(wxyz, dtype=np.float64)
    if q.shape[-1:] != (4,):
        raise ShapeError(f"quaternion wxyz: expected shape (..., 4), got {q.shape}")
    check_finite("quaternion wxyz", q)
    size = np.abs(q).max(axis=-1)  # not the length, which overflows for huge numbers
    if q.size and not (size.min() >= 1e-6 and size.max() <= 1e6):
        raise ShapeError(f"quaternion wxyz: expected a length of 1, got {size.min():.2g} .. {size.max():.2g}")
    matrices = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True).as_matrix()
    return np.asarray(matrices, dtype=np.float64).reshape(*q.shape[:-1], 3, 3)


def is_unit(wxyz: ArrayLike) -> BoolArray:
    """Return whether quaternions (..., 4) have a length of 1 to three decimals."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.abs(np.linalg.norm(wxyz, axis=-1) - 1) <= _ROUNDED)


def quaternion_from_rotation(rotation: ArrayLike) -> FloatArray:
    """Return the quaternion (4,) wxyz with w >= 0 of the rotation nearest to a matrix (3, 3)."""
    q = Rotation.from_matrix(np.asarray(rotation, dtype=np.float64)).as_quat(canonical=True, scalar_first=True)
    return np.asarray(q, dtype=np.float64)


def quaternion_from_yaw(yaw_rad: ArrayLike) -> FloatArray:
    """Return quaternions (..., 4) wxyz of counter-clockwise rotations (...) about +z."""
    half_rad = np.asarray(yaw_rad, dtype=np.float64) / 2
    zero = np.zeros_like(half_rad)
    return np.stack([np.cos(half_rad), zero, zero, np.sin(half_rad)], axis=-1)


def transform(rotation: ArrayLike, translation: ArrayLike) -> Transform:
    """Return the 4x4 transform of a rotation ((3, 3) matrix or (4,) quaternion wxyz) and a translation (3,), metres.

    Raises:
        ShapeError: if one has another shape or is not finite.
    """
    r = np.asarray(rotation, dtype=np.float64)
    if r.shape != (4,):
        check_shape("rotation", r, (3, 3))
        check_finite("rotation", r)
    t = np.asarray(translation, dtype=np.float64)
    check_shape("translation", t, (3,))
    check_place("translation", t)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_from_quaternion(r) if r.shape == (4,) else r
    matrix[:3, 3] = t
    return matrix


def inverse(target_from_source: Transform) -> Transform:
    """Return the inverse of a rigid transform: `source_from_target`."""
    rotation_t = target_from_source[:3, :3].T
    result = np.eye(4)
    result[:3, :3] = rotation_t
    result[:3, 3] = -rotation_t @ target_from_source[:3, 3]
    return result


def apply(target_from_source: Transform, points: Points3) -> Points3:
    """Transform points (..., 3) from the source frame to the target frame."""
    return np.asarray(points @ target_from_source[:3, :3].T + target_from_source[:3, 3])


def nearest_rigid(matrix: Transform) -> Transform:
    """Return the rigid transform nearest to a slightly rounded one (polar decomposition of the rotation)."""
    return transform(quaternion_from_rotation(matrix[:3, :3]), matrix[:3, 3])


def footprints(centre_m: ArrayLike, yaw_rad: ArrayLike, length_width_m: ArrayLike) -> FloatArray:
    """Return the corners (..., 4, 2) of boxes seen from above, counter-clockwise from front left.

    Args:
        centre_m: (..., 2) centres.
        yaw_rad: (...) headings, counter-clockwise from x.
        length_width_m: (..., 2) sizes along the heading and across.
    """
    centre, half = np.asarray(centre_m), np.asarray(length_width_m) / 2
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    ahead, left = np.stack([cos, sin], axis=-1) * half[..., :1], np.stack([-sin, cos], axis=-1) * half[..., 1:]
    return np.stack([centre + ahead + left, centre - ahead + left, centre - ahead - left, centre + ahead - left], -2)


def yaw_of(rotation: FloatArray) -> FloatArray:
    """Return the heading about +z, radians in (-pi, pi], of rotations (..., 3, 3) or transforms (..., 4, 4)."""
    return np.asarray(np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]), dtype=np.float64)


def wrap_angle(angle_rad: ArrayLike) -> FloatArray:
    """Wrap angles to [-pi, pi)."""
    return np.asarray((np.asarray(angle_rad, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi)


def interpolate_pose(times: Numbers, poses: Transforms, at: float) -> Transform:
    """Interpolate poses (N, 4, 4) at rising `times` (N,) at time `at`: linear translation, slerp rotation.

    Outside of the times, extrapolate the nearest step by at most its own length.

    Raises:
        ShapeError: if there are no poses.
    """
    if not len(times):
        raise ShapeError("poses: expected at least one, got none")
    if len(times) == 1:
        return np.array(poses[0])
    i = int(np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2))
    share = float(np.clip((at - times[i]) / max(times[i + 1] - times[i], 1e-12), -1.0, 2.0))
    return np.asarray(poses_between(poses[i : i + 1], poses[i + 1 : i + 2], share)[0])


def poses_between(first: Transforms, second: Transforms, share: float) -> Transforms:
    """Interpolate between poses `first` and `second`, both (N, 4, 4): linear translation, slerp rotation."""
    turn = Rotation.from_matrix(first[:, :3, :3].transpose(0, 2, 1) @ second[:, :3, :3]).as_rotvec()
    between = first.copy()
    between[:, :3, :3] = first[:, :3, :3] @ Rotation.from_rotvec(turn * share).as_matrix()
    between[:, :3, 3] += share * (second[:, :3, 3] - first[:, :3, 3])
    return between


def mean_pose(poses: Transforms) -> Transform:
    """Return the mean rotation and median translation of poses (N, 4, 4) with small deviations."""
    rotation = Rotation.from_matrix(poses[:, :3, :3]).mean().as_matrix()
    return transform(rotation, np.median(poses[:, :3, 3], axis=0))
