"""Random variants of a camera rig, so that a network does not learn the geometry of one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.geometry import transform
from appocc.rigs.cutting import cut_views
from appocc.rigs.source_camera import SourceCamera
from appocc.rigs.source_rig import SourceRig, View

HEIGHT_M = (1.3, 2.2)
FIELD_OF_VIEW_DEG = (45.0, 120.0)
# Half-widths of the uniform distributions: of the shift that all cameras share, and of each camera's own.
_SHIFT_M, _OWN_SHIFT_M = (0.3, 0.0), (0.12, 0.08, 0.04)
_PITCH_DEG, _OWN_PITCH_DEG = 3.0, 2.0
_ROLL_DEG, _YAW_DEG = 1.5, 10.0
_OWN_ZOOM = 0.08
# Of other lenses than pinholes: change of the height of all cameras, and their least height.
_LIFT_M, _LEAST_HEIGHT_M = 0.3, 0.4


def vary_rig(rig: CameraRig, random: np.random.Generator) -> CameraRig:
    """Return the rig with other mounting points, angles and focal lengths; channels and image sizes stay.

    The mean height of the cameras is uniform in `HEIGHT_M` and the horizontal field of view of the median camera in
    `FIELD_OF_VIEW_DEG`; the others are scaled and shifted with it, and each camera deviates a little on its own. No
    camera leaves `FIELD_OF_VIEW_DEG` if it was within it before.
    """
    heights = [float(camera.ego_from_cam[2, 3]) for camera in rig]
    lift = random.uniform(*HEIGHT_M) - np.mean(heights)
    shift = np.array([random.uniform(-_SHIFT_M[0], _SHIFT_M[0]), _SHIFT_M[1], lift])
    pitch_deg = random.uniform(-_PITCH_DEG, _PITCH_DEG)
    median = float(np.median([_slope(camera) for camera in rig]))
    zoom = np.tan(np.radians(random.uniform(*FIELD_OF_VIEW_DEG)) / 2) / median
    return rig.with_cameras(_vary_camera(camera, random, shift, pitch_deg, zoom) for camera in rig)


def vary_source_rig(source: SourceRig, random: np.random.Generator) -> SourceRig:
    """Return a rig of any lenses with other mounting points and angles; lenses, picture sizes and channels stay.

    A camera whose lens would be cut into other views, or could not be cut, stays where it is.
    """
    shift = np.array([random.uniform(-1, 1) * _SHIFT_M[0], _SHIFT_M[1], random.uniform(-1, 1) * _LIFT_M])
    pitch_deg = random.uniform(-_PITCH_DEG, _PITCH_DEG)
    cameras, views = list[SourceCamera](), list[View]()
    for camera in source.cameras:
        pose = _vary_pose(camera.ego_from_cam, random, shift, pitch_deg).copy()
        pose[2, 3] = max(pose[2, 3], min(_LEAST_HEIGHT_M, float(camera.ego_from_cam[2, 3])))
        moved = replace(camera, ego_from_cam=pose)
        cut = _views(moved)
        stays = [view.camera.channel for view in cut] != [*source.channels(camera.name)]
        cameras.append(camera if stays else moved)
        views += (view for view in source.views if view.source == camera.name) if stays else cut
    return SourceRig(tuple(cameras), tuple(views), source.ego_vehicle)


def _views(camera: SourceCamera) -> tuple[View, ...]:
    """Return the views of a camera; none if its lens cannot be cut."""
    try:
        return cut_views(camera)
    except DataError:
        return ()


def field_of_view_deg(camera: Camera) -> float:
    """Return the horizontal field of view, as in rig files: that of a centred principal point."""
    return float(np.degrees(2 * np.arctan(_slope(camera))))


def _slope(camera: Camera) -> float:
    """Return the tangent of half the horizontal field of view."""
    return float(camera.width_px / 2 / camera.intrinsic[0, 0])


def _vary_camera(
    camera: Camera, random: np.random.Generator, shift_m: FloatArray, pitch_deg: float, zoom: float
) -> Camera:
    """Return a camera moved, turned and zoomed: `zoom` scales the tangent of half its field of view."""
    pose = _vary_pose(camera.ego_from_cam, random, shift_m, pitch_deg)
    before = field_of_view_deg(camera)
    slope = _slope(camera) * zoom * random.uniform(1 - _OWN_ZOOM, 1 + _OWN_ZOOM)
    least, most = min(FIELD_OF_VIEW_DEG[0], before), max(FIELD_OF_VIEW_DEG[1], before)
    slope = np.clip(slope, np.tan(np.radians(least) / 2), np.tan(np.radians(most) / 2))
    intrinsic = camera.intrinsic.copy()
    intrinsic[:2, :2] *= _slope(camera) / slope
    return Camera(camera.channel, camera.width_px, camera.height_px, intrinsic, pose)


def _vary_pose(
    ego_from_cam: FloatArray, random: np.random.Generator, shift_m: FloatArray, pitch_deg: float
) -> FloatArray:
    """Return the pose of a camera, (4, 4), moved and turned with all others and a little on its own."""
    own = np.array(_OWN_SHIFT_M) * random.uniform(-1, 1, 3)
    yaw, pitch, roll = random.uniform(-1, 1, 3) * [_YAW_DEG, _OWN_PITCH_DEG, _ROLL_DEG]
    position = ego_from_cam[:3, 3] + shift_m + own
    # Yaw turns about the vehicle's vertical axis, pitch and roll about the camera's own axes.
    rotation = _turn(2, yaw) @ ego_from_cam[:3, :3] @ _turn(0, -pitch_deg - pitch) @ _turn(2, roll)
    return transform(rotation, position)


def _turn(axis: int, angle_deg: float) -> FloatArray:
    """Return the (3, 3) rotation about a coordinate axis."""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[first, first] = rotation[second, second] = cos
    rotation[first, second], rotation[second, first] = -sin, sin
    return rotation
