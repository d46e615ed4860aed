"""The planned pull: each cell of the grid reads the features of the cameras that see it, at a few heights.

After Harley et al., "Simple-BEV: What Really Matters for Multi-Sensor BEV Perception?", ICRA 2023: depth is not
learnt but left to the trunk. Where each cell reads is worked out once for a rig; a network then sums rows of a table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import sparse
from torch import Tensor
from torch.nn import functional

from appocc.camera import Camera, CameraRig
from appocc.checks import Float32Array
from appocc.errors import ShapeError
from appocc.geometry import inverse
from appocc.grid import BEVGrid

HEIGHTS_M = (0.0, 0.6, 1.3)
_NEAREST_M = 0.1
# Plans of rigs that come again and again: a car's own, at the two strides of a network, and a few to compare.
_KEPT_PLANS = 8
# Entries of a bag that one camera sees: the corners of bilinear reading. Most cells are seen by one.
_FEW = 4


class Table(NamedTuple):
    """Sums of weighted rows: bag b is the sum of `weights` times the `rows`, from offsets[b] to offsets[b + 1].

    Attributes:
        rows: (E,) int32 numbers of rows.
        offsets: (bags,) int32, where each bag begins.
        weights: (E,) float32.
    """

    rows: Tensor
    offsets: Tensor
    weights: Tensor

    def to(self, device: torch.device) -> Table:
        """The same on a device."""
        return Table(*(each.to(device, non_blocking=True) for each in self))

    def sum_of(self, values: Tensor) -> Tensor:
        """(bags, C) of rows (R, C)."""
        return functional.embedding_bag(self.rows, values, self.offsets, per_sample_weights=self.weights, mode="sum")


class Slots(NamedTuple):
    """The sums of a table without gaps: a few entries of every bag, and the others of those bags that have more.

    Attributes:
        rows: (_FEW, bags) int64, entries too many are row 0 with weight 0.
        weights: (_FEW, bags, 1).
        more_rows: (S, bags with more) int64.
        more_weights: (S, bags with more, 1).
        place: (bags,) int64, 1 + the number of a bag among those with more; 0 of the others.
    """

    rows: Tensor
    weights: Tensor
    more_rows: Tensor
    more_weights: Tensor
    place: Tensor

    def to(self, device: torch.device) -> Slots:
        """The same on a device."""
        return Slots(*(each.to(device) for each in self))

    def sum_of(self, values: Tensor) -> Tensor:
        """(bags, C) of rows (R, C)."""
        few, more = _gathered(values, self.rows, self.weights), _gathered(values, self.more_rows, self.more_weights)
        return few + torch.cat([few.new_zeros(1, few.shape[1]), more]).index_select(0, self.place)


def _gathered(values: Tensor, rows: Tensor, weights: Tensor) -> Tensor:
    total = values.new_zeros(rows.shape[1], values.shape[1])
    for row, weight in zip(rows, weights, strict=True):
        total = total + values.index_select(0, row) * weight
    return total


@dataclass(frozen=True, eq=False)
class PullPlan:
    """Where the cells of a batch read; rows are the places (camera, row, column) of the features of all its cameras.

    Attributes:
        read: a bag for every (sample, cell, height) with its rows: bilinear, mean over the cameras that see it.
        spread: the same the other way round, a bag for every row: how gradients go back.
        count: (B, 1, X, Y) float32, how many cameras see a cell's centre on the ground.
        cameras: of each sample.
        heights: of a cell.
        slots: the same as `read` by gathers and sums alone, for export.
    """

    read: Table
    spread: Table
    count: Tensor
    cameras: tuple[int, ...]
    heights: int
    slots: Slots | None = None

    @property
    def seen(self) -> Tensor:
        """(B, X, Y) bool, cells whose ground a camera sees."""
        return self.count[:, 0] > 0

    def to(self, device: torch.device) -> PullPlan:
        """The same on a device."""
        slots = None if self.slots is None else self.slots.to(device)
        count = self.count.to(device, non_blocking=True)
        return replace(self, read=self.read.to(device), spread=self.spread.to(device), count=count, slots=slots)

    def for_export(self) -> PullPlan:
        """The plan with `slots`."""
        ends = torch.cat([self.read.offsets[1:], self.read.offsets.new_tensor([len(self.read.rows)])])
        length = (ends - self.read.offsets).long()
        more = length > _FEW
        # Without a camera there is not even a row 0 to stand in.
        slot = torch.arange(max(int(length.max()), _FEW) if len(self.read.rows) else 0)[:, None]  # S 1
        used = slot < length
        entry = torch.where(used, self.read.offsets + slot, 0)
        rows = torch.where(used, self.read.rows[entry].long(), 0)
        weights = torch.where(used, self.read.weights[entry], 0.0)[..., None]
        place = torch.where(more, more.cumsum(0), 0)
        slots = Slots(rows[:_FEW], weights[:_FEW], rows[_FEW:, more], weights[_FEW:, more], place)
        return replace(self, slots=slots)


class _Pull(torch.autograd.Function):
    """Sums of rows whose gradient is a sum of rows too: 20 times faster than embedding_bag's own on a CPU."""

    @staticmethod
    def forward(ctx: Any, rows: Tensor, read: Table, spread: Table) -> Tensor:
        """(bags, C) of rows (R, C)."""
        ctx.spread = spread
        return read.sum_of(rows)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:
        """(R, C) of (bags, C)."""
        return ctx.spread.sum_of(gradients[0].contiguous()), None, None


def pull(features: Tensor, plan: PullPlan) -> Tensor:
    """What the cells read of features.

    Args:
        features: (V, h, w, C) of all cameras of the batch, sample after sample.
        plan: made for features of this size.

    Returns:
        (B, heights * C, X, Y) float32, in memory as channels last; 0 where no camera sees a place.

    Raises:
        ShapeError: if the features are not those the plan was made for.
    """
    rows = features.flatten(0, 2).float()  # R C
    if len(rows) != len(plan.spread.offsets):
        raise ShapeError(f"features: expected {len(plan.spread.offsets)} places, as planned, got {len(rows)}")
    if plan.slots is not None:
        bags = plan.slots.sum_of(rows)
    elif rows.requires_grad:
        bags = _Pull.apply(rows, plan.read, plan.spread)  # type: ignore[no-untyped-call]
    else:
        bags = plan.read.sum_of(rows)
    batch, _, x, y = plan.count.shape
    return bags.reshape(batch, x, y, plan.heights * rows.shape[1]).permute(0, 3, 1, 2)


def plan_pull(
    rigs: Sequence[CameraRig], grid: BEVGrid, heights_m: Sequence[float], h: int, w: int, stride: int
) -> PullPlan:
    """The plan of a batch.

    Args:
        rigs: of each sample, cameras of the pictures as the network is given them.
        grid: whose cells read.
        heights_m: above the ground at which a cell's centre reads, ego frame.
        h: rows of the features.
        w: columns of them.
        stride: pixels between features; feature i looks at pixel i * stride.

    Raises:
        ShapeError: if there is no rig or no height, or a camera's picture does not make features of this size.
    """
    if not rigs or not heights_m:
        raise ShapeError(f"plan: expected rigs and heights, got {len(rigs)} and {len(heights_m)}")
    for camera in (camera for rig in rigs for camera in rig):
        wanted = -(-camera.height_px // stride), -(-camera.width_px // stride)
        if wanted != (h, w):
            raise ShapeError(f"{camera.channel}: expected features of {wanted} at stride {stride}, got {(h, w)}")
    heights = tuple(map(float, heights_m))
    plans = [_plan_of_rig(_key(rig), grid, heights, h, w, stride) for rig in rigs]
    rows = [len(plan.spread.offsets) for plan in plans]
    bags = [len(plan.read.offsets) for plan in plans]
    return PullPlan(
        _joined([plan.read for plan in plans], rows),
        _joined([plan.spread for plan in plans], bags),
        torch.cat([plan.count for plan in plans]),
        tuple(map(len, rigs)),
        len(heights),
    )


def _joined(tables: list[Table], rows: list[int]) -> Table:
    """Tables one after another; `rows` are those that each speaks of."""
    if len(tables) == 1:
        return tables[0]
    row_starts = accumulate(rows[:-1], initial=0)
    starts = accumulate((len(table.rows) for table in tables[:-1]), initial=0)
    return Table(
        torch.cat([table.rows + start for table, start in zip(tables, row_starts, strict=True)]),
        torch.cat([table.offsets + start for table, start in zip(tables, starts, strict=True)]),
        torch.cat([table.weights for table in tables]),
    )


class _Lens(NamedTuple):
    """What of a camera matters to a plan, in a form that can be compared."""

    width_px: int
    height_px: int
    pixel_from_ego: bytes


def _key(rig: CameraRig) -> tuple[_Lens, ...]:
    return tuple(_Lens(each.width_px, each.height_px, _pixel_from_ego(each).tobytes()) for each in rig)


def _pixel_from_ego(camera: Camera) -> NDArray[np.float64]:
    """(3, 4) matrix from ego metres to (u * depth, v * depth, depth)."""
    return np.asarray(camera.intrinsic @ inverse(camera.ego_from_cam)[:3])


@lru_cache(maxsize=_KEPT_PLANS)
def _plan_of_rig(
    lenses: tuple[_Lens, ...], grid: BEVGrid, heights_m: tuple[float, ...], h: int, w: int, stride: int
) -> PullPlan:
    """The plan of one sample; its tensors are shared between those who ask, nobody writes into them."""
    bags, rows = grid.shape[0] * grid.shape[1] * len(heights_m), len(lenses) * h * w
    views = [_seen_by(lens, grid, heights_m) for lens in lenses] or [
        (np.zeros(0, np.int64), np.zeros((2, 0), np.float32))
    ]
    bag = np.concatenate([bag for bag, _ in views])
    count = np.bincount(bag, minlength=bags)
    places = np.concatenate([uv_px for _, uv_px in views], axis=1)
    corner, share = _corners(np.divide(places, stride, dtype=np.float32), h, w)
    corner += np.repeat(np.arange(len(views)) * h * w, [len(bag) for bag, _ in views])[:, None]
    order = np.argsort(bag, kind="stable")  # a merge of sorted runs, one a camera
    index = corner.take(order, axis=0).ravel()
    weights = (share / count[bag][:, None].astype(np.float32)).take(order, axis=0).ravel()
    offsets = np.concatenate([[0], np.cumsum(4 * count)]).astype(np.int32)
    back = sparse.csr_matrix((weights, index, offsets), shape=(bags, rows)).tocsc()
    on_ground = count.reshape(*grid.shape, -1)[..., np.argmin(np.abs(heights_m))]
    return PullPlan(
        _table(index, offsets, weights),
        _table(back.indices, back.indptr, back.data),
        torch.from_numpy(on_ground.astype(np.float32))[None, None],
        (len(lenses),),
        len(heights_m),
    )


def _table(index: NDArray[Any], offsets: NDArray[Any], weights: NDArray[Any]) -> Table:
    return Table(
        torch.from_numpy(index.astype(np.int32)),
        torch.from_numpy(offsets[:-1].astype(np.int32)),
        torch.from_numpy(weights.astype(np.float32)),
    )


def _seen_by(lens: _Lens, grid: BEVGrid, heights_m: tuple[float, ...]) -> tuple[NDArray[np.int64], Float32Array]:
    """Bags (n,) = (cell, height) whose place a camera sees, and the pixels (2, n) at which it does."""
    matrix = np.frombuffer(lens.pixel_from_ego).reshape(3, 4)
    x_m, y_m = (grid.centre_of(np.stack([np.arange(n)] * 2, axis=-1))[:, i] for i, n in enumerate(grid.shape))
    along, across, up = (
        matrix[:, :1] * x_m,
        matrix[:, 1:2] * y_m,
        matrix[:, 2:3] * np.array(heights_m) + matrix[:, 3:],
    )
    u, v, depth = ((a[:, None, None] + b[:, None] + c).ravel() for a, b, c in zip(along, across, up, strict=True))
    # Compared before the division, which few places are worth.
    inside = depth > _NEAREST_M
    for side, size in ((u, lens.width_px), (v, lens.height_px)):
        inside &= (side >= -0.5 * depth) & (side < (size - 0.5) * depth)
    bag = np.flatnonzero(inside)
    return bag, (np.stack([u[bag], v[bag]]) / depth[bag]).astype(np.float32)


def _corners(uv: Float32Array, h: int, w: int) -> tuple[NDArray[np.int32], Float32Array]:
    """Rows (n, 4) and weights (n, 4) of bilinear reading at feature coordinates (2, n); edges reach outward."""
    u, v = np.clip(uv[0], 0, w - 1), np.clip(uv[1], 0, h - 1)
    left, top = np.minimum(u.astype(np.int32), max(w - 2, 0)), np.minimum(v.astype(np.int32), max(h - 2, 0))
    du, dv = u - left, v - top
    right, below = int(w > 1), w * int(h > 1)
    first = top * w + left
    corner = np.stack([first, first + right, first + below, first + below + right], axis=-1)
    share = np.stack([(1 - du) * (1 - dv), du * (1 - dv), (1 - du) * dv, du * dv], axis=-1)
    return corner, share.astype(np.float32)
