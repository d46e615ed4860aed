"""Levelling of an ego frame: its z axis along the normal of the ground, as maps and networks expect.

A tilt of two degrees raises or lowers the ground 14 m away by half a metre, and moves what a camera sees there by
metres.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from appocc.checks import FloatArray, check_shape
from appocc.geometry import transform

# Ground beyond this distance may have another slope.
_RANGE_M = 30.0
# LiDAR points nearer than this are the vehicle itself; the lowest one in each cell of this size may be ground.
_BODY_M, _CELL_M = 3.0, 1.0
# Ground points needed, and how far they must spread along each axis (standard deviation, metres).
_LEAST_POINTS, _LEAST_SPREAD_M = 10, 3.0
# Residuals beyond this count less (Cauchy loss), metres; a steeper plane is no ground, radians.
_RESIDUAL_M, _MOST_TILT_RAD = 0.1, 0.1
# Less than this is level.
_LEVEL_RAD, _LEVEL_M = np.radians(0.2), 0.03


def lowest_points(points_m: FloatArray) -> FloatArray:
    """Return the lowest point (M, 3) of each square metre around the ego vehicle: most of them lie on the ground.

    Args:
        points_m: (N, 3) LiDAR points in the ego frame, metres.

    Raises:
        ShapeError: if the points have another shape.
    """
    check_shape("points", points_m, (None, 3))
    distance = np.hypot(points_m[:, 0], points_m[:, 1])
    near = (distance > _BODY_M) & (distance < _RANGE_M)
    near &= np.abs(points_m[:, 2]) < _CELL_M + distance * np.tan(_MOST_TILT_RAD)  # reflections lie deep below
    points_m = points_m[near]
    cell = np.floor(points_m[:, :2] / _CELL_M)
    order = np.lexsort((points_m[:, 2], cell[:, 1], cell[:, 0]))
    first = np.ones(len(order), np.bool_)
    first[1:] = (np.diff(cell[order], axis=0) != 0).any(axis=1)
    return np.asarray(points_m[order[first]])


def is_level(ego_from_level: FloatArray) -> bool:
    """Return whether a level frame (4, 4) is the ego frame but for what no map shows: 0.2 degrees, 3 cm."""
    tilt_rad = np.hypot(*ego_from_level[:2, 2])
    return bool(tilt_rad < _LEVEL_RAD and abs(ego_from_level[2, 3]) < _LEVEL_M)


def ego_from_level(ground_m: FloatArray) -> FloatArray | None:
    """Return the pose (4, 4) of a level frame on the ground, below the origin; x keeps its heading.

    Args:
        ground_m: (N, 3) points on the ground in the ego frame, metres, x forward, z up; those within 30 m
            are used, and some may lie beside the ground.

    Returns:
        The pose in the ego frame; None if the points are too few or too close together, or do not lie on a plane
        that can be the ground.

    Raises:
        ShapeError: if the points have another shape.
    """
    check_shape("ground points", ground_m, (None, 3))
    ground_m = ground_m[np.hypot(ground_m[:, 0], ground_m[:, 1]) < _RANGE_M]
    if len(ground_m) < _LEAST_POINTS or min(ground_m[:, :2].std(axis=0)) < _LEAST_SPREAD_M:
        return None
    terms = np.column_stack([ground_m[:, :2], np.ones(len(ground_m))])

    def residuals(plane: FloatArray) -> FloatArray:
        return np.asarray(terms @ plane - ground_m[:, 2])

    start = [0.0, 0.0, float(np.median(ground_m[:, 2]))]
    along_x, along_y, height = least_squares(residuals, start, loss="cauchy", f_scale=_RESIDUAL_M).x
    if np.hypot(along_x, along_y) > _MOST_TILT_RAD:
        return None
    return ground_pose(along_x, along_y, height)


def ground_pose(along_x: float, along_y: float, height_m: float) -> FloatArray:
    """Return the pose (4, 4) of a level frame on the plane z = along_x x + along_y y + height_m; x keeps heading."""
    up = np.array([-along_x, -along_y, 1.0]) / np.sqrt(1 + along_x**2 + along_y**2)
    ahead = np.array([1.0, 0.0, along_x]) / np.hypot(1.0, along_x)
    return transform(np.column_stack([ahead, np.cross(up, ahead), up]), [0.0, 0.0, height_m])
