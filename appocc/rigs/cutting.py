"""The pinhole views that are cut out of a source camera's picture: one for a moderate lens, several for a wide one.

A view holds only pixels that the lens sees: it is shrunk, not masked, so that what a pinhole camera covers is what
was seen. The network is trained on level views 45 to 120 degrees wide, so a wide lens is cut into level views that
are at most `WIDEST_VIEW_DEG` wide, side by side, whatever the tilt of the lens.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.camera import Camera
from appocc.checks import BoolArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.geometry import transform
from appocc.rigs.source_camera import SourceCamera
from appocc.rigs.source_rig import SourceRig, View

WIDEST_PINHOLE_DEG = 115.0
WIDEST_VIEW_DEG = 100.0
# A wide lens is cut where it sees the ground from 4 m on (at a height of 1.5 m) and the first of these tops that it
# sees over the least span: a lens that looks down sees little above the horizon.
_GROUND_DEG = (-20.0, -8.0)
_TOPS_DEG = (8.0, 2.0, -4.0)
_LEAST_SPAN_DEG = 40.0
_HALF_TURN_DEG = 100.0
# Extent of a level view above and below the horizon, per width.
_ABOVE, _BELOW = 0.22, 0.42
_MOST_PX = 1920
_LEAST_PX = 8
# Nodes of the grid on which the largest seen rectangle is found.
_NODES = (81, 61)
_TRIM = 0.002
_STEEPEST = np.tan(np.radians(60.0))
_FORWARD_LEFT_UP_FROM_CAM = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])


class _Rectangle(NamedTuple):
    """Slopes x/z and y/z of the sides of a view, in its camera frame."""

    left: float
    top: float
    right: float
    bottom: float

    def trimmed(self, share: float) -> _Rectangle:
        """Return the rectangle without a share of its width and height at each side."""
        wide, high = (self.right - self.left) * share, (self.bottom - self.top) * share
        return _Rectangle(self.left + wide, self.top + high, self.right - wide, self.bottom - high)


def cut_rig(cameras: tuple[SourceCamera, ...], ego_vehicle: EgoVehicle) -> SourceRig:
    """Return the rig of source cameras with the views that are cut out of them.

    Raises:
        DataError: if a lens sees too little.
    """
    return SourceRig(cameras, tuple(view for camera in cameras for view in cut_views(camera)), ego_vehicle)


def cut_views(camera: SourceCamera) -> tuple[View, ...]:
    """Return the pinhole views of a source camera, from left to right.

    Raises:
        DataError: if the lens sees too little.
    """
    if (pinhole := camera.pinhole) is not None:
        size = camera.width_px, camera.height_px
        return (View(Camera(camera.channel, *size, pinhole.intrinsic, camera.ego_from_cam), camera.name),)
    if _span_deg(camera) <= WIDEST_PINHOLE_DEG:
        return (_view(camera, camera.channel, camera.ego_from_cam[:3, :3], _around_picture(camera)),)
    return _level_views(camera)


def _level_views(camera: SourceCamera) -> tuple[View, ...]:
    heading = _heading_rad(camera)
    for top in _TOPS_DEG:
        left, right = (_reach_deg(camera, heading, side, (*_GROUND_DEG, top)) for side in (1, -1))
        if left + right >= _LEAST_SPAN_DEG:
            break
    else:
        raise DataError(f"cameras.{camera.name}: expected a view of the horizon ahead, got none")
    count = int(np.ceil((left + right) / WIDEST_VIEW_DEG))
    wide = (left + right) / count
    slope = float(np.tan(np.radians(wide) / 2))
    around = _Rectangle(-slope, -2 * slope * _ABOVE, slope, 2 * slope * _BELOW)
    views = []
    for number in range(count):
        yaw = heading + np.radians(left - (number + 0.5) * wide)
        channel = camera.channel if count == 1 else f"{camera.channel}_{number + 1}"
        views.append(_view(camera, channel, _level(yaw), around))
    return tuple(views)


def _span_deg(camera: SourceCamera) -> float:
    """Return how wide the lens sees along the row of its axis."""
    axis = camera.lens.project(np.array([[0.0, 0.0, 1.0]]))[0]
    row = np.clip(axis[1], 0, camera.height_px - 1)
    pixels = np.stack([np.arange(camera.width_px, dtype=np.float64), np.full(camera.width_px, row)], axis=1)
    rays = camera.lens.unproject(pixels)
    angles = np.degrees(np.arctan2(rays[:, 0], rays[:, 2]))
    return float(np.nanmax(angles) - np.nanmin(angles)) if np.isfinite(angles).any() else 0.0


def _around_picture(camera: SourceCamera) -> _Rectangle:
    """Return the rectangle of slopes around all pixels that see something."""
    columns, rows = np.linspace(0, camera.width_px - 1, _NODES[0]), np.linspace(0, camera.height_px - 1, _NODES[1])
    rays = camera.lens.unproject(np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
    rays = rays[rays[:, 2] > 0]
    if not len(rays):
        raise DataError(f"cameras.{camera.name}: expected a lens that sees something ahead, got none")
    slopes = np.clip(rays[:, :2] / rays[:, 2:], -_STEEPEST, _STEEPEST)
    return _Rectangle(*slopes.min(axis=0).tolist(), *slopes.max(axis=0).tolist())


def _heading_rad(camera: SourceCamera) -> float:
    """Return the yaw of the optical axis; that of the upper side of the picture for a camera that looks down."""
    ahead = camera.ego_from_cam[:3, 2]
    if np.hypot(ahead[0], ahead[1]) < 0.1:
        ahead = -camera.ego_from_cam[:3, 1]
    return float(np.arctan2(ahead[1], ahead[0]))


def _reach_deg(camera: SourceCamera, heading_rad: float, side: int, seen_deg: Sequence[float]) -> float:
    """Return how far to a side of the heading, 1 left or -1 right, the lens sees some elevations without a gap."""
    turn = np.arange(0.0, _HALF_TURN_DEG + 0.25, 0.5)
    yaw, up = np.meshgrid(heading_rad + side * np.radians(turn), np.radians(seen_deg))
    rays = np.stack([np.cos(yaw) * np.cos(up), np.sin(yaw) * np.cos(up), np.sin(up)], axis=-1)
    pixels = camera.lens.project(rays.reshape(-1, 3) @ camera.ego_from_cam[:3, :3])
    gaps = np.flatnonzero(~camera.sees(pixels).reshape(yaw.shape).all(axis=0))
    return float(turn[gaps[0] - 1] if len(gaps) and gaps[0] else 0.0 if len(gaps) else turn[-1])


def _level(yaw_rad: float) -> FloatArray:
    """Return the ego-from-camera rotation of a level camera."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.asarray(np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ _FORWARD_LEFT_UP_FROM_CAM)


def _view(camera: SourceCamera, channel: str, ego_from_view: FloatArray, around: _Rectangle) -> View:
    """Return the largest view within a rectangle of slopes of which the lens sees every pixel.

    Raises:
        DataError: if there is none of a usable size.
    """
    cam_from_view = camera.ego_from_cam[:3, :3].T @ ego_from_view
    sides = _largest_seen(camera, cam_from_view, around)
    focal = _focal_px(camera, cam_from_view, sides)
    while sides is not None:
        size = int((sides.right - sides.left) * focal) + 1, int((sides.bottom - sides.top) * focal) + 1
        if min(size) < _LEAST_PX:
            break
        intrinsic = np.array([[focal, 0, -sides.left * focal], [0, focal, -sides.top * focal], [0, 0, 1]])
        pixels = _source_pixels(camera, cam_from_view, intrinsic, size)
        if camera.sees(pixels.reshape(2, -1).T).all():
            pose = transform(ego_from_view, camera.ego_from_cam[:3, 3])
            return View(Camera(channel, *size, intrinsic, pose), camera.name, pixels.astype(np.float32))
        sides = sides.trimmed(_TRIM)
    raise DataError(f"cameras.{camera.name}: expected a view of {_LEAST_PX} pixels or more, got less")


def _largest_seen(camera: SourceCamera, cam_from_view: FloatArray, around: _Rectangle) -> _Rectangle:
    """Return the largest rectangle of slopes within another that the lens sees."""
    x = np.linspace(around.left, around.right, _NODES[0])
    y = np.linspace(around.top, around.bottom, _NODES[1])
    rays = np.stack([*np.meshgrid(x, y), np.ones((len(y), len(x)))], axis=-1)
    seen = camera.sees(camera.lens.project(rays.reshape(-1, 3) @ cam_from_view.T)).reshape(len(y), len(x))
    top, bottom, left, right = _largest_rectangle(seen)
    return _Rectangle(float(x[left]), float(y[top]), float(x[right]), float(y[bottom]))


def _largest_rectangle(seen: BoolArray) -> tuple[int, int, int, int]:
    """Return the first and last row and column (top, bottom, left, right) of the largest rectangle of True."""
    best, found = 0, (0, 0, 0, 0)
    for top in range(len(seen)):
        column = np.ones(seen.shape[1], np.bool_)
        for bottom in range(top, len(seen)):
            column &= seen[bottom]
            left, right = _longest_run(column)
            area = (right - left) * (bottom - top)
            if area > best:
                best, found = area, (top, bottom, left, right)
    return found


def _longest_run(flags: BoolArray) -> tuple[int, int]:
    """Return the first and last index of the longest run of True; (0, 0) if there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    if not len(edges):
        return 0, 0
    starts, ends = edges[::2], edges[1::2] - 1
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest])


def _focal_px(camera: SourceCamera, cam_from_view: FloatArray, sides: _Rectangle) -> float:
    """Return the focal length with which the middle of a view has as many pixels as the picture."""
    middle = np.array([(sides.left + sides.right) / 2, (sides.top + sides.bottom) / 2])
    step = 1e-3
    slopes = middle + step * np.array([[-1.0, 0], [1, 0], [0, -1], [0, 1]])
    pixels = camera.lens.project(np.concatenate([slopes, np.ones((4, 1))], axis=1) @ cam_from_view.T)
    across, down = (pixels[1] - pixels[0]) / (2 * step), (pixels[3] - pixels[2]) / (2 * step)
    density = np.sqrt(abs(across[0] * down[1] - across[1] * down[0]))
    most = (_MOST_PX - 1) / max(sides.right - sides.left, sides.bottom - sides.top, 1e-9)
    return float(min(np.nan_to_num(density, nan=most), most))


def _source_pixels(
    camera: SourceCamera, cam_from_view: FloatArray, intrinsic: FloatArray, size_px: tuple[int, int]
) -> FloatArray:
    """Return the source pixels (2, H, W) of the pixels of a view."""
    u, v = np.meshgrid(*(np.arange(n, dtype=np.float64) for n in size_px))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3) @ (cam_from_view @ np.linalg.inv(intrinsic)).T
    return np.asarray(camera.lens.project(rays).T.reshape(2, *u.shape))
