"""Image crops of predicted vehicles: what the second stage sees of each box.

A crop shows the image around the projection of a box, and for each pixel where its ray enters the box, as in
normalised object coordinates (Wang et al., CVPR 2019): the network sees which end of the image is called the front.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np

from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray, IntArray
from appocc.geometry import apply, inverse
from appocc.groundtruth.visibility import ray_box_entry

# Size of a crop, and the margin around the projection of the box, as a share of its size.
CROP_HIGH, CROP_WIDE = 32, 48
_MARGIN = 0.25
# Smallest size of a projection inside the image; corners behind the camera count as at this depth.
_LEAST_PX, _LEAST_DEPTH_M = 3.0, 0.3
_STRIDE_PX = 4


class ImageCrops(NamedTuple):
    """Crops of K boxes, one for each box that an image shows, from the image that shows most of it.

    Attributes:
        owner: (K,) index of the box.
        rgb: (K, CROP_HIGH, CROP_WIDE, 3) uint8 sRGB, 0 outside the image.
        place: (K, CROP_HIGH, CROP_WIDE, 3) where the ray of a pixel enters the box: ahead, left and up, -1..1;
            0 where it misses the box.
        visible: (K, CROP_HIGH, CROP_WIDE) 1 where the box is hit and no other box is before it, -1 where one is, 0
            where the box is missed.
        size_px: (K, 2) width and height of the crop in the image.
        light: (K, 3) median sRGB colour of the image.
    """

    owner: IntArray
    rgb: ByteArray
    place: FloatArray
    visible: FloatArray
    size_px: FloatArray
    light: FloatArray


class _View(NamedTuple):
    """An image, its camera, and the projections of N boxes.

    Attributes:
        image: (H, W, 3) uint8 sRGB.
        camera: its camera.
        light: (3,) median colour.
        low: (N, 2) lower pixel bounds of the boxes, inside the image.
        high: (N, 2) upper ones.
        area: (N,) area of this rectangle; 0 where the image does not show the box.
        depth_m: (N,) mean depth of the corners.
    """

    image: ByteArray
    camera: Camera
    light: FloatArray
    low: FloatArray
    high: FloatArray
    area: FloatArray
    depth_m: FloatArray


class _Crop(NamedTuple):
    """One crop, as in `ImageCrops`, with its pixels in a row."""

    rgb: ByteArray
    place: FloatArray
    visible: FloatArray
    size_px: IntArray
    light: FloatArray


def crop_images(boxes: Boxes, images: ByteArray, cameras: Iterable[Camera]) -> ImageCrops:
    """Return the crops of boxes in the ego frame of the cameras.

    Args:
        boxes: N boxes.
        images: (V, H, W, 3) uint8 sRGB.
        cameras: V cameras.
    """
    corners = boxes.corners()
    views = [_project(image, camera, corners) for image, camera in zip(images, cameras, strict=True)]
    area = np.array([view.area for view in views]).reshape(len(views), len(boxes))
    owner = np.flatnonzero(area.max(axis=0, initial=0) > 0)
    crops = [_crop(views[area[:, number].argmax()], boxes, number) for number in owner.tolist()]
    pixels = (len(owner), CROP_HIGH, CROP_WIDE)
    return ImageCrops(
        owner,
        np.array([crop.rgb for crop in crops], np.uint8).reshape(*pixels, 3),
        np.array([crop.place for crop in crops], np.float64).reshape(*pixels, 3),
        np.array([crop.visible for crop in crops], np.float64).reshape(pixels),
        np.array([crop.size_px for crop in crops], np.float64).reshape(-1, 2),
        np.array([crop.light for crop in crops], np.float64).reshape(-1, 3),
    )


def _project(image: ByteArray, camera: Camera, corners: FloatArray) -> _View:
    """Project the corners (N, 8, 3) of boxes in the ego frame."""
    in_camera = apply(inverse(camera.ego_from_cam), corners)
    depth = in_camera[..., 2]
    flat = in_camera.reshape(-1, 3).copy()
    flat[:, 2] = np.maximum(flat[:, 2], _LEAST_DEPTH_M)
    uv = camera.project(flat)[0].reshape(*depth.shape, 2)
    size = np.array([camera.width_px, camera.height_px], np.float64)
    low, high = (np.clip(edge, 0, size) for edge in (uv.min(axis=1), uv.max(axis=1) + 1))
    shown = (depth > _LEAST_DEPTH_M).any(axis=1) & (high - low >= _LEAST_PX).all(axis=1)
    area = np.where(shown, (high - low).prod(axis=1), 0.0)
    light = np.median(image[::_STRIDE_PX, ::_STRIDE_PX].reshape(-1, 3), axis=0)
    return _View(image, camera, light, low, high, area, depth.mean(axis=1))


def _crop(view: _View, boxes: Boxes, number: int) -> _Crop:
    """Return the crop of a box in an image that shows it."""
    margin = _MARGIN * (view.high[number] - view.low[number])
    low = np.floor(view.low[number] - margin).astype(int)
    high = np.ceil(view.high[number] + margin).astype(int)
    eye, rays = view.camera.ego_from_cam[:3, 3], _rays(view.camera, low, high)

    def entry(box: int) -> FloatArray:
        return ray_box_entry(eye, rays, boxes.frame_from_box(box), boxes.half_lwh_m()[box])

    distance = entry(number)
    hit = np.isfinite(distance)
    points = eye + rays * np.where(hit, distance, 0.0)[:, None]
    place = apply(inverse(boxes.frame_from_box(number)), points) / boxes.half_lwh_m()[number]
    visible = hit.astype(np.float64)
    for other in _occluders(view, number):
        visible[(entry(other) < distance) & hit] = -1
    return _Crop(_cut(view.image, low, high), place * hit[:, None], visible, high - low, view.light)


def _cut(image: ByteArray, low: IntArray, high: IntArray) -> ByteArray:
    """Return the rectangle of an image, 0 outside it, resized to the size of a crop."""
    height, width = image.shape[:2]
    wide, tall = (high - low).tolist()
    part = np.zeros((tall, wide, 3), np.uint8)
    (left, top), (right, bottom) = np.maximum(low, 0), np.minimum(high, [width, height])
    part[top - low[1] : bottom - low[1], left - low[0] : right - low[0]] = image[top:bottom, left:right]
    shrinks = wide > CROP_WIDE or tall > CROP_HIGH
    resized = cv2.resize(part, (CROP_WIDE, CROP_HIGH), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return np.asarray(resized, np.uint8)


def _rays(camera: Camera, low: IntArray, high: IntArray) -> FloatArray:
    """Return directions (CROP_HIGH * CROP_WIDE, 3) through the pixels of a crop, ego frame, a metre of depth long."""
    steps = [np.arange(count) + 0.5 for count in (CROP_WIDE, CROP_HIGH)]
    u, v = (a + step / len(step) * (b - a) - 0.5 for a, b, step in zip(low, high, steps, strict=True))
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    homogeneous = np.hstack([uv, np.ones((len(uv), 1))])
    return np.asarray(homogeneous @ np.linalg.inv(camera.intrinsic).T @ camera.ego_from_cam[:3, :3].T)


def _occluders(view: _View, number: int) -> list[int]:
    """Return the boxes that overlap a box in the image and are nearer."""
    overlap = (view.low < view.high[number]).all(axis=1) & (view.low[number] < view.high).all(axis=1)
    nearer = (view.area > 0) & (view.depth_m < view.depth_m[number])
    return np.flatnonzero(overlap & nearer).tolist()
