"""Any camera's picture in the size that a network is given; the camera follows."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from appocc.camera import Camera
from appocc.checks import ByteArray, check_dtype, check_shape
from appocc.models.model_spec import Setting

# The paper's pictures (section IV.B), 1920x1080, become 352x198; 48 of the 70 rows too many are cut off above.
_WIDE, _HIGH = 16, 9
_SHARE_ABOVE = 48 / 70
# A level camera of the paper then has its horizon at row 50.5 of 128: the share of the height above it.
_HORIZON_SHARE = (50.5 + 0.5) / 128


def channels_of(setting: Setting, names: Iterable[str]) -> tuple[str, ...]:
    """Which of a rig's cameras a setting uses, in their order.

    Its own come first; a setting that looks all around takes those of other names too, as rigs name them differently.
    """
    there = tuple(names)
    own = tuple(name for name in setting.channels if name in there)
    ahead_only = setting.grid.x_min_m >= 0
    return own if ahead_only else own + tuple(name for name in there if name not in own)


def fitted(image: ByteArray, camera: Camera, setting: Setting) -> tuple[ByteArray, Camera]:
    """A picture in the size of a setting, and the camera that would have taken it.

    A picture that has the size is left as it is. One of 16:9 is resized to the width, then 48 of every 70 rows too
    many are cut off above and 22 below, as in the paper (section IV.B). Any other is resized until it covers the
    size, then cut so that the principal point keeps its column at the middle and its row where the paper's
    cameras have it, as far as the picture reaches: what a camera's pitch moves, stays moved.

    Args:
        image: (H, W, 3) uint8, of the camera's size.
        camera: that took it.
        setting: size to be had.

    Returns:
        Picture (setting.height_px, setting.width_px, 3) uint8 and its camera.

    Raises:
        ShapeError: if the picture has not the camera's size.
    """
    check_shape(f"image {camera.channel}", image, (camera.height_px, camera.width_px, 3))
    check_dtype(f"image {camera.channel}", image, np.uint8)
    (width, height), (left, top) = _rule(camera, setting)
    if (width, height) != (camera.width_px, camera.height_px):
        shrinks = width < camera.width_px
        resized = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        image = np.asarray(resized, np.uint8)
    cut = image[top : top + setting.height_px, left : left + setting.width_px]
    return np.ascontiguousarray(cut), fitted_camera(camera, setting)


def fitted_camera(camera: Camera, setting: Setting) -> Camera:
    """The camera of the picture that `fitted` makes."""
    (width, height), (left, top) = _rule(camera, setting)
    if (width, height) != (camera.width_px, camera.height_px):
        camera = camera.resized(width, height)
    if (width, height) != (setting.width_px, setting.height_px):
        camera = camera.cropped(left, top, setting.width_px, setting.height_px)
    return camera


def _rule(camera: Camera, setting: Setting) -> tuple[tuple[int, int], tuple[int, int]]:
    """Size (width, height) that a picture is resized to, and the corner (left, top) of what is then cut out."""
    wide, high = setting.width_px, setting.height_px
    scale = max(wide / camera.width_px, high / camera.height_px)
    size = (max(round(camera.width_px * scale), wide), max(round(camera.height_px * scale), high))
    if size == (wide, round(wide * _HIGH / _WIDE)):
        return size, (0, round((size[1] - high) * _SHARE_ABOVE))
    k = camera.resized(*size).intrinsic
    left = round(k[0, 2] - (wide - 1) / 2)
    top = round(k[1, 2] - (high * _HORIZON_SHARE - 0.5))
    return size, (min(max(left, 0), size[0] - wide), min(max(top, 0), size[1] - high))
