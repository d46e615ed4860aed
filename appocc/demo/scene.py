"""What stands on the demo's street, how the ego drives through it, and which sensors it carries."""

from __future__ import annotations

import numpy as np

from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray
from appocc.demo.bodies import Colour, Solid, house
from appocc.demo.street import CROSS_X_M, HIGH_M, LANE_M, LOW_M
from appocc.demo.vehicles import Vehicle
from appocc.geometry import transform

EGO_START_X_M, EGO_SPEED_MPS = 60.0, 6.0
_PI = float(np.pi)
_PARKED_Y_M = 4.75

# The free gap behind the silver car runs from x = 69 to x = 82.
VEHICLES = (
    Vehicle("silver-car", "car", (174, 177, 182), 84.3, -_PARKED_Y_M),
    Vehicle("blue-car", "car", (30, 70, 158), 66.5, -_PARKED_Y_M),
    Vehicle("black-car", "car", (26, 26, 30), 95.5, -_PARKED_Y_M),
    Vehicle("red-car", "car", (182, 26, 28), 79.5, _PARKED_Y_M, _PI),
    Vehicle("green-car", "car", (28, 98, 62), 96.5, _PARKED_Y_M, _PI),
    Vehicle("white-truck", "truck", (232, 232, 228), 61.0, _PARKED_Y_M, _PI),
    Vehicle("white-car", "car", (236, 236, 234), 78.0, -LANE_M / 2, 0.0, 6.4),
    Vehicle("orange-bus", "bus", (222, 112, 26), 36.0, -LANE_M / 2, 0.0, 6.0),
    Vehicle("brown-car", "car", (112, 70, 40), 113.0, LANE_M / 2, _PI, 7.0),
    Vehicle("yellow-car", "car", (228, 184, 34), CROSS_X_M - 2.0, 10.0, -_PI / 2),
)

_WALLS: tuple[Colour, ...] = (
    (178, 122, 98),
    (198, 184, 156),
    (150, 158, 164),
    (206, 198, 188),
    (166, 142, 112),
    (186, 150, 128),
)
# Houses begin this far from the middle of the street, and keep this far from the one that crosses.
_FRONT_M, _CORNER_M = 15.0, 12.0

# Channel, yaw in degrees, horizontal field of view in degrees (paper, section IV.B), place in the ego frame.
_CAMERAS = (
    ("CAM_FRONT_LEFT", 55, 70, (1.5, 0.45, 1.6)),
    ("CAM_FRONT", 0, 70, (1.7, 0.0, 1.6)),
    ("CAM_FRONT_RIGHT", -55, 70, (1.5, -0.45, 1.6)),
    ("CAM_BACK_LEFT", 110, 70, (1.0, 0.45, 1.6)),
    ("CAM_BACK", 180, 110, (-0.4, 0.0, 1.6)),
    ("CAM_BACK_RIGHT", -110, 70, (1.0, -0.45, 1.6)),
)
# nuScenes' LiDAR: x to the right, y forward; 32 beams from -30 to +10 degrees.
EGO_FROM_LIDAR = transform(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), [0.9, 0.0, 1.85])
BEAMS_RAD = np.radians(np.linspace(-30.0, 10.0, 32))


def street_from_ego(time_s: float) -> FloatArray:
    """(4, 4) pose of the ego: along the middle of the right lane at constant speed."""
    return transform(np.eye(3), [EGO_START_X_M + EGO_SPEED_MPS * time_s, -LANE_M / 2, 0.0])


def rig(width_px: int) -> CameraRig:
    """The paper's six cameras with 16:9 pictures of some width."""
    return CameraRig(tuple(_camera(*row, width_px) for row in _CAMERAS))


def _camera(channel: str, yaw_deg: int, fov_deg: int, place_m: tuple[float, float, float], width_px: int) -> Camera:
    height_px = round(width_px * 9 / 16)
    focal = width_px / 2 / np.tan(np.radians(fov_deg) / 2)
    intrinsic = np.array([[focal, 0, (width_px - 1) / 2], [0, focal, (height_px - 1) / 2], [0, 0, 1]])
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    right_down_ahead = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    return Camera(channel, width_px, height_px, intrinsic, transform(right_down_ahead, place_m))


def houses_along(random: np.random.Generator) -> list[Solid]:
    """Rows of houses on both sides of the street, none on the one that crosses."""
    houses = []
    for side in (-1, 1):
        x = float(LOW_M[0]) - 20
        while x < HIGH_M[0] + 40:
            width, depth, height, gap = random.uniform([9, 9, 5, 1], [17, 14, 13, 5]).tolist()
            wall = _WALLS[int(random.integers(len(_WALLS)))]
            if x + width < CROSS_X_M - _CORNER_M or x > CROSS_X_M + _CORNER_M:
                near, far = side * _FRONT_M, side * (_FRONT_M + depth)
                houses.append(house((x, x + width), (min(near, far), max(near, far)), height, wall))
            x += width + gap
    return houses


def solids_at(time_s: float, houses: list[Solid]) -> list[Solid]:
    """Everything that stands on the ground at a time."""
    return [*houses, *(solid for vehicle in VEHICLES for solid in vehicle.solids(time_s))]
