"""Colouring of static LiDAR points from the images that see them (paper, section IV.C)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy import ndimage

from appocc.checks import ByteArray, Float32Array, FloatArray, IntArray
from appocc.files import read_image
from appocc.geometry import apply, inverse
from appocc.groundtruth.inputs import PosedImage, SweepInput
from appocc.groundtruth.visibility import DepthImage, occluded_by_boxes
from appocc.nuscenes.lidar import read_labels, read_lidar

NO_CAMERA = 255
OTHER, ROAD, LANE, UNLABELLED = 0, 1, 2, 255
# The far corner of the grid: points beyond it are outside the grid.
_MAX_RANGE_M = 57.0
# Excludes returns from the ego vehicle: nuScenes' bonnet reaches 2.4 m, the first ring on the road is at 3 m.
_MIN_RANGE_M = 2.5
_BOX_MARGIN_M = 0.1


@dataclass(frozen=True, eq=False)
class ColouredPoints:
    """Observations of points, one row per point and camera; a point that no camera sees has one row without colour.

    Attributes:
        xyz_m: (N, 3) float32 in the world frame, relative to the origin of the scene.
        rgb: (N, 3) uint8.
        camera: (N,) index of the camera in the sorted list of channels, NO_CAMERA without colour.
        ground: (N,) uint8 OTHER, ROAD, LANE (a marking, which is road too), or UNLABELLED.
    """

    xyz_m: Float32Array
    rgb: ByteArray
    camera: ByteArray
    ground: ByteArray


@lru_cache(maxsize=20)
def cached_image(path: Path, width_px: int, height_px: int) -> ByteArray:
    """Read an image; cached, since neighbouring sweeps use the same images."""
    return read_image(path, (width_px, height_px))


def colour_at(image: ByteArray, uv_px: FloatArray) -> Float32Array:
    """Return the (N, 3) colours at sub-pixel positions (N, 2), bilinear."""
    where = uv_px.T[::-1]
    channels = [
        ndimage.map_coordinates(image[..., c], where, output=np.float32, order=1, mode="nearest") for c in range(3)
    ]
    return np.stack(channels, axis=1)


def colour_sweep(sweep: SweepInput, origin_m: FloatArray, channels: tuple[str, ...]) -> ColouredPoints:
    """Colour the static points of a sweep; `origin_m` (3,) is subtracted from the world coordinates.

    A point takes its colours from the images nearest in time in which any camera sees it.

    Raises:
        DataError: if the sweep, its labels or an image is damaged.
    """
    raw = read_lidar(sweep.path)
    labels = read_labels(sweep.labels.path, len(raw)) if sweep.labels else np.zeros(len(raw), np.uint8)
    distance = np.linalg.norm(raw[:, :3], axis=1)
    keep = np.isfinite(distance) & (distance > _MIN_RANGE_M) & (distance < _MAX_RANGE_M)
    points = apply(sweep.world_from_lidar, raw[keep, :3])
    static = ~sweep.boxes_world.inside(points, _BOX_MARGIN_M)
    all_points, points = points, points[static]
    ground = _ground_classes(sweep, labels[keep][static])
    uncoloured = np.arange(len(points), dtype=np.int64)
    rows: list[tuple[IntArray, Float32Array, ByteArray]] = []
    for views in sweep.rounds:
        seen = np.zeros(len(points), dtype=np.bool_)
        for view in views:
            index, rgb = _visible_points(view, points, uncoloured, all_points)
            seen[index] = True
            number = np.full(len(index), channels.index(view.camera.channel), np.uint8)
            rows.append((index, rgb, number))
        uncoloured = uncoloured[~seen[uncoloured]]
    rows.append(
        (uncoloured, np.zeros((len(uncoloured), 3), np.float32), np.full(len(uncoloured), NO_CAMERA, np.uint8))
    )
    index = np.concatenate([row[0] for row in rows])
    return ColouredPoints(
        (points[index] - origin_m).astype(np.float32),
        np.round(np.concatenate([row[1] for row in rows])).astype(np.uint8),
        np.concatenate([row[2] for row in rows]),
        ground[index],
    )


def _ground_classes(sweep: SweepInput, labels: ByteArray) -> ByteArray:
    """Return the ground class of each point from the labels of the sweep."""
    if sweep.labels is None:
        return np.full(len(labels), UNLABELLED, np.uint8)
    ground = np.where(sweep.labels.is_road[labels], ROAD, OTHER).astype(np.uint8)
    if sweep.labels.is_lane is not None:
        ground[sweep.labels.is_lane[labels]] = LANE
    return ground


def _visible_points(
    view: PosedImage, points: FloatArray, candidates: IntArray, all_points: FloatArray
) -> tuple[IntArray, Float32Array]:
    """Return which of the candidate points (indices) are visible in an image, and their colours."""
    cam_from_world = inverse(view.world_from_cam)
    camera = view.camera
    uv, depth = camera.project(apply(cam_from_world, points[candidates]))
    inside = camera.sees(uv, depth)
    index, uv, depth = candidates[inside], uv[inside], depth[inside]
    if not len(index):
        return index, np.zeros((0, 3), np.float32)
    clear = ~DepthImage(apply(cam_from_world, all_points), camera).occludes(uv, depth)
    index, uv = index[clear], uv[clear]
    clear = ~occluded_by_boxes(points[index], uv, camera, view.world_from_cam, view.boxes_world)
    index, uv = index[clear], uv[clear]
    if not len(index):
        return index, np.zeros((0, 3), np.float32)
    return index, colour_at(cached_image(view.path, camera.width_px, camera.height_px), uv)
