"""Occlusion: a depth image from the points of a sweep, and boxes as opaque bodies."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import cv2
import numpy as np

from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import BoolArray, Float32Array, FloatArray, IntArray
from appocc.geometry import apply, inverse
from appocc.typing import Flags, List2, List3, Numbers, Transform, Vector3

# Angular size of the cells: as wide as two LiDAR columns, flat enough to separate near and far ground.
_COLUMN_RAD, _ROW_RAD = 1 / 160, 1 / 1000
# Largest angle between neighbouring rings of one surface (nuScenes' 32 beams are 1.33 degrees apart).
_RING_GAP_RAD = np.deg2rad(1.7)
_RELATIVE_SLACK, _SLACK_M = 0.04, 0.2
# Corners of boxes that are nearer are behind the camera.
_LEAST_DEPTH_M = 0.1


class DepthImage:
    """Nearest depth by direction, from the points of one sweep.

    Gaps between rings are interpolated linearly in inverse depth, which is exact on planes such as the road and
    biased to the near side at edges.
    """

    def __init__(self, points_cam: List3, camera: Camera) -> None:
        """Build the depth image from points (N, 3) in the camera frame, including those on moving objects."""
        self._camera = camera
        focal = float(camera.intrinsic[0, 0])
        self._cell_px = np.maximum([focal * _COLUMN_RAD, focal * _ROW_RAD], 1.0)
        columns, rows = np.ceil(np.array([camera.width_px, camera.height_px]) / self._cell_px).astype(int)
        uv, depth = camera.project(points_cam)
        seen = camera.sees(uv, depth)
        inverse_depth = np.zeros((columns, rows), np.float32)
        cells, near = self._cells(uv[seen]), (1 / depth[seen]).astype(np.float32)
        order = np.argsort(near, kind="stable")  # the nearest point is written last
        inverse_depth[cells[order, 0], cells[order, 1]] = near[order]
        _fill_rings(inverse_depth, int(_RING_GAP_RAD * focal / self._cell_px[1]))
        # One column to each side closes the gaps between columns and covers blurred edges.
        self._inverse_depth = cv2.dilate(inverse_depth, np.ones((3, 1), np.uint8))

    def _cells(self, uv_px: FloatArray) -> IntArray:
        return ((uv_px + 0.5) / self._cell_px).astype(np.int64)

    def occludes(self, uv_px: List2, depth_m: Numbers) -> Flags:
        """Whether a nearer surface occludes pixels (N, 2) of the image at depths (N,)."""
        return np.asarray((depth_m - _SLACK_M) * self._inverse_depth_at(uv_px) > 1 + _RELATIVE_SLACK)

    def depth_m(self, uv_px: List2) -> Numbers:
        """Return the LiDAR depths (N,) at pixels (N, 2) of the image; infinite where there are no points."""
        inverse_depth = self._inverse_depth_at(uv_px).astype(np.float64)
        with np.errstate(divide="ignore"):
            return np.asarray(1 / inverse_depth)

    def _inverse_depth_at(self, uv_px: FloatArray) -> Float32Array:
        cells = self._cells(uv_px)
        return np.asarray(self._inverse_depth[cells[:, 0], cells[:, 1]])


def _fill_rings(inverse_depth: Float32Array, limit: int) -> None:
    """Interpolate gaps of up to `limit` rows within each column linearly, in place; 0 means empty."""
    column, row = np.nonzero(inverse_depth)  # sorted by column, then row
    gap = np.where(column[1:] == column[:-1], row[1:] - row[:-1], 0)
    start = np.flatnonzero((gap > 1) & (gap <= limit))
    count = gap[start] - 1
    which = np.repeat(start, count)
    step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + 1
    below = inverse_depth[column[which], row[which]]
    above = inverse_depth[column[which + 1], row[which + 1]]
    share = step / gap[which]
    inverse_depth[column[which], row[which] + step] = below + share * (above - below)


def ray_box_entry(origin: Vector3, directions: List3, frame_from_box: Transform, half_lwh_m: Vector3) -> Numbers:
    """Return the (P,) parameter t at which rays origin + t * directions (P, 3) enter a box; infinite if they miss it.

    Slab method; a ray that starts inside enters at 0.
    """
    box_from_frame = inverse(frame_from_box)
    start = apply(box_from_frame, origin)
    along = directions @ box_from_frame[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (-half_lwh_m - start) / along, (half_lwh_m - start) / along
    # fmax and fmin ignore NaN (a ray in the plane of a face); reducing by column is fast.
    enter = reduce(np.fmax, np.minimum(first, second).T)
    leave = reduce(np.fmin, np.maximum(first, second).T)
    return np.where((enter <= leave) & (leave > 0), np.maximum(enter, 0.0), np.inf)


class ImageRectangles(NamedTuple):
    """Image regions of N boxes: lower and upper pixel bounds (N, 2), and (N,) whether the image shows the box."""

    low: FloatArray
    high: FloatArray
    shown: BoolArray


def image_rectangles(camera: Camera, corners_cam: FloatArray) -> ImageRectangles:
    """Return the regions around the corners (N, 8, 3) of boxes in the camera frame.

    The whole image if a part of the box is behind the camera.
    """
    depth = corners_cam[..., 2]
    size = np.array([camera.width_px, camera.height_px], dtype=np.float64)
    uv = camera.project(corners_cam.reshape(-1, 3))[0].reshape(*depth.shape, 2)
    beside = (depth.min(axis=1) <= _LEAST_DEPTH_M)[:, None]
    low = np.where(beside, 0.0, np.clip(uv.min(axis=1), 0, size))
    high = np.where(beside, size, np.clip(uv.max(axis=1) + 1, 0, size))
    return ImageRectangles(low, high, (depth.max(axis=1) > _LEAST_DEPTH_M) & (high > low).all(axis=1))


def occluded_by_boxes(
    points_world: FloatArray,
    uv_px: FloatArray,
    camera: Camera,
    world_from_cam: FloatArray,
    boxes_world: Boxes,
    margin_m: float = 0.15,
) -> BoolArray:
    """Whether a box, enlarged by a margin, occludes each of the points (P, 3) from the camera."""
    hidden = np.zeros(len(points_world), dtype=np.bool_)
    eye = world_from_cam[:3, 3]
    grown = replace(boxes_world, size_wlh_m=boxes_world.size_wlh_m + 2 * margin_m)
    corners_cam = apply(inverse(world_from_cam), grown.corners())
    halves = grown.half_lwh_m()
    low, high, shown = image_rectangles(camera, corners_cam)
    for i in np.flatnonzero(shown).tolist():
        near = np.flatnonzero(~hidden & ((uv_px >= low[i] - 1) & (uv_px <= high[i] + 1)).all(axis=1))
        if len(near):
            entry = ray_box_entry(eye, points_world[near] - eye, grown.frame_from_box(i), halves[i])
            hidden[near] = entry < 1.0
    return hidden
