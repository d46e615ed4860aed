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

# Size of a crop, and the margin around the projection of the box, as a share of its size.
CROP_HIGH, CROP_WIDE = 32, 48
_MARGIN = 0.25
# Smallest size of a projection inside the image; corners behind the camera count as at this depth.
_LEAST_PX, _LEAST_DEPTH_M = 3.0, 0.3


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
    """Projections (low and high pixel, (N, 2)) of N boxes in an image; area (N,) is 0 where it does not show them."""

    low: FloatArray
    high: FloatArray
    area: FloatArray
    depth_m: FloatArray


def crop_images(boxes: Boxes, images: ByteArray, cameras: Iterable[Camera]) -> ImageCrops:
    """Return the crops of boxes in the ego frame of the cameras.

    Args:
        boxes: N boxes.
        images: (V, H, W, 3) uint8 sRGB.
        cameras: V cameras.
    """
    cameras = list(cameras)
    corners = boxes.corners()
    views = [_project(camera, corners) for camera in cameras]
    area = np.stack([view.area for view in views]) if len(boxes) else np.zeros((len(views), 0))
    best = area.argmax(axis=0) if len(boxes) else np.zeros(0, np.int64)
    owner = np.flatnonzero(area[best, np.arange(len(boxes))] > 0)
    shape = (len(owner), CROP_HIGH, CROP_WIDE)
    crops = ImageCrops(
        owner,
        np.zeros((*shape, 3), np.uint8),
        np.zeros((*shape, 3)),
        np.zeros(shape),
        np.zeros((len(owner), 2)),
        np.zeros((len(owner), 3)),
    )
    light = [np.median(image[::4, ::4].reshape(-1, 3), axis=0) for image in images]
    poses = [(inverse(boxes.frame_from_box(i)), boxes.half_lwh_m()[i]) for i in range(len(boxes))]
    for row, number in enumerate(owner.tolist()):
        own = int(best[number])
        view, camera = views[own], cameras[own]
        margin = _MARGIN * (view.high[number] - view.low[number])
        low = np.floor(view.low[number] - margin).astype(int)
        high = np.ceil(view.high[number] + margin).astype(int)
        crops.rgb[row] = _cut(images[own], low, high)
        rays = _rays(camera, low, high)
        eye = camera.ego_from_cam[:3, 3]
        entry, place = _enter(eye, rays, *poses[number])
        visible = np.isfinite(entry).astype(np.float64)
        for other in _occluders(view, number):
            visible[(_enter(eye, rays, *poses[other])[0] < entry) & (visible > 0)] = -1
        crops.place[row] = place.reshape(CROP_HIGH, CROP_WIDE, 3)
        crops.visible[row] = visible.reshape(CROP_HIGH, CROP_WIDE)
        crops.size_px[row], crops.light[row] = high - low, light[own]
    return crops


def _project(camera: Camera, corners: FloatArray) -> _View:
    """Project the corners (N, 8, 3) of boxes in the ego frame."""
    in_camera = apply(inverse(camera.ego_from_cam), corners)
    depth = in_camera[..., 2]
    ahead = (depth > _LEAST_DEPTH_M).any(axis=1)
    flat = in_camera.reshape(-1, 3).copy()
    flat[:, 2] = np.maximum(flat[:, 2], _LEAST_DEPTH_M)
    uv = camera.project(flat)[0].reshape(*depth.shape, 2)
    size = np.array([camera.width_px, camera.height_px], np.float64)
    low, high = (np.clip(edge, 0, size) for edge in (uv.min(axis=1), uv.max(axis=1) + 1))
    extent = high - low
    shown = ahead & (extent >= _LEAST_PX).all(axis=1)
    return _View(low, high, np.where(shown, extent.prod(axis=1), 0.0), depth.mean(axis=1))


def _cut(image: ByteArray, low: IntArray, high: IntArray) -> ByteArray:
    """Return the rectangle of an image, 0 outside it, resized to the size of a crop."""
    height, width = image.shape[:2]
    wide, high_px = (high - low).tolist()
    part = np.zeros((high_px, wide, 3), np.uint8)
    (left, top), (right, bottom) = np.maximum(low, 0), np.minimum(high, [width, height])
    part[top - low[1] : bottom - low[1], left - low[0] : right - low[0]] = image[top:bottom, left:right]
    shrinks = wide > CROP_WIDE or high_px > CROP_HIGH
    resized = cv2.resize(part, (CROP_WIDE, CROP_HIGH), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return np.asarray(resized, np.uint8)


def _rays(camera: Camera, low: IntArray, high: IntArray) -> FloatArray:
    """Return directions (CROP_HIGH * CROP_WIDE, 3) through the pixels of a crop, ego frame, a metre of depth long."""
    steps = [np.arange(count) + 0.5 for count in (CROP_WIDE, CROP_HIGH)]
    u, v = (a + step / len(step) * (b - a) - 0.5 for a, b, step in zip(low, high, steps, strict=True))
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    homogeneous = np.hstack([uv, np.ones((len(uv), 1))])
    return np.asarray(homogeneous @ np.linalg.inv(camera.intrinsic).T @ camera.ego_from_cam[:3, :3].T)


def _enter(
    eye: FloatArray, rays: FloatArray, box_from_ego: FloatArray, half_lwh_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where rays (P, 3) enter a box: the distance (P,), infinite if they miss it, and the place (P, 3), -1..1.

    Slab method; a ray that starts inside enters at 0.
    """
    start = apply(box_from_ego, eye) / half_lwh_m
    along = rays @ box_from_ego[:3, :3].T / half_lwh_m
    along = np.where(np.abs(along) < 1e-9, 1e-9, along)
    first, second = (-1 - start) / along, (1 - start) / along
    enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    hit = (enter <= leave) & (leave > 0)
    distance = np.where(hit, np.maximum(enter, 0.0), np.inf)
    place = np.where(hit[:, None], start + along * np.maximum(enter, 0.0)[:, None], 0.0)
    return distance, place


def _occluders(view: _View, number: int) -> list[int]:
    """Return the boxes that overlap a box in the image and are nearer."""
    overlap = (view.low < view.high[number]).all(axis=1) & (view.low[number] < view.high).all(axis=1)
    nearer = (view.area > 0) & (view.depth_m < view.depth_m[number])
    return np.flatnonzero(overlap & nearer).tolist()
