"""Check of a rig: the ground grid of the ego frame drawn into the camera images, to reveal wrong conventions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.frame import Frame
from appocc.visualization.cameras import camera_rows
from appocc.visualization.canvas import GREEN, RED, YELLOW, Colour, caption, put_text
from appocc.visualization.layout import resized, side_by_side, stack_centred

STEP_M, REACH_M = 5, 40
_GRID, _HORIZON = (120, 190, 235), YELLOW
_HEIGHT_PX, _FAR_M = 320, 1e6
_LEGEND = f"red: x axis, ahead; green: y axis, to the left; yellow: horizon; on the ground, a line every {STEP_M} m"
# Minimum distance of labels (columns, rows).
_APART_PX = (60, 15)


class CameraAngles(NamedTuple):
    """Orientation and height of a camera.

    Attributes:
        yaw_deg: 0 forward, 90 to the left.
        pitch_deg: positive downward.
        roll_deg: clockwise, seen from behind.
        height_m: height of the optical centre above the ground.
    """

    yaw_deg: float
    pitch_deg: float
    roll_deg: float
    height_m: float

    @property
    def text(self) -> str:
        """The angles and the height for people."""
        angles = f"yaw {self.yaw_deg:+z.1f}, pitch {self.pitch_deg:+z.1f}, roll {self.roll_deg:+z.1f} deg"
        return f"{angles}, {self.height_m:.2f} m above ground"


def camera_angles(camera: Camera) -> CameraAngles:
    """Return yaw, pitch, roll and height of a camera, as in a rig file."""
    right, _, ahead = camera.ego_from_cam[:3, :3].T
    yaw = np.arctan2(ahead[1], ahead[0])
    pitch = np.arcsin(np.clip(-ahead[2], -1, 1))
    level_right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    level_down = np.cross(ahead, level_right)
    roll = np.arctan2(right @ level_down, right @ level_right)
    yaw_deg, pitch_deg, roll_deg = np.degrees([yaw, pitch, roll]).tolist()
    return CameraAngles(yaw_deg, pitch_deg, roll_deg, float(camera.ego_from_cam[2, 3]))


def rig_sheet(frame: Frame) -> ByteArray:
    """Return all images of a frame with the ground grid, (H, W, 3) RGB, arranged as the cameras around the car.

    Grid lines every 5 m up to 40 m; the x axis is red, the y axis green, the horizon yellow. Below, a legend.

    Raises:
        DataError: if the frame has no images.
    """
    rig = frame.rig.select(frame.images)
    if not len(rig):
        raise DataError(f"{frame.token}: expected images, got none")
    rows = [[_panel(frame.images[camera.channel], camera) for camera in row] for row in camera_rows(rig)]
    sheet = stack_centred([side_by_side(row) for row in rows])
    return np.vstack([sheet, caption(_LEGEND, sheet.shape[1])])


def _panel(image: ByteArray, camera: Camera) -> ByteArray:
    picture = resized(image, _HEIGHT_PX / image.shape[0])
    small = camera.resized(picture.shape[1], picture.shape[0])
    for at in range(-REACH_M, REACH_M + 1, STEP_M):
        if at:
            _line(picture, small, _along(at, across=False), _GRID)
            _line(picture, small, _along(at, across=True), _GRID)
    _line(picture, small, _along(0, across=False), RED, 2)
    _line(picture, small, _along(0, across=True), GREEN, 2)
    _line(picture, small, _horizon(small), _HORIZON)
    _label(picture, small)
    title = f"{camera.channel}: {camera_angles(camera).text}"
    put_text(picture, title, (6, picture.shape[0] - 8), scale=0.45)
    return picture


def _along(at_m: float, across: bool) -> FloatArray:
    """Return points (P, 3) on the ground, ego frame: the line y = at, or if `across` the line x = at."""
    way = np.arange(-REACH_M, REACH_M + 1e-9, 0.25)
    same, zero = np.full(len(way), float(at_m)), np.zeros(len(way))
    return np.stack([same, way, zero] if across else [way, same, zero], axis=1)


def _horizon(camera: Camera) -> FloatArray:
    """Return points (P, 3) at the height of a camera and so far away that they are on the horizon."""
    angle = np.linspace(-np.pi, np.pi, 721)
    level = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=1)
    return np.asarray(level * _FAR_M + camera.ego_from_cam[:3, 3])


def _line(picture: ByteArray, camera: Camera, points_ego: FloatArray, colour: Colour, width: int = 1) -> None:
    """Draw a straight line of points (P, 3), where it is in front of the camera and near the image."""
    uv, depth = camera.project_ego(points_ego)
    drawn = (depth > 0.1) & (np.abs(np.nan_to_num(uv, nan=1e9)) < 1e4).all(axis=1)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], drawn, [False]]).astype(int))).reshape(-1, 2)
    for start, stop in ends:
        # In sixteenths of a pixel, otherwise nearly horizontal lines are stepped.
        (u0, v0), (u1, v1) = np.round(uv[[start, stop - 1]] * 16).astype(int).tolist()
        cv2.line(picture, (u0, v0), (u1, v1), colour, width, cv2.LINE_AA, shift=4)


def _crossings() -> Iterator[tuple[FloatArray, str]]:
    """Yield points (3,) to label and their texts: along the axes first, then grid crossings, nearest first."""
    steps = [sign * at for at in range(STEP_M, REACH_M + 1, STEP_M) for sign in (1, -1)]
    for at in steps:
        yield np.array([at, 0.0, 0.0]), f"x {at:+d}"
        yield np.array([0.0, at, 0.0]), f"y {at:+d}"
    pairs = [(x, y) for x in steps for y in steps if not (x % 10 or y % 10)]
    for x, y in sorted(pairs, key=lambda pair: float(np.hypot(*pair))):
        yield np.array([x, y, 0.0]), f"{x:+d}, {y:+d}"


def _label(picture: ByteArray, camera: Camera) -> None:
    """Write distances at grid points; a label too close to an earlier one is omitted."""
    taken: list[FloatArray] = []
    for place, text in _crossings():
        uv, depth = camera.project_ego(place[None])
        if not camera.sees(uv, depth)[0] or any((np.abs(uv[0] - at) < _APART_PX).all() for at in taken):
            continue
        taken.append(uv[0])
        put_text(picture, text, (round(uv[0, 0]), round(uv[0, 1])), scale=0.38, centred=True)
