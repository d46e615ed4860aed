"""Vehicle colours from visible pixels: the paper's histogram mode per sample, or the paint colour over a scene."""

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
from appocc.groundtruth.bodywork import BodyworkSamples, estimate_exposure, estimate_paint, extract_bodywork
from appocc.groundtruth.inputs import SampleInput
from appocc.groundtruth.visibility import DepthImage, ImageRectangles, image_rectangles, ray_box_entry
from appocc.nuscenes.lidar import read_lidar

PaintMethod = Literal["mode", "robust"]
# The paper's histogram: 25 bins of width 10 per channel.
_BINS, _BIN_WIDTH = 25, 10
_SAMPLES_PER_SIDE = 56
MIN_PIXELS = 12
# LiDAR points within this distance of a box belong to the vehicle.
_BOX_MARGIN_M = 0.15


class BoxPixels(NamedTuple):
    """Samples of the visible image region of a box.

    Attributes:
        rgb: (N, 3) uint8 colours.
        height: (N,) relative height on the box, 0..1.
        sample_px: image area of a sample.
    """

    rgb: ByteArray
    height: FloatArray
    sample_px: float


class BoxColours(NamedTuple):
    """Colours (B, 3) uint8 of boxes and their validity (B,)."""

    rgb: ByteArray
    known: BoolArray


_NO_PIXELS = BoxPixels(np.zeros((0, 3), np.uint8), np.zeros(0), 0.0)


class BoxView(NamedTuple):
    """N boxes in an image.

    Attributes:
        image: (H, W, 3) uint8 sRGB.
        camera: its camera.
        frame_from_cam: (4, 4) camera pose in the frame of the boxes.
        boxes: N boxes.
        depth_m: (N, 2) smallest and largest depth of their corners.
        rectangles: their image regions.
    """

    image: ByteArray
    camera: Camera
    frame_from_cam: FloatArray
    boxes: Boxes
    depth_m: FloatArray
    rectangles: ImageRectangles

    @classmethod
    def project(cls, image: ByteArray, camera: Camera, frame_from_cam: FloatArray, boxes: Boxes) -> BoxView:
        """Project boxes into an image."""
        corners_cam = apply(inverse(frame_from_cam), boxes.corners())
        depth_m = np.stack([corners_cam[..., 2].min(axis=1), corners_cam[..., 2].max(axis=1)], axis=1)
        return cls(image, camera, frame_from_cam, boxes, depth_m, image_rectangles(camera, corners_cam))

    def entry(self, rays: FloatArray, number: int) -> FloatArray:
        """Return the depths (P,) at which rays (P, 3) from the camera enter a box, infinite if they miss it."""
        boxes = self.boxes
        return ray_box_entry(
            self.frame_from_cam[:3, 3], rays, boxes.frame_from_box(number), boxes.half_lwh_m()[number]
        )

    def possible_occluders(self, target: int) -> list[int]:
        """Return the boxes that overlap a box in the image and start in front of its farthest corner."""
        low, high, shown = self.rectangles
        overlap = ((low < high[target]) & (low[target] < high)).all(axis=1)
        possible = shown & overlap & (self.depth_m[:, 0] <= self.depth_m[target, 1])
        possible[target] = False
        return np.flatnonzero(possible).tolist()


def box_pixels(view: BoxView, target: int, depth: DepthImage | None) -> BoxPixels:
    """Return the pixels that show box `target`: where LiDAR points are inside it, else where it is not occluded.

    Pixels whose LiDAR depth is beyond the box (next to the bonnet, through glass) show something else. Without LiDAR
    depth, or without points in the box, other boxes occlude it as solid bodies.
    """
    low, high, shown = (bound[target] for bound in view.rectangles)
    if not shown:
        return _NO_PIXELS
    eye, boxes = view.frame_from_cam[:3, 3], view.boxes
    uv = _grid_of_pixels(low, high)
    sample_px = float(np.prod(high - low)) / len(uv)
    rays = _rays(view.camera, view.frame_from_cam, uv)
    where = view.entry(rays, target)
    hit = np.isfinite(where)
    uv, rays, where = uv[hit], rays[hit], where[hit]
    if len(uv) < MIN_PIXELS:
        return _NO_PIXELS
    free = np.ones(len(uv), dtype=np.bool_)
    for other in view.possible_occluders(target):
        free &= view.entry(rays, other) > where
    if depth is not None:
        swept = depth.depth_m(uv)
        points = eye + rays * np.where(np.isfinite(swept), swept, 0.0)[:, None]
        on = boxes.select(np.array([target])).inside(points, _BOX_MARGIN_M) & np.isfinite(swept)
        free = on | (free & np.isinf(swept)) if on.sum() >= MIN_PIXELS else free & ~depth.occludes(uv, where)
        where = np.where(on, swept, where)
    uv, rays, where = uv[free], rays[free], where[free]
    local = apply(inverse(boxes.frame_from_box(target)), eye + rays * where[:, None])
    height = np.clip(local[:, 2] / boxes.size_wlh_m[target, 2] + 0.5, 0.0, 1.0)
    column, row = uv.astype(np.int64).T
    return BoxPixels(view.image[row, column], height, sample_px)


def _grid_of_pixels(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return pixels (N, 2) spread over an image rectangle, at most 56 per side."""
    axes = [np.unique(np.linspace(a, b - 1, _SAMPLES_PER_SIDE).astype(int)) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2).astype(np.float64)


def _rays(camera: Camera, frame_from_cam: FloatArray, uv_px: FloatArray) -> FloatArray:
    """Return ray directions (N, 3) through pixels (N, 2) in a frame, scaled to one metre of depth."""
    homogeneous = np.hstack([uv_px, np.ones((len(uv_px), 1))])
    return np.asarray(homogeneous @ np.linalg.inv(camera.intrinsic).T @ frame_from_cam[:3, :3].T)


def histogram_mode(pixels: BoxPixels) -> ByteArray:
    """Return the paper's (3,) colour: per channel, the centre of the fullest of 25 bins of width 10."""
    bins = np.minimum(pixels.rgb // _BIN_WIDTH, _BINS - 1)
    fullest = [int(np.bincount(bins[:, channel], minlength=_BINS).argmax()) for channel in range(3)]
    return np.array([b * _BIN_WIDTH + _BIN_WIDTH // 2 for b in fullest], np.uint8)


def mode_colours(sample: SampleInput, selected: BoolArray) -> BoxColours:
    """Return the paper's histogram colours of the selected boxes (B,) of a sample, from its images and sweep.

    Raises:
        DataError: if an image or the sweep is damaged.
    """
    painted = BoxColours(np.zeros((len(selected), 3), np.uint8), np.zeros(len(selected), dtype=np.bool_))
    for i, views in _visible_boxes(sample, selected):
        rgb, height, _ = zip(*(pixels for pixels, _, _ in views), strict=True)
        pixels = BoxPixels(np.concatenate(rgb), np.concatenate(height), 1.0)
        if len(pixels.rgb) >= MIN_PIXELS:
            painted.rgb[i], painted.known[i] = histogram_mode(pixels), True
    return painted


def bodywork_by_box(
    sample: SampleInput, selected: BoolArray, gains: Mapping[str, FloatArray]
) -> list[list[BodyworkSamples]]:
    """Return the bodywork samples of each box from the images of a sample; empty for boxes not selected (B,).

    `gains` holds the exposure gains (3,) by channel; missing channels have gain 1.

    Raises:
        DataError: if an image or the sweep is damaged.
    """
    bodies: list[list[BodyworkSamples]] = [[] for _ in selected]
    for i, views in _visible_boxes(sample, selected):
        for pixels, channel, light in views:
            if len(pixels.rgb) >= MIN_PIXELS:
                bodies[i].append(extract_bodywork(*pixels, light, gains.get(channel, np.ones(3))))
    return bodies


def _visible_boxes(
    sample: SampleInput, selected: BoolArray
) -> Iterator[tuple[int, list[tuple[BoxPixels, str, Exposure]]]]:
    """Yield each selected box with its pixels in every image that shows it, with channel and exposure."""
    images = [read_image(view.path, (view.camera.width_px, view.camera.height_px)) for view in sample.views]
    lights = [estimate_exposure(image) for image in images]
    depths: list[DepthImage | None] = [None] * len(images)
    if sample.lidar is not None:
        path, world_from_lidar = sample.lidar
        raw = read_lidar(path)[:, :3]
        points = apply(world_from_lidar, raw[np.isfinite(raw).all(axis=1)])
        depths = [DepthImage(apply(inverse(view.world_from_cam), points), view.camera) for view in sample.views]
    shown = [
        BoxView.project(image, view.camera, view.world_from_cam, view.boxes_world)
        for image, view in zip(images, sample.views, strict=True)
    ]
    for i in np.flatnonzero(selected).tolist():
        views = []
        for view, depth, light in zip(shown, depths, lights, strict=True):
            pixels = box_pixels(view, i, depth)
            if len(pixels.rgb):
                views.append((pixels, view.camera.channel, light))
        if views:
            yield i, views


def robust_colours(samples: Sequence[SampleInput], bodies: Sequence[list[list[BodyworkSamples]]]) -> list[BoxColours]:
    """Return one colour per object for all samples, estimated from all images of the scene.

    Paint is constant over a scene; occlusion, illumination and reflections vary.
    """
    pictures: dict[str, list[BodyworkSamples]] = {}
    for sample, own in zip(samples, bodies, strict=True):
        for name, body in zip(sample.boxes_world.instance, own, strict=True):
            pictures.setdefault(name, []).extend(body)
    paint = {name: estimate_paint(own) for name, own in pictures.items() if own}
    painted = []
    for sample in samples:
        names = sample.boxes_world.instance
        rgb = [paint.get(name, np.zeros(3, np.uint8)) for name in names]
        known = np.array([name in paint for name in names], dtype=np.bool_)
        painted.append(BoxColours(np.array(rgb, np.uint8).reshape(-1, 3), known))
    return painted
