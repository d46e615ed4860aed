"""The colour of each vehicle from the images of its cuboid: the paper's histogram mode, and a robust variant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.files import read_image
from appocc.geometry import apply, inverse
from appocc.groundtruth.inputs import SampleInput, View
from appocc.groundtruth.visibility import DepthPicture, box_entry, image_rectangle
from appocc.nuscenes.lidar import read_lidar

Paint = Literal["mode", "robust"]
# The paper's histogram: 25 bins of length 10 for each channel.
_BINS, _BIN_LENGTH = 25, 10
_SAMPLES_A_SIDE = 56
_LEAST_PIXELS = 12
_BOX_MARGIN_M = 0.1
# Bodywork between tyres and windows, in parts of the height; parts of brightness that are shadow or glint.
_BODY_BAND = (0.28, 0.62)
_DARKEST, _BRIGHTEST = 0.15, 0.9
# Colours this near to one another (0..255) count as the same paint when the densest colour is sought.
_NEAR, _SAME = 24.0, 36.0


class BoxPixels(NamedTuple):
    """Samples of a box's visible image region.

    Attributes:
        rgb: (N, 3) uint8 colours.
        height: (N,) where on the box's height each was hit, 0..1.
        area_px: pixels of the image that the samples stand for.
    """

    rgb: ByteArray
    height: FloatArray
    area_px: float


class Painted(NamedTuple):
    """Colours (B, 3) uint8 of boxes, and the image area (B,) in pixels each was read from, 0 where it is unknown."""

    rgb: ByteArray
    area_px: FloatArray


_NO_PIXELS = BoxPixels(np.zeros((0, 3), np.uint8), np.zeros(0), 0.0)


def box_pixels(
    image: ByteArray, view: View, boxes_world: Boxes, target: int, depth: DepthPicture | None
) -> BoxPixels:
    """Pixels of the image region of box `target` in which neither another box nor a nearer LiDAR surface hides it."""
    camera, eye = view.camera, view.world_from_cam[:3, 3]
    corners_cam = apply(inverse(view.world_from_cam), boxes_world.corners())
    rectangle = image_rectangle(camera, corners_cam[target])
    if rectangle is None:
        return _NO_PIXELS
    uv = _grid_of_pixels(*rectangle)
    sample_px = float(np.prod(rectangle[1] - rectangle[0])) / len(uv)
    rays = _rays(camera, view.world_from_cam, uv)
    own = _entry(eye, rays, boxes_world, target)
    hit = np.isfinite(own)
    uv, rays, own = uv[hit], rays[hit], own[hit]
    if len(uv) < _LEAST_PIXELS:
        return _NO_PIXELS
    free = np.ones(len(uv), dtype=np.bool_)
    for other in _possible_occluders(camera, corners_cam, target, rectangle):
        free &= _entry(eye, rays, boxes_world, other) > own
    if depth is not None:
        free &= ~depth.hides(uv, own)
    uv, rays, own = uv[free], rays[free], own[free]
    local = apply(inverse(boxes_world.frame_from_box(target)), eye + rays * own[:, None])
    height = local[:, 2] / boxes_world.size_wlh_m[target, 2] + 0.5
    column, row = uv.astype(np.int64).T
    return BoxPixels(image[row, column], height, sample_px * len(uv))


def _grid_of_pixels(low: FloatArray, high: FloatArray) -> FloatArray:
    """Pixels (N, 2) spread over a rectangle of the image, at most 56 a side."""
    axes = [np.unique(np.linspace(a, b - 1, _SAMPLES_A_SIDE).astype(int)) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2).astype(np.float64)


def _rays(camera: Camera, world_from_cam: FloatArray, uv_px: FloatArray) -> FloatArray:
    """Directions (N, 3) in the world through pixels (N, 2), one metre of depth long."""
    homogeneous = np.hstack([uv_px, np.ones((len(uv_px), 1))])
    return np.asarray(homogeneous @ np.linalg.inv(camera.intrinsic).T @ world_from_cam[:3, :3].T)


def _entry(eye: FloatArray, rays: FloatArray, boxes: Boxes, i: int) -> FloatArray:
    return box_entry(eye, rays, boxes.frame_from_box(i), boxes.half_lwh_m()[i])


def _possible_occluders(
    camera: Camera, corners_cam: FloatArray, target: int, rectangle: tuple[FloatArray, FloatArray]
) -> list[int]:
    """Boxes whose image rectangle meets the target's and whose nearest corner lies before the target's farthest."""
    found = []
    for i, corners in enumerate(corners_cam):
        if i == target or corners[:, 2].min() > corners_cam[target, :, 2].max():
            continue
        other = image_rectangle(camera, corners)
        if other is not None and (other[0] < rectangle[1]).all() and (rectangle[0] < other[1]).all():
            found.append(i)
    return found


def paint_mode(pixels: BoxPixels) -> ByteArray:
    """(3,) the paper's colour: the fullest of 25 bins of length 10, channel by channel (its centre)."""
    bins = np.minimum(pixels.rgb // _BIN_LENGTH, _BINS - 1)
    fullest = [int(np.bincount(bins[:, channel], minlength=_BINS).argmax()) for channel in range(3)]
    return np.array([b * _BIN_LENGTH + _BIN_LENGTH // 2 for b in fullest], np.uint8)


def paint_robust(pixels: BoxPixels) -> ByteArray:
    """(3,) colour of the bodywork: windows, tyres, shadow and glint trimmed, then the densest colour that is left."""
    band = (pixels.height > _BODY_BAND[0]) & (pixels.height < _BODY_BAND[1])
    rgb = pixels.rgb[band] if band.sum() >= _LEAST_PIXELS else pixels.rgb
    brightness = rgb.astype(np.float64) @ [0.299, 0.587, 0.114]
    low, high = np.quantile(brightness, [_DARKEST, _BRIGHTEST])
    rgb = rgb[(brightness >= low) & (brightness <= high)].astype(np.float64)
    distance = np.linalg.norm(rgb[:, None] - rgb[None, :: max(len(rgb) // 256, 1)], axis=2)
    densest = (distance < _NEAR).sum(axis=1).argmax()
    near = np.linalg.norm(rgb - rgb[densest], axis=1) < _SAME
    return np.asarray(np.round(np.median(rgb[near], axis=0)), dtype=np.uint8)


def paint_vehicles(
    images: Sequence[ByteArray],
    views: Sequence[View],
    vehicles: BoolArray,
    depths: Sequence[DepthPicture | None],
    paint: Paint,
) -> Painted:
    """Colours of the boxes that are vehicles (B,), from all views that see them.

    All views must hold the same boxes in the same order.
    """
    painted = Painted(np.zeros((len(vehicles), 3), np.uint8), np.zeros(len(vehicles)))
    choose = paint_mode if paint == "mode" else paint_robust
    for i in np.flatnonzero(vehicles):
        seen = zip(images, views, depths, strict=True)
        parts = [box_pixels(image, view, view.boxes_world, int(i), depth) for image, view, depth in seen]
        parts.append(_NO_PIXELS)  # for a sample without images
        rgb, height, areas = zip(*parts, strict=True)
        pixels = BoxPixels(np.concatenate(rgb), np.concatenate(height), sum(areas))
        if len(pixels.rgb) >= _LEAST_PIXELS:
            painted.rgb[i], painted.area_px[i] = choose(pixels), pixels.area_px
    return painted


def paint_sample(sample: SampleInput, wanted: BoolArray, paint: Paint) -> Painted:
    """Colours of the wanted boxes (B,) of a sample from its own images and sweep.

    Raises:
        DataError: if an image or the sweep is damaged.
    """
    images = [read_image(view.path, (view.camera.width_px, view.camera.height_px)) for view in sample.views]
    depths: list[DepthPicture | None] = [None] * len(images)
    if sample.lidar is not None:
        path, world_from_lidar = sample.lidar
        raw = read_lidar(path)[:, :3]
        points = apply(world_from_lidar, raw[np.isfinite(raw).all(axis=1)])
        # Annotated objects hide as boxes, each where it was at the image's own time: a moving car's points, taken at
        # the sweep's time, would hide the car itself.
        points = points[~sample.boxes_world.inside(points, _BOX_MARGIN_M)]
        depths = [DepthPicture(apply(inverse(view.world_from_cam), points), view.camera) for view in sample.views]
    return paint_vehicles(images, sample.views, wanted, depths, paint)


def pool_over_time(samples: Sequence[SampleInput], painted: Sequence[Painted]) -> list[Painted]:
    """One colour an object in all samples: the seen colour that lies nearest to all others, by the area of each.

    Paint does not change on the way; what hides, lights and mirrors does.
    """
    seen: dict[str, list[tuple[ByteArray, float]]] = {}
    for sample, own in zip(samples, painted, strict=True):
        for name, rgb, area in zip(sample.boxes_world.instance, own.rgb, own.area_px, strict=True):
            if area:
                seen.setdefault(name, []).append((rgb, float(area)))
    best = {name: _most_central(colours) for name, colours in seen.items()}
    nothing = (np.zeros(3, np.uint8), 0.0)
    pooled = []
    for sample in samples:
        rows = [best.get(name, nothing) for name in sample.boxes_world.instance]
        rgb = np.array([row[0] for row in rows], np.uint8).reshape(-1, 3)
        pooled.append(Painted(rgb, np.array([row[1] for row in rows], np.float64)))
    return pooled


def _most_central(colours: list[tuple[ByteArray, float]]) -> tuple[ByteArray, float]:
    """The weighted medoid of some colours, and their area in all."""
    rgb, area = np.array([c for c, _ in colours], np.float64), np.array([a for _, a in colours])
    distance = np.linalg.norm(rgb[:, None] - rgb[None], axis=2) @ area
    return colours[int(distance.argmin())][0], float(area.sum())
