"""Fit of a fisheye to checkerboards: Kannala and Brandt's model, all poses and the lens at once by least squares.

`cv2.fisheye.calibrate` fits the same model, but ends with an error where a board is far from the axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.lenses import kannala_brandt

# Widths of lenses to begin with, over the longer side of the picture.
_WIDTHS_DEG = (100.0, 140.0, 180.0, 220.0)
_LENS = 8  # numbers: fx, fy, cx, cy, k1 to k4


def fit_fisheye(
    board: FloatArray, found: Sequence[FloatArray], size_px: tuple[int, int]
) -> tuple[FloatArray, FloatArray, float]:
    """Return K (3, 3), the coefficients k1 to k4, and the root mean square of the reprojection error in pixels.

    Args:
        board: (N, 3) corners of the board in its own frame.
        found: pixels (N, 2) of the corners in each picture.
        size_px: width and height of the pictures.

    Raises:
        DataError: if no lens fits.
    """
    pixels = np.stack(found)
    starts = [_start(board, pixels, size_px, wide_deg) for wide_deg in _WIDTHS_DEG]

    def errors(numbers: FloatArray) -> FloatArray:
        return (_project(numbers, board) - pixels).ravel()

    usable = [start for start in starts if start is not None]
    if not usable:
        raise DataError("no pose of the boards fits")
    best = min(usable, key=lambda start: float((errors(start) ** 2).sum()))
    fitted = least_squares(errors, best, x_scale="jac", loss="soft_l1").x
    fx, fy, cx, cy = fitted[:4]
    error_px = float(np.sqrt((errors(fitted).reshape(-1, 2) ** 2).sum(axis=1).mean()))
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), fitted[4:_LENS], error_px


def _start(board: FloatArray, pixels: FloatArray, size_px: tuple[int, int], wide_deg: float) -> FloatArray | None:
    """Return the numbers of an equidistant lens of a width with the poses that fit; None if a board has none."""
    focal = max(size_px) / np.radians(wide_deg)
    intrinsic = np.array([[focal, 0, (size_px[0] - 1) / 2], [0, focal, (size_px[1] - 1) / 2], [0, 0, 1]])
    lens = kannala_brandt(intrinsic, [0.0] * 4)
    numbers = [focal, focal, intrinsic[0, 2], intrinsic[1, 2], 0.0, 0.0, 0.0, 0.0]
    for corners in pixels:
        rays = lens.unproject(corners)
        if not (rays[:, 2] > 0.02).all():
            return None
        done, turn, shift = cv2.solvePnP(board, rays[:, :2] / rays[:, 2:], np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
        if not done:
            return None
        numbers += [*np.ravel(turn), *np.ravel(shift)]
    return np.array(numbers)


def _project(numbers: FloatArray, board: FloatArray) -> FloatArray:
    """Return the pixels (M, N, 2) of the corners (N, 3) in M pictures."""
    fx, fy, cx, cy, *k = numbers[:_LENS]
    poses = numbers[_LENS:].reshape(-1, 6)
    rotations = Rotation.from_rotvec(poses[:, :3]).as_matrix()
    x, y, z = np.moveaxis(np.einsum("mij,nj->mni", rotations, board) + poses[:, None, 3:], -1, 0)
    away = np.hypot(x, y) + 1e-12
    angle = np.arctan2(away, z)
    distance = angle * (1 + sum(c * angle ** (2 * i) for i, c in enumerate(k, start=1))) / away
    return np.stack([fx * x * distance + cx, fy * y * distance + cy], axis=-1)
