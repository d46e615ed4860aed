"""Network input images: resize and crop the image of any camera, and its intrinsics with it."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from appocc.camera import Camera
from appocc.checks import ByteArray, check_dtype, check_shape
from appocc.models.model_spec import ModelSpec

# The paper (section IV.B) resizes 1920x1080 to 352x198 and crops 48 of the 70 excess rows at the top.
_WIDE, _HIGH = 16, 9
_SHARE_ABOVE = 48 / 70
# A level camera of the paper then has its horizon at row 50.5 of 128: share of the height above the horizon.
_HORIZON_SHARE = (50.5 + 0.5) / 128


def select_channels(spec: ModelSpec, names: Iterable[str]) -> tuple[str, ...]:
    """Return the channels of a rig that a model uses, in order.

    The channels of the spec come first. A model for all directions also uses channels with other names, because rigs
    name their cameras differently.
    """
    there = tuple(names)
    own = tuple(name for name in spec.channels if name in there)
    ahead_only = spec.grid.x_min_m >= 0
    return own if ahead_only else own + tuple(name for name in there if name not in own)


def fit_image(image: ByteArray, camera: Camera, spec: ModelSpec) -> tuple[ByteArray, Camera]:
    """Resize and crop an image to the size of a model spec; also return the camera of the result.

    An image of this size is unchanged. A 16:9 image is resized to the width, then 48 of every 70 excess rows are
    cropped at the top and 22 at the bottom, as in the paper (section IV.B). Any other image is resized to cover the
    size, then cropped so that the principal point is at the middle column and at the row of the paper's cameras, as
    far as the image allows; a camera's pitch is not compensated.

    Args:
        image: (H, W, 3) uint8, of the size of the camera.
        camera: camera of the image.
        spec: required size.

    Returns:
        Image (spec.height_px, spec.width_px, 3) uint8 and its camera.

    Raises:
        ShapeError: if the image does not have the size of the camera.
    """
    check_shape(f"image {camera.channel}", image, (camera.height_px, camera.width_px, 3))
    check_dtype(f"image {camera.channel}", image, np.uint8)
    (width, height), (left, top) = _resize_and_crop(camera, spec)
    if (width, height) != (camera.width_px, camera.height_px):
        shrinks = width < camera.width_px
        resized = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        image = np.asarray(resized, np.uint8)
    cut = image[top : top + spec.height_px, left : left + spec.width_px]
    return np.ascontiguousarray(cut), fit_camera(camera, spec)


def fit_camera(camera: Camera, spec: ModelSpec) -> Camera:
    """Return the camera of the image that `fit_image` returns."""
    (width, height), (left, top) = _resize_and_crop(camera, spec)
    if (width, height) != (camera.width_px, camera.height_px):
        camera = camera.resized(width, height)
    if (width, height) != (spec.width_px, spec.height_px):
        camera = camera.cropped(left, top, spec.width_px, spec.height_px)
    return camera


def _resize_and_crop(camera: Camera, spec: ModelSpec) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the size (width, height) of the resized image and the corner (left, top) of the crop."""
    wide, high = spec.width_px, spec.height_px
    scale = max(wide / camera.width_px, high / camera.height_px)
    size = (max(round(camera.width_px * scale), wide), max(round(camera.height_px * scale), high))
    if size == (wide, round(wide * _HIGH / _WIDE)):
        return size, (0, round((size[1] - high) * _SHARE_ABOVE))
    k = camera.resized(*size).intrinsic
    left = round(k[0, 2] - (wide - 1) / 2)
    top = round(k[1, 2] - (high * _HORIZON_SHARE - 0.5))
    return size, (min(max(left, 0), size[0] - wide), min(max(top, 0), size[1] - high))
