"""Lift and splat: the cell of every frustum point is precomputed once per rig.

Philion and Fidler, "Lift, Splat, Shoot", ECCV 2020; Huang and Huang, "BEVPoolv2", 2022 (a cell is a sum of context
vectors weighted by depth probabilities, without an explicit frustum of features).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple, Self

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from appocc.camera import CameraRig
from appocc.checks import BoolArray, FloatArray, IntArray, frozen
from appocc.errors import ShapeError
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, DEPTH_STEP_M, FIRST_DEPTH_M
from appocc.models.efficientnet import column_centres_px

# Points outside these heights are dropped (the z bounds of LSS).
HEIGHTS_M = (-10.0, 10.0)
# A cell is visible if a camera sees a corner of it at one of these heights.
SEEN_HEIGHTS_M = (0.0, 0.75, 1.5)
# Number of cached plans; a plan of six cameras takes 1 MB, bilinear 4 MB.
_RIGS_KEPT = 32


@dataclass(frozen=True, eq=False, kw_only=True)
class SplattingPlan:
    """Splatting plan of a batch: the frustum points in every cell.

    P points, sorted by cell; V images: the cameras of the first sample, then of the next; features are h x w.

    Attributes:
        pixel: (P,) int64 flat index into the features (V, h, w).
        depth: (P,) int64 flat index into the depth probabilities (V, DEPTH_BINS, h, w).
        weight: (P,) float32 share of the point in the cell; 1 if a point is in one cell only.
        cell: (P,) int64 flat index into the grids (B, X, Y).
        offsets: (B*X*Y + 1,) int64 first point of each cell.
        seen: (B, X, Y) bool, cells that a camera of the rig can see.
        cameras: number of cameras of each rig; the sum is V.
        export: use only operations that exporters support; slower.
    """

    pixel: Tensor
    depth: Tensor
    weight: Tensor
    cell: Tensor
    offsets: Tensor
    seen: Tensor
    cameras: tuple[int, ...]
    export: bool = False

    def to(self, device: torch.device) -> Self:
        """Return the plan on a device."""
        return replace(
            self,
            pixel=self.pixel.to(device),
            depth=self.depth.to(device),
            weight=self.weight.to(device),
            cell=self.cell.to(device),
            offsets=self.offsets.to(device),
            seen=self.seen.to(device),
        )

    def for_export(self) -> Self:
        """Return the plan for export: the network then uses only operations that exporters support; slower."""
        return replace(self, export=True)


def plan_splatting(
    rigs: Sequence[CameraRig], grid: BEVGrid, h: int, w: int, stride: int, bilinear: bool = False
) -> SplattingPlan:
    """Return the splatting plan of a batch of rigs, computed in float64; plans of equal rigs are cached.

    Args:
        rigs: rig of each sample; cameras and their number may differ.
        grid: cells that the points are summed in.
        h: height of the features.
        w: width of the features.
        stride: pixels between features, in images of the size of the cameras.
        bilinear: distribute a point over the four nearest cell centres instead of one cell.

    Raises:
        ShapeError: if the image of a camera has features of another size, or there are no rigs.
    """
    if not rigs:
        raise ShapeError("plan: expected rigs, got none")
    for rig in rigs:
        _check_sizes(rig, h, w, stride)
    parts = [_rig_points(rig, grid, h, w, stride, bilinear) for rig in rigs]
    cells = grid.shape[0] * grid.shape[1]
    cameras = tuple(map(len, rigs))
    before = [h * w * count for count in accumulate(cameras[:-1], initial=0)]
    cell = np.concatenate([part.cell + i * cells for i, part in enumerate(parts)])
    pixel = np.concatenate([part.pixel + start for part, start in zip(parts, before, strict=True)])
    depth = np.concatenate([part.depth + start * DEPTH_BINS for part, start in zip(parts, before, strict=True)])
    offsets = np.concatenate([[0], np.bincount(cell, minlength=len(rigs) * cells).cumsum()])
    return SplattingPlan(
        pixel=torch.from_numpy(pixel),
        depth=torch.from_numpy(depth),
        weight=torch.from_numpy(np.concatenate([part.weight for part in parts]).astype(np.float32)),
        cell=torch.from_numpy(cell),
        offsets=torch.from_numpy(offsets),
        seen=torch.from_numpy(np.stack([part.seen for part in parts])),
        cameras=cameras,
    )


def splat(context: Tensor, depth: Tensor, plan: SplattingPlan) -> Tensor:
    """Sum context times depth probability over the points in each cell (paper, section III).

    Sums are at least float32: cells near the car have hundreds of points.

    Args:
        context: (V, h, w, C) features of the images, or (B*N, h, w, C) of N images per rig; images beyond the cameras
            of a rig are ignored.
        depth: (V, DEPTH_BINS, h, w) probabilities, or (B*N, DEPTH_BINS, h, w).
        plan: splatting plan of these images.

    Returns:
        (B, C, X, Y), in channels-last memory.

    Raises:
        ShapeError: if the plan was made for other images.
    """
    batch, x, y = plan.seen.shape
    channels = context.shape[-1]
    dtype = torch.promote_types(context.dtype, torch.float32)
    features = _pack(context, plan.cameras).to(dtype).reshape(-1, channels)  # V*h*w C
    probability = _pack(depth, plan.cameras).to(dtype).reshape(-1)  # V*D*h*w
    share = probability[plan.depth] * plan.weight.to(dtype)  # P
    if plan.export:
        # In exported graphs, index_add and index_put lose duplicates, and embedding_bag is wrong.
        points = features[plan.pixel] * share[:, None]  # P C
        start = torch.zeros(batch * x * y, channels, dtype=dtype, device=context.device)
        cells = start.scatter_add(0, plan.cell[:, None].expand_as(points), points)
    else:
        cells = functional.embedding_bag(
            plan.pixel, features, plan.offsets, mode="sum", per_sample_weights=share, include_last_offset=True
        )
    return cells.view(batch, x, y, channels).permute(0, 3, 1, 2)


def _pack(per_image: Tensor, cameras: tuple[int, ...]) -> Tensor:
    """Return features (V, ...) unchanged, or those of (B*N, ...) that belong to a camera."""
    if len(per_image) == sum(cameras):
        return per_image
    given = len(per_image) // len(cameras)
    if len(per_image) % len(cameras) or given < max(cameras):
        raise ShapeError(
            f"images: expected {sum(cameras)}, or {len(cameras)} x at least {max(cameras)}, got {len(per_image)}"
        )
    return pack_cameras(per_image.reshape(len(cameras), given, *per_image.shape[1:]), cameras)


def pack_cameras(per_camera: Tensor, cameras: Sequence[int]) -> Tensor:
    """Pack (B, N, ...) into (V, ...): drop the padding for cameras that a rig does not have.

    Raises:
        ShapeError: if there are fewer images than cameras.
    """
    if len(per_camera) != len(cameras) or per_camera.shape[1] < max(cameras):
        raise ShapeError(
            f"images: expected {len(cameras)} x at least {max(cameras)}, got {tuple(per_camera.shape[:2])}"
        )
    if min(cameras) == per_camera.shape[1]:
        return per_camera.flatten(0, 1)
    return torch.cat([sample[:count] for sample, count in zip(per_camera, cameras, strict=True)])


def unpack_cameras(packed: Tensor, cameras: Sequence[int], count: int) -> Tensor:
    """Unpack (V, ...) into (B, count, ...): inverse of `pack_cameras`, zeros where a rig has no camera."""
    if min(cameras) == count:
        return packed.reshape(len(cameras), count, *packed.shape[1:])
    parts = torch.split(packed, list(cameras))
    pad = [0, 0] * (packed.ndim - 1)
    return torch.stack([functional.pad(part, [*pad, 0, count - len(part)]) for part in parts])


def visible_cells(rig: CameraRig, grid: BEVGrid) -> BoolArray:
    """Return (X, Y) bool: cells with a corner in the image of a camera, on the ground or up to the height of a car.

    Occlusion is ignored. Cells below the body of the ego vehicle are not visible.
    """
    x, y = grid.shape
    x_m, y_m = grid.x_min_m + grid.cell_m * np.arange(x + 1), grid.y_min_m + grid.cell_m * np.arange(y + 1)
    corner = np.zeros((x + 1, y + 1), dtype=np.bool_)
    for camera in rig:
        pixel_from_ego = camera.intrinsic @ inverse(camera.ego_from_cam)[:3]  # 3 4, pixels times depth
        for height_m in SEEN_HEIGHTS_M:
            at_origin = pixel_from_ego[:, 2] * height_m + pixel_from_ego[:, 3]
            u, v, depth = (
                row[0] * x_m[:, None] + (row[1] * y_m + start)
                for row, start in zip(pixel_from_ego, at_origin, strict=True)
            )
            # As `Camera.sees`, without a division for every cell.
            inside = (u >= -0.5 * depth) & (u < (camera.width_px - 0.5) * depth) & (depth > 0.1)
            corner |= inside & (v >= -0.5 * depth) & (v < (camera.height_px - 0.5) * depth)
    seen = corner[:-1, :-1] | corner[1:, :-1] | corner[:-1, 1:] | corner[1:, 1:]
    return seen & ~rig.ego_vehicle.body_cells(grid)


class _RigPlan(NamedTuple):
    """Plan of one rig, as in `SplattingPlan` with B = 1; read-only."""

    pixel: IntArray
    depth: IntArray
    weight: FloatArray
    cell: IntArray
    seen: BoolArray


def _check_sizes(rig: CameraRig, h: int, w: int, stride: int) -> None:
    for camera in rig:
        size = (-(-camera.height_px // stride), -(-camera.width_px // stride))
        if size != (h, w):
            raise ShapeError(
                f"plan, {camera.channel}: expected an image with {w}x{h} features at stride {stride}, "
                f"got {camera.width_px}x{camera.height_px} pixels"
            )


@lru_cache(_RIGS_KEPT)
def _rig_points(rig: CameraRig, grid: BEVGrid, h: int, w: int, stride: int, bilinear: bool) -> _RigPlan:
    points = frustum_points(rig, h, w, stride)  # N D h w 3
    camera, bin_, row, column = np.indices(points.shape[:-1]).reshape(4, -1)
    cell, weight = _splat_cells(points.reshape(-1, 3), grid, bilinear)  # K N*D*h*w 2, K N*D*h*w
    kept = grid.contains(cell) & (weight > 0)
    source = np.nonzero(kept)[1]
    flat = cell[kept][:, 0] * grid.shape[1] + cell[kept][:, 1]
    order = np.argsort(flat, kind="stable")
    source = source[order]
    pixel = (camera * h + row) * w + column
    depth = ((camera * DEPTH_BINS + bin_) * h + row) * w + column
    found = _RigPlan(pixel[source], depth[source], weight[kept][order], flat[order], visible_cells(rig, grid))
    for array in found:
        frozen(array)
    return found


def frustum_points(rig: CameraRig, h: int, w: int, stride: int) -> FloatArray:
    """Return (N, DEPTH_BINS, h, w, 3) frustum points in the ego frame, metres: one per feature and depth."""
    u, v = column_centres_px(stride, w), column_centres_px(stride, h)
    rays = np.stack([*np.meshgrid(u, v), np.ones((h, w))], axis=-1)  # h w 3
    depth_m = FIRST_DEPTH_M + DEPTH_STEP_M * np.arange(DEPTH_BINS)
    points = np.empty((len(rig), DEPTH_BINS, h, w, 3))
    for i, camera in enumerate(rig):
        points_cam = depth_m[:, None, None, None] * (rays @ np.linalg.inv(camera.intrinsic).T)  # D h w 3
        points[i] = apply(camera.ego_from_cam, np.asarray(points_cam, dtype=np.float64))
    return points


def _splat_cells(points_m: FloatArray, grid: BEVGrid, bilinear: bool) -> tuple[IntArray, FloatArray]:
    """Return the cells (K, P, 2) of points (P, 3) and their shares (K, P); K is 4 if bilinear, else 1."""
    inside = (points_m[:, 2] >= HEIGHTS_M[0]) & (points_m[:, 2] < HEIGHTS_M[1])
    if not bilinear:
        return grid.cell_of(points_m[:, :2])[None], inside[None].astype(np.float64)
    place = (points_m[:, :2] - [grid.x_min_m, grid.y_min_m]) / grid.cell_m - 0.5
    corner = np.floor(place)
    part = place - corner  # P 2
    steps = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    shares = np.where(steps[:, None] == 1, part, 1 - part).prod(axis=-1)  # 4 P
    return (corner + steps[:, None]).astype(np.int64), shares * inside
