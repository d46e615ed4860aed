"""Lift and splat by plan: which cell each point of the cameras' frusta falls into, worked out once for a rig.

Philion and Fidler, "Lift, Splat, Shoot", ECCV 2020; Huang and Huang, "BEVPoolv2", 2022 (no frustum of features is
ever made: a cell is a weighted sum of context vectors, the weights are depth probabilities).
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

# Points above or below say nothing of the street (LSS's z bounds).
HEIGHTS_M = (-10.0, 10.0)
# A cell counts as seen if a camera sees a corner of it at one of these heights.
SEEN_HEIGHTS_M = (0.0, 0.75, 1.5)
# Rigs whose plan is kept; a plan of six cameras takes 1 MB, bilinear 4 MB.
_RIGS_KEPT = 32


@dataclass(frozen=True, eq=False)
class SplatPlan:
    """For every cell of a batch's grids, the points that fall into it.

    P points, sorted by cell; V pictures: those of the first sample's cameras, then of the next; features are h x w.

    Attributes:
        pixel: (P,) int64 place in the features (V, h, w), flat.
        depth: (P,) int64 place in the depth probabilities (V, DEPTH_BINS, h, w), flat.
        weight: (P,) float32 share of the point that the cell gets; 1 where a point goes to one cell only.
        cell: (P,) int64 place in the grids (B, X, Y), flat.
        offsets: (B*X*Y + 1,) int64 first point of each cell.
        seen: (B, X, Y) bool, cells that a camera of the rig can see.
        cameras: how many each rig has; V in all.
        export: use operations that exporters translate rightly, at some cost.
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
        """The same on a device."""
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
        """The plan with which a network uses only operations that exporters translate rightly; slower."""
        return replace(self, export=True)


def plan_splat(
    rigs: Sequence[CameraRig], grid: BEVGrid, h: int, w: int, stride: int, bilinear: bool = False
) -> SplatPlan:
    """The plan of a batch of rigs, in float64; equal rigs are worked out once.

    Args:
        rigs: of each sample; they may have different cameras, and different numbers of them.
        grid: where points go.
        h: height of the features.
        w: width of the features.
        stride: of the features in the pictures, whose size is that of the rigs' cameras.
        bilinear: share a point among the four nearest cell centres, instead of one cell taking it whole.

    Raises:
        ShapeError: if a camera's pictures do not give features of this size, or there are no rigs.
    """
    if not rigs:
        raise ShapeError("plan: expected rigs, got none")
    for rig in rigs:
        _check_sizes(rig, h, w, stride)
    parts = [_points_of_rig(rig, grid, h, w, stride, bilinear) for rig in rigs]
    cells = grid.shape[0] * grid.shape[1]
    cameras = tuple(map(len, rigs))
    before = [h * w * count for count in accumulate(cameras[:-1], initial=0)]
    cell = np.concatenate([part.cell + i * cells for i, part in enumerate(parts)])
    pixel = np.concatenate([part.pixel + start for part, start in zip(parts, before, strict=True)])
    depth = np.concatenate([part.depth + start * DEPTH_BINS for part, start in zip(parts, before, strict=True)])
    offsets = np.concatenate([[0], np.bincount(cell, minlength=len(rigs) * cells).cumsum()])
    return SplatPlan(
        pixel=torch.from_numpy(pixel),
        depth=torch.from_numpy(depth),
        weight=torch.from_numpy(np.concatenate([part.weight for part in parts]).astype(np.float32)),
        cell=torch.from_numpy(cell),
        offsets=torch.from_numpy(offsets),
        seen=torch.from_numpy(np.stack([part.seen for part in parts])),
        cameras=cameras,
    )


def pool(context: Tensor, depth: Tensor, plan: SplatPlan) -> Tensor:
    """Sum what falls into each cell: context times probability of its depth (paper, section III).

    Summed in float32 at least: hundreds of points fall into a cell near the car.

    Args:
        context: (V, h, w, C) features of the rigs' pictures, or (B*N, h, w, C) of N pictures for every rig; those
            beyond a rig's cameras are not looked at.
        depth: (V, DEPTH_BINS, h, w) probabilities, or (B*N, DEPTH_BINS, h, w).
        plan: where they go.

    Returns:
        (B, C, X, Y), in channels-last memory.

    Raises:
        ShapeError: if these are not the pictures of the plan.
    """
    batch, x, y = plan.seen.shape
    channels = context.shape[-1]
    dtype = torch.promote_types(context.dtype, torch.float32)
    features = _of_rigs(context, plan.cameras).to(dtype).reshape(-1, channels)  # V*h*w C
    probability = _of_rigs(depth, plan.cameras).to(dtype).reshape(-1)  # V*D*h*w
    share = probability[plan.depth] * plan.weight.to(dtype)  # P
    if plan.export:
        # index_add and index_put lose duplicates in exported graphs, embedding_bag turns to garbage there.
        points = features[plan.pixel] * share[:, None]  # P C
        start = torch.zeros(batch * x * y, channels, dtype=dtype, device=context.device)
        cells = start.scatter_add(0, plan.cell[:, None].expand_as(points), points)
    else:
        cells = functional.embedding_bag(
            plan.pixel, features, plan.offsets, mode="sum", per_sample_weights=share, include_last_offset=True
        )
    return cells.view(batch, x, y, channels).permute(0, 3, 1, 2)


def _of_rigs(per_picture: Tensor, cameras: tuple[int, ...]) -> Tensor:
    """Pictures (V, ...) as they are, or those of (B*N, ...) that rigs have cameras for."""
    if len(per_picture) == sum(cameras):
        return per_picture
    given = len(per_picture) // len(cameras)
    if len(per_picture) % len(cameras) or given < max(cameras):
        raise ShapeError(
            f"pictures: expected {sum(cameras)}, or {len(cameras)} x at least {max(cameras)}, got {len(per_picture)}"
        )
    return pictures_of_rigs(per_picture.reshape(len(cameras), given, *per_picture.shape[1:]), cameras)


def pictures_of_rigs(per_camera: Tensor, cameras: Sequence[int]) -> Tensor:
    """(B, N, ...) -> (V, ...): what stands in for cameras that a rig does not have is left out.

    Raises:
        ShapeError: if there are fewer pictures than cameras.
    """
    if len(per_camera) != len(cameras) or per_camera.shape[1] < max(cameras):
        raise ShapeError(
            f"pictures: expected {len(cameras)} x at least {max(cameras)}, got {tuple(per_camera.shape[:2])}"
        )
    if min(cameras) == per_camera.shape[1]:
        return per_camera.flatten(0, 1)
    return torch.cat([sample[:count] for sample, count in zip(per_camera, cameras, strict=True)])


def by_camera(pictures: Tensor, cameras: Sequence[int], count: int) -> Tensor:
    """(V, ...) -> (B, count, ...): the way back, zeros where a rig has no camera."""
    if min(cameras) == count:
        return pictures.reshape(len(cameras), count, *pictures.shape[1:])
    parts = torch.split(pictures, list(cameras))
    pad = [0, 0] * (pictures.ndim - 1)
    return torch.stack([functional.pad(part, [*pad, 0, count - len(part)]) for part in parts])


def cells_seen(rig: CameraRig, grid: BEVGrid) -> BoolArray:
    """(X, Y), whether a camera has a corner of the cell in its picture, on the ground or up to a car's height above.

    By geometry alone: other things may hide a cell. The cells below the ego's own body are not seen.
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
            # As `Camera.sees`, without a division at every cell.
            inside = (u >= -0.5 * depth) & (u < (camera.width_px - 0.5) * depth) & (depth > 0.1)
            corner |= inside & (v >= -0.5 * depth) & (v < (camera.height_px - 0.5) * depth)
    seen = corner[:-1, :-1] | corner[1:, :-1] | corner[:-1, 1:] | corner[1:, 1:]
    return seen & ~rig.ego_vehicle.body_cells(grid)


class _RigPoints(NamedTuple):
    """One rig's part of a plan, as in `SplatPlan` with B = 1; read-only."""

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
                f"plan, {camera.channel}: expected a picture with {w}x{h} features at stride {stride}, "
                f"got {camera.width_px}x{camera.height_px} pixels"
            )


@lru_cache(_RIGS_KEPT)
def _points_of_rig(rig: CameraRig, grid: BEVGrid, h: int, w: int, stride: int, bilinear: bool) -> _RigPoints:
    points = frustum_points(rig, h, w, stride)  # N D h w 3
    camera, bin_, row, column = np.indices(points.shape[:-1]).reshape(4, -1)
    cell, weight = _shared(points.reshape(-1, 3), grid, bilinear)  # K N*D*h*w 2, K N*D*h*w
    kept = grid.contains(cell) & (weight > 0)
    source = np.nonzero(kept)[1]
    flat = cell[kept][:, 0] * grid.shape[1] + cell[kept][:, 1]
    order = np.argsort(flat, kind="stable")
    source = source[order]
    pixel = (camera * h + row) * w + column
    depth = ((camera * DEPTH_BINS + bin_) * h + row) * w + column
    found = _RigPoints(pixel[source], depth[source], weight[kept][order], flat[order], cells_seen(rig, grid))
    for array in found:
        frozen(array)
    return found


def frustum_points(rig: CameraRig, h: int, w: int, stride: int) -> FloatArray:
    """(N, DEPTH_BINS, h, w, 3) points in the ego frame, metres, that features look at, one for each depth."""
    u, v = column_centres_px(stride, w), column_centres_px(stride, h)
    rays = np.stack([*np.meshgrid(u, v), np.ones((h, w))], axis=-1)  # h w 3
    depth_m = FIRST_DEPTH_M + DEPTH_STEP_M * np.arange(DEPTH_BINS)
    points = np.empty((len(rig), DEPTH_BINS, h, w, 3))
    for i, camera in enumerate(rig):
        points_cam = depth_m[:, None, None, None] * (rays @ np.linalg.inv(camera.intrinsic).T)  # D h w 3
        points[i] = apply(camera.ego_from_cam, np.asarray(points_cam, dtype=np.float64))
    return points


def _shared(points_m: FloatArray, grid: BEVGrid, bilinear: bool) -> tuple[IntArray, FloatArray]:
    """Cells (K, P, 2) that points (P, 3) go to and their shares (K, P); K is 4 if bilinear, else 1."""
    inside = (points_m[:, 2] >= HEIGHTS_M[0]) & (points_m[:, 2] < HEIGHTS_M[1])
    if not bilinear:
        return grid.cell_of(points_m[:, :2])[None], inside[None].astype(np.float64)
    place = (points_m[:, :2] - [grid.x_min_m, grid.y_min_m]) / grid.cell_m - 0.5
    corner = np.floor(place)
    part = place - corner  # P 2
    steps = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    shares = np.where(steps[:, None] == 1, part, 1 - part).prod(axis=-1)  # 4 P
    return (corner + steps[:, None]).astype(np.int64), shares * inside
