"""The street of the tiny Waymo segment: its vehicle, its car, and what cameras and LiDARs see of it.

LiDAR rays are cast here: nothing is shared with the importer. The vehicle drives along a street at 5 m/s and passes a
parked car; its heading is not that of its motion.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from import_checks import ball_jpeg
from scipy.spatial.transform import Rotation

NAME = "10017090168044687777_6380_000_6400_000"
START_US = 1_553_629_304_000_000
FRAMES, SPEED, YAW = 6, 5.0, 0.1
ORIGIN = np.array([-3000.0, 7000.0, 20.0])
# What moves the poses of version 1 onto its map.
DRIFT = np.array([0.4, -0.3, 0.05])
SIZE = (320, 240)
K = np.array([[260.0, 0, 158.5], [0, 261.0, 121.0], [0, 0, 1]])
DISTORTION = np.array([-0.24, 0.06, 0.001, -0.002, -0.01])  # k1, k2, p1, p2, k3
CAR, CAR_LWH, CAR_YAW = np.array([24.0, 9.0, 0.8]), np.array([4.4, 1.8, 1.6]), 0.3
# Corners of a place in which nothing is labelled; in version 1.
NO_LABEL_ZONE = np.array([[10.0, -14.0, 0], [20.0, -14.0, 0], [20.0, -8.0, 0], [10.0, -8.0, 0]])
CAR_RGB = (180, 180, 250)
# Columns right, down, ahead of a camera that is ahead, left, up.
FROM_WAYMO = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
CAMERAS = {1: (0.0, [1.5, 0.0, 2.1], 0.061), 4: (1.6, [1.4, 0.1, 2.1], 0.04), 5: (-1.6, [1.4, -0.1, 2.1], 0.05)}
# LaserName -> yaw, place, rows and columns of the range image.
LASERS = {1: (2.5, [1.4, 0.0, 2.2], (24, 720)), 2: (0.02, [4.0, 0.0, 0.7], (12, 480))}
BEAMS = {1: np.radians(np.linspace(-15, 3, 24) + 0.2 * np.sin(np.arange(24))), 2: np.radians([-20.0, 15.0])}


def ego(seconds: float) -> np.ndarray:
    """Pose of the vehicle so long after the start."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("ZYX", [YAW, 0.004, -0.003]).as_matrix()
    pose[:3, 3] = ORIGIN + np.array([SPEED * seconds, 0, 0])
    return pose


def mounted(yaw: float, place: list[float]) -> np.ndarray:
    """Pose of a sensor in the vehicle frame, axes ahead, left, up."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_euler("z", yaw).as_matrix(), place
    return pose


def car() -> np.ndarray:
    """Pose of the car in the world."""
    return mounted(CAR_YAW, (ORIGIN + CAR).tolist())


def box_in(pose: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and heading of the car in the vehicle frame at a pose."""
    found = np.linalg.inv(pose) @ car()
    return found[:3, 3], float(np.arctan2(found[1, 0], found[0, 0]))


def project(points_cam: np.ndarray) -> np.ndarray:
    """Pixels of points in the camera frame, by OpenCV."""
    return cv2.projectPoints(np.ascontiguousarray(points_cam), np.zeros(3), np.zeros(3), K, DISTORTION)[0].reshape(
        -1, 2
    )


def camera_pose(camera: int, seconds: float) -> np.ndarray:
    """Pose of a camera in the world, axes right, down, ahead."""
    yaw, place, _ = CAMERAS[camera]
    pose: np.ndarray = ego(seconds) @ mounted(yaw, place)
    pose[:3, :3] = pose[:3, :3] @ FROM_WAYMO
    return pose


def car_outline(camera: int, seconds: float) -> np.ndarray:
    """Pixels around the car in a picture."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    corners = np.c_[signs * CAR_LWH / 2, np.ones(8)] @ (np.linalg.inv(camera_pose(camera, seconds)) @ car()).T
    return np.asarray(cv2.convexHull(project(corners[:, :3]).round().astype(np.int32)))


@cache
def jpeg(camera: int, seconds: float) -> bytes:
    """The picture of a camera: balls, and the car as a flat patch."""
    data = ball_jpeg(project, SIZE, camera_pose(camera, seconds), ORIGIN)
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    if camera == 1:
        cv2.fillConvexPoly(picture, car_outline(camera, seconds), CAR_RGB[::-1])
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes())


# Panoptic labels: (frame, camera) that have one, divisor, and number of a pixel's class (camera_segmentation.proto).
LABELLED = {(0, 1), (0, 4), (0, 5), (1, 1)}
DIVISOR = 1000
UNDEFINED, CAR_TYPE, LANE_MARKER, SKY = 0, 2, 21, 25


@cache
def label_image(camera: int, seconds: float) -> np.ndarray:
    """The class of each pixel of a picture, as the camera takes it: sky above, road with a line below, the car."""
    types = np.full(SIZE[::-1], 20, np.uint16)
    types[:100] = SKY
    types[180:, 200:216] = LANE_MARKER
    types[-20:] = UNDEFINED
    if camera == 1:
        cv2.fillConvexPoly(types, car_outline(camera, seconds), CAR_TYPE)
    return types


@cache
def panoptic_png(camera: int, seconds: float) -> bytes:
    """The label of a picture: a PNG of 16 bits; the car is instance 7."""
    types = label_image(camera, seconds)
    label = types * np.uint16(DIVISOR) + np.uint16(7) * (types == CAR_TYPE)
    return bytes(cv2.imencode(".png", label)[1].tobytes())


def inclinations(laser: int) -> np.ndarray:
    """Inclination of each row of the range image: the highest beam is the first row."""
    rows = LASERS[laser][2][0]
    if laser == 1:
        return BEAMS[1][::-1]
    low, high = BEAMS[2].tolist()
    edges = np.linspace(low, high, rows + 1)
    return np.asarray(((edges[1:] + edges[:-1]) / 2)[::-1])


@cache
def sweep(laser: int, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Both returns, the pose of every pixel (roll, pitch, yaw, x, y, z), and the number of returns in the car."""
    _, place, (rows, columns) = LASERS[laser]
    first, second = np.zeros((rows, columns, 4), np.float32), np.zeros((rows, columns, 4), np.float32)
    poses = np.zeros((rows, columns, 6))
    count = 0
    for column in range(columns):
        # The upper LiDAR turns clockwise during the frame; the others are at once.
        pose = ego(seconds + (0.1 * (column + 0.5) / columns if laser == 1 else 0.05))
        poses[:, column] = [*Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX")[::-1], *pose[:3, 3]]
        azimuth, up = np.pi - 2 * np.pi * (column + 0.5) / columns, inclinations(laser)
        rays = np.stack([np.cos(azimuth) * np.cos(up), np.sin(azimuth) * np.cos(up), np.sin(up)], axis=1)
        origin = pose[:3, :3] @ place + pose[:3, 3]
        near, far = hits(origin, rays @ pose[:3, :3].T)
        ground = (ORIGIN[2] - origin[2]) / np.minimum((rays @ pose[:3, :3].T)[:, 2], -1e-9)
        on_car = np.isfinite(near)
        count += int(on_car.sum())
        first[:, column, 0] = np.where(ground < 60, ground, -1)
        first[on_car, column, 0] = np.minimum(near + 0.05, (near + far) / 2)[on_car]
        first[:, column, 1] = np.where(on_car, 2.0, 0.1)
        inside = on_car & (far > near + 0.5) & (column % 5 == 0)
        second[:, column, 0] = np.where(inside, near + 0.4, -1)
        count += int(inside.sum())
    return first, second, poses, count


def hits(origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances at which rays enter and leave the car; not finite if they miss it."""
    pose = np.linalg.inv(car())
    start, ways = pose[:3, :3] @ origin + pose[:3, 3], rays @ pose[:3, :3].T
    sides = np.stack([(-CAR_LWH / 2 - start) / ways, (CAR_LWH / 2 - start) / ways])
    near, far = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
    missed = (near > far) | (near < 0)
    return np.where(missed, np.inf, near), np.where(missed, np.inf, far)
