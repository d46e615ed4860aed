"""Planning of BEV sampling: which image features each grid cell reads, for the rigs of a batch, on any device."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from appocc.camera import Camera, CameraRig
from appocc.errors import ShapeError
from appocc.geometry import inverse
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, DEPTH_STEP_M, FIRST_DEPTH_M
from appocc.models.view_transform.sampling import RowSums, SamplingPlan, first_entries

HEIGHTS_M = (0.0, 0.6, 1.3)
_NEAREST_M = 0.1
# Number of cached plans: a rig at the two strides of a network, and a few more.
_KEPT_PLANS = 8
# Points that a CPU projects at once: larger arrays cost more than they save.
_POINTS_AT_ONCE = 200_000
_CPU = torch.device("cpu")


def plan_sampling(
    rigs: Sequence[CameraRig],
    grid: BEVGrid,
    heights_m: Sequence[float],
    h: int,
    w: int,
    stride: int,
    depths: bool = False,
    device: torch.device = _CPU,
) -> SamplingPlan:
    """Return the sampling plan of a batch, computed on a device.

    Args:
        rigs: rig of each sample, for the images after `fit_image`.
        grid: cells that sample.
        heights_m: heights of the sampling points above the cell centres, ego frame.
        h: height of the features.
        w: width of the features.
        stride: pixels between features; feature i is centred on pixel i * stride.
        depths: plan for features (V, h, w * DEPTH_BINS, C): each point reads the depth bins next to its own depth,
            clamped to the first and last.
        device: device of the plan.

    Raises:
        ShapeError: if there is no rig or no height, or the image of a camera has features of another size.
    """
    if not rigs or not heights_m:
        raise ShapeError(f"plan: expected rigs and heights, got {len(rigs)} and {len(heights_m)}")
    for camera in (camera for rig in rigs for camera in rig):
        wanted = -(-camera.height_px // stride), -(-camera.width_px // stride)
        if wanted != (h, w):
            raise ShapeError(f"{camera.channel}: expected features of {wanted} at stride {stride}, got {(h, w)}")
    heights = tuple(map(float, heights_m))
    groups = _groups(tuple(map(_key, rigs)), device)
    plans = [_plan_rigs(group, grid, heights, h, w, stride, depths, device) for group in groups]
    rows = [plan.rows for plan in plans]
    return SamplingPlan(
        _concatenate([plan.read for plan in plans], rows),
        sum(rows),
        torch.cat([plan.count for plan in plans]),
        tuple(map(len, rigs)),
        len(heights),
        plans[0].corners,
    )


def _concatenate(tables: list[RowSums], rows: list[int]) -> RowSums:
    """Concatenate row sums; `rows` is the number of rows of each."""
    if len(tables) == 1:
        return tables[0]
    row_starts = accumulate(rows[:-1], initial=0)
    starts = accumulate((len(table.rows) for table in tables[:-1]), initial=0)
    return RowSums(
        torch.cat([table.rows + start for table, start in zip(tables, row_starts, strict=True)]),
        torch.cat([table.offsets + start for table, start in zip(tables, starts, strict=True)]),
        torch.cat([table.weights for table in tables]),
    )


class _Projection(NamedTuple):
    """Image size and projection of a camera, as a hashable value."""

    width_px: int
    height_px: int
    pixel_from_ego: bytes


_RigKey = tuple[_Projection, ...]


def _key(rig: CameraRig) -> _RigKey:
    return tuple(_Projection(each.width_px, each.height_px, _pixel_from_ego(each).tobytes()) for each in rig)


def _pixel_from_ego(camera: Camera) -> NDArray[np.float64]:
    """Return the (3, 4) projection from ego metres to (u * depth, v * depth, depth)."""
    return np.asarray(camera.intrinsic @ inverse(camera.ego_from_cam)[:3])


def _groups(rigs: tuple[_RigKey, ...], device: torch.device) -> list[tuple[_RigKey, ...]]:
    """Split the rigs of a batch into those that are planned at once: on a CPU one by one, from the cache if possible.

    A GPU plans the rigs of a batch together. A batch of clips is time-major and repeats its rigs at every time.
    """
    if device.type == "cpu":
        return [(rig,) for rig in rigs]
    different = tuple(dict.fromkeys(rigs))
    times = len(rigs) // len(different)
    return [different] * times if different * times == rigs else [rigs]


@lru_cache(maxsize=_KEPT_PLANS)
def _plan_rigs(
    rigs: tuple[_RigKey, ...],
    grid: BEVGrid,
    heights_m: tuple[float, ...],
    h: int,
    w: int,
    stride: int,
    depths: bool,
    device: torch.device,
) -> SamplingPlan:
    """Return the plan of several samples; its tensors are cached and must not be written."""
    bags = len(rigs) * grid.shape[0] * grid.shape[1] * len(heights_m)
    rows = sum(map(len, rigs)) * h * w * (DEPTH_BINS if depths else 1)
    bag, camera, uvd = _visible_points(rigs, grid, heights_m, device)
    corner, share = _bilinear_corners(uvd[:2] / stride, h, w)
    corner += (camera * (h * w))[:, None]
    if depths:
        corner, share = _depth_corners(corner, share, uvd[2])
    count = torch.bincount(bag, minlength=bags)
    read = RowSums(corner.flatten(), first_entries(corner.shape[1] * count), (share / count[bag][:, None]).flatten())
    on_ground = count.reshape(len(rigs), *grid.shape, len(heights_m))[..., int(np.argmin(np.abs(heights_m)))]
    cameras = tuple(map(len, rigs))
    return SamplingPlan(read, rows, on_ground[:, None].float(), cameras, len(heights_m), corner.shape[1])


@lru_cache(maxsize=1)  # features and their depths are sampled at the same points
def _visible_points(
    rigs: tuple[_RigKey, ...], grid: BEVGrid, heights_m: tuple[float, ...], device: torch.device
) -> tuple[Tensor, Tensor, Tensor]:
    """Return the points that a camera sees, in the order of their bags.

    Returns:
        (n,) bags, (sample, cell, height) flat; (n,) cameras, counted over the rigs; (3, n) float32 pixels and depths.
    """
    most = max(1, *map(len, rigs))
    # Cameras that a rig lacks see nothing: their depths are 0.
    matrix, size, first = np.zeros((len(rigs), most, 3, 4)), np.zeros((2, len(rigs), most)), []
    for number, rig in enumerate(rigs):
        first.append(sum(map(len, rigs[:number])))
        for slot, camera in enumerate(rig):
            matrix[number, slot] = np.frombuffer(camera.pixel_from_ego).reshape(3, 4)
            size[:, number, slot] = camera.width_px, camera.height_px
    x_m, y_m = (grid.centre_of(np.stack([np.arange(n)] * 2, axis=-1))[:, i] for i, n in enumerate(grid.shape))
    up = matrix[..., 2:3] * np.array(heights_m) + matrix[..., 3:]
    along, across, up = (  # 3 B X N, 3 B Y N, 3 B Z N
        torch.from_numpy(each.transpose(2, 0, 3, 1)).to(device)
        for each in (matrix[..., :1] * x_m, matrix[..., 1:2] * y_m, up)
    )
    limit = torch.from_numpy(size - 0.5).to(device)
    row = grid.shape[1] * len(heights_m) * most  # points of one row of cells
    some = max(1, _POINTS_AT_ONCE // row) if device.type == "cpu" and len(rigs) == 1 else grid.shape[0]
    starts = range(0, grid.shape[0], some)
    found = [_inside(along[:, :, start : start + some], across, up, limit) for start in starts]
    at = torch.cat([start * row + own for start, (own, _) in zip(starts, found, strict=True)])
    uvd = torch.cat([each for _, each in found], dim=1)
    bag, own_camera = at // most, at % most
    sample = bag // (grid.shape[0] * grid.shape[1] * len(heights_m))
    return bag, torch.tensor(first, device=device)[sample] + own_camera, uvd


def _inside(along: Tensor, across: Tensor, up: Tensor, limit: Tensor) -> tuple[Tensor, Tensor]:
    """Return the points that cameras see: (n,) indices of B X Y Z N, and (3, n) float32 pixels and depths.

    The projections to pixels times depth, and to depth, are sums along x (3, B, X, N), y (3, B, Y, N) and z.
    """
    u, v, depth = along[:, :, :, None, None] + across[:, :, None, :, None] + up[:, :, None, None]  # each B X Y Z N
    # Tested before the division, because most points are outside the image.
    inside = depth > _NEAREST_M
    for side, most in zip((u, v), limit, strict=True):
        inside &= (side >= -0.5 * depth) & (side < most[:, None, None, None] * depth)
    at = inside.flatten().nonzero()[:, 0]
    far = depth.flatten()[at]
    return at, torch.stack([u.flatten()[at] / far, v.flatten()[at] / far, far]).float()


def _bilinear_corners(uv: Tensor, h: int, w: int) -> tuple[Tensor, Tensor]:
    """Return int32 rows (n, 4) and weights (n, 4) of bilinear sampling at feature coordinates (2, n), clamped."""
    u, v = uv[0].clamp(0, w - 1), uv[1].clamp(0, h - 1)
    left, top = u.int().clamp(max=max(w - 2, 0)), v.int().clamp(max=max(h - 2, 0))
    du, dv = u - left, v - top
    right, below = int(w > 1), w * int(h > 1)
    first = top * w + left
    corner = torch.stack([first, first + right, first + below, first + below + right], dim=-1)
    return corner, torch.stack([(1 - du) * (1 - dv), du * (1 - dv), (1 - du) * dv, du * dv], dim=-1)


def _depth_corners(corner: Tensor, share: Tensor, depth_m: Tensor) -> tuple[Tensor, Tensor]:
    """Return rows (n, 8) and weights (n, 8) of depth bins, of bilinear rows and weights (n, 4) and depths (n,)."""
    bins = ((depth_m - FIRST_DEPTH_M) / DEPTH_STEP_M).clamp(0, DEPTH_BINS - 1)
    low = bins.int().clamp(max=DEPTH_BINS - 2)
    part = (bins - low)[:, None]
    first = corner * DEPTH_BINS + low[:, None]
    return torch.cat([first, first + 1], dim=1), torch.cat([share * (1 - part), share * part], dim=1)
