"""Which pixels show a vehicle, and its colour: the paper's histogram mode, or one of its bodywork over a scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.colours import Exposure
from appocc.files import read_image
from appocc.geometry import apply, inverse
from appocc.groundtruth.bodywork import Bodywork, bodywork, light_of, paint_of
from appocc.groundtruth.inputs import SampleInput, View
from appocc.groundtruth.visibility import DepthPicture, box_entry, image_rectangle
from appocc.nuscenes.lidar import read_lidar

Paint = Literal["mode", "robust"]
# The paper's histogram: 25 bins of length 10 for each channel.
_BINS, _BIN_LENGTH = 25, 10
_SAMPLES_A_SIDE = 56
_LEAST_PIXELS = 12
# LiDAR points this far outside a box are still the vehicle's.
_BOX_MARGIN_M = 0.15


class BoxPixels(NamedTuple):
    """Samples of a box's visible image region.

    Attributes:
        rgb: (N, 3) uint8 colours.
        height: (N,) where on the box's height each lies, 0..1.
        sample_px: pixels of the image that each stands for.
    """

    rgb: ByteArray
    height: FloatArray
    sample_px: float


class Painted(NamedTuple):
    """Colours (B, 3) uint8 of boxes, and which are known (B,)."""

    rgb: ByteArray
    known: BoolArray


_NO_PIXELS = BoxPixels(np.zeros((0, 3), np.uint8), np.zeros(0), 0.0)


def box_pixels(
    image: ByteArray, view: View, boxes_world: Boxes, target: int, depth: DepthPicture | None
) -> BoxPixels:
    """Pixels of the image that show box `target`: where the sweep's points lie in it, else where nothing hides it.

    Where the sweep looks past or through the box (beside a bonnet, through glass) it shows something else. Where the
    sweep saw nothing, or has no point in the box, other boxes hide it as if they were solid.
    """
    camera, eye = view.camera, view.world_from_cam[:3, 3]
    corners_cam = apply(inverse(view.world_from_cam), boxes_world.corners())
    rectangle = image_rectangle(camera, corners_cam[target])
    if rectangle is None:
        return _NO_PIXELS
    uv = _grid_of_pixels(*rectangle)
    sample_px = float(np.prod(rectangle[1] - rectangle[0])) / len(uv)
    rays = _rays(camera, view.world_from_cam, uv)
    where = _entry(eye, rays, boxes_world, target)
    hit = np.isfinite(where)
    uv, rays, where = uv[hit], rays[hit], where[hit]
    if len(uv) < _LEAST_PIXELS:
        return _NO_PIXELS
    free = np.ones(len(uv), dtype=np.bool_)
    for other in _possible_occluders(camera, corners_cam, target, rectangle):
        free &= _entry(eye, rays, boxes_world, other) > where
    if depth is not None:
        swept = depth.depth_m(uv)
        points_world = eye + rays * np.where(np.isfinite(swept), swept, 0.0)[:, None]
        on = boxes_world.select(np.array([target])).inside(points_world, _BOX_MARGIN_M) & np.isfinite(swept)
        free = on | (free & np.isinf(swept)) if on.sum() >= _LEAST_PIXELS else free & ~depth.hides(uv, where)
        where = np.where(on, swept, where)
    uv, rays, where = uv[free], rays[free], where[free]
    local = apply(inverse(boxes_world.frame_from_box(target)), eye + rays * where[:, None])
    height = np.clip(local[:, 2] / boxes_world.size_wlh_m[target, 2] + 0.5, 0.0, 1.0)
    column, row = uv.astype(np.int64).T
    return BoxPixels(image[row, column], height, sample_px)


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


def paint_mode_of(sample: SampleInput, wanted: BoolArray) -> Painted:
    """The paper's colours of the wanted boxes (B,) of a sample, from its own images and sweep.

    Raises:
        DataError: if an image or the sweep is damaged.
    """
    painted = Painted(np.zeros((len(wanted), 3), np.uint8), np.zeros(len(wanted), dtype=np.bool_))
    for i, views in _seen(sample, wanted):
        rgb, height, _ = zip(*(pixels for pixels, _, _ in views), strict=True)
        pixels = BoxPixels(np.concatenate(rgb), np.concatenate(height), 1.0)
        if len(pixels.rgb) >= _LEAST_PIXELS:
            painted.rgb[i], painted.known[i] = paint_mode(pixels), True
    return painted


def bodies_of(sample: SampleInput, wanted: BoolArray, gains: Mapping[str, FloatArray]) -> list[list[Bodywork]]:
    """What the images of a sample show of the bodywork of each of its boxes; nothing of those not wanted (B,).

    `gains` holds factors (3,) by channel that even the cameras' colours out, 1 where a channel has none.

    Raises:
        DataError: if an image or the sweep is damaged.
    """
    bodies: list[list[Bodywork]] = [[] for _ in wanted]
    for i, views in _seen(sample, wanted):
        for pixels, channel, light in views:
            if len(pixels.rgb) >= _LEAST_PIXELS:
                bodies[i].append(bodywork(*pixels, light, gains.get(channel, np.ones(3))))
    return bodies


def _seen(sample: SampleInput, wanted: BoolArray) -> Iterator[tuple[int, list[tuple[BoxPixels, str, Exposure]]]]:
    """Each wanted box: its pixels in every image of a sample that shows it, with the image's channel and light."""
    images = [read_image(view.path, (view.camera.width_px, view.camera.height_px)) for view in sample.views]
    lights = [light_of(image) for image in images]
    depths: list[DepthPicture | None] = [None] * len(images)
    if sample.lidar is not None:
        path, world_from_lidar = sample.lidar
        raw = read_lidar(path)[:, :3]
        points = apply(world_from_lidar, raw[np.isfinite(raw).all(axis=1)])
        depths = [DepthPicture(apply(inverse(view.world_from_cam), points), view.camera) for view in sample.views]
    for i in np.flatnonzero(wanted).tolist():
        views = []
        for image, view, depth, light in zip(images, sample.views, depths, lights, strict=True):
            pixels = box_pixels(image, view, view.boxes_world, i, depth)
            if len(pixels.rgb):
                views.append((pixels, view.camera.channel, light))
        if views:
            yield i, views


def paint_scene(samples: Sequence[SampleInput], bodies: Sequence[list[list[Bodywork]]]) -> list[Painted]:
    """One colour an object in all samples, of all the pictures of it.

    Paint does not change on the way; what hides, lights and mirrors does.
    """
    pictures: dict[str, list[Bodywork]] = {}
    for sample, own in zip(samples, bodies, strict=True):
        for name, body in zip(sample.boxes_world.instance, own, strict=True):
            pictures.setdefault(name, []).extend(body)
    paint = {name: paint_of(every) for name, every in pictures.items() if every}
    painted = []
    for sample in samples:
        names = sample.boxes_world.instance
        rgb = [paint.get(name, np.zeros(3, np.uint8)) for name in names]
        known = np.array([name in paint for name in names], dtype=np.bool_)
        painted.append(Painted(np.array(rgb, np.uint8).reshape(-1, 3), known))
    return painted
