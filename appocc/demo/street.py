"""The street of the demo: areas and lines, from which both the ground's picture and the vector map are made.

Street frame: x along the street, y to the left, z up, metres; the ground is the plane z = 0.
"""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import apply, quaternion_from_yaw, transform

LANE_M, PARKING_M, PAVEMENT_M = 3.5, 2.4, 3.2
KERB_Y_M = LANE_M + PARKING_M
LOW_M, HIGH_M = np.array([0.0, -60.0]), np.array([160.0, 60.0])
# The street that crosses: its middle, half its width, and how far from its middle markings end.
CROSS_X_M, CROSS_HALF_M, CROSS_CLEAR_M = 106.1, 4.0, 6.5
LINE_WIDTH_M = 0.15
# Where along the street there are markings and parking lanes: on both sides of the crossing.
_ALONG = ((float(LOW_M[0]), CROSS_X_M - CROSS_CLEAR_M), (CROSS_X_M + CROSS_CLEAR_M, float(HIGH_M[0])))
# A turn and a shift, so that nothing is right by the accident of two frames being the same.
WORLD_FROM_STREET = transform(quaternion_from_yaw(0.3), [200.0, 200.0, 0.0])


def rectangle(x0: float, x1: float, y0: float, y1: float) -> FloatArray:
    """Corners (4, 2), counter-clockwise."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def drivable_areas() -> list[FloatArray]:
    """Rectangles (4, 2), street frame: the street with its parking lanes, and the one that crosses it."""
    return [
        rectangle(LOW_M[0], HIGH_M[0], -KERB_Y_M, KERB_Y_M),
        rectangle(CROSS_X_M - CROSS_HALF_M, CROSS_X_M + CROSS_HALF_M, LOW_M[1], HIGH_M[1]),
    ]


def lane_lines() -> list[FloatArray]:
    """White lines (2, 2), street frame, between the lanes and the parking lanes; they stop at the crossing."""
    return [np.array([[a, y], [b, y]]) for y in (-LANE_M, LANE_M) for a, b in _ALONG]


def centre_lines() -> list[FloatArray]:
    """Yellow dashes (2, 2), street frame, 3 m long and 3 m apart, between the two directions of both streets."""
    along = np.arange(LOW_M[0], HIGH_M[0] - 3, 6.0)
    across = np.arange(LOW_M[1], HIGH_M[1] - 3, 6.0)
    clear_x = np.abs(along + 1.5 - CROSS_X_M) > CROSS_CLEAR_M + 1.5
    clear_y = np.abs(across + 1.5) > KERB_Y_M + 3.0
    dashes = [np.array([[x, 0.0], [x + 3, 0.0]]) for x in along[clear_x]]
    return dashes + [np.array([[CROSS_X_M, y], [CROSS_X_M, y + 3]]) for y in across[clear_y]]


def stop_lines() -> list[FloatArray]:
    """Rectangles (4, 2), street frame, of the white stop lines on both sides of the crossing."""
    near, far = CROSS_X_M - CROSS_CLEAR_M, CROSS_X_M + CROSS_CLEAR_M
    half = LINE_WIDTH_M / 2
    return [rectangle(near, near + 0.4, -LANE_M + half, -half), rectangle(far - 0.4, far, half, LANE_M - half)]


def parking_lanes() -> list[FloatArray]:
    """Rectangles (4, 2), street frame, along both kerbs; they stop at the crossing."""
    return [rectangle(a, b, y, y + PARKING_M) for y in (-KERB_Y_M, LANE_M) for a, b in _ALONG]


def in_world(xy_m: FloatArray) -> FloatArray:
    """Points (N, 2) of the street in the world (N, 2)."""
    return apply(WORLD_FROM_STREET, np.pad(xy_m, ((0, 0), (0, 1))))[:, :2]
