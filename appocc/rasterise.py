"""Rasterisation: the exact share of every grid cell that a polygon covers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from appocc.boxes import Boxes
from appocc.checks import FloatArray, IntArray, check_finite, check_shape
from appocc.grid import BEVGrid
from appocc.typing import Cover, List2

# Minimum covered share of a cell of each class.
ROAD_SHARE = VEHICLE_SHARE = 0.5
LANE_SHARE = 0.2
# Tolerance for sides that run through the middle of cells and cover half of each.
ROUNDING = 1e-9
# Number of cells whose covers are computed at once.
_CELLS_AT_ONCE = 200_000


def polygon_cover(grid: BEVGrid, polygon_xy_m: FloatArray) -> Cover:
    """Return the share (X, Y), in [0, 1], of each cell inside a simple polygon (K, 2), ego metres; exact.

    Every edge is cut where it crosses a grid line. Each piece adds its signed area to the cells on one side of it, as
    in font rasterisers; the cumulative sum over a row of cells is the cover.

    Raises:
        ShapeError: if the polygon is not (K, 2) or not finite.
    """
    check_shape("polygon", polygon_xy_m, (None, 2))
    check_finite("polygon", polygon_xy_m)
    x, y = grid.shape
    corners = (polygon_xy_m - [grid.x_min_m, grid.y_min_m]) / grid.cell_m
    if len(corners) < 3 or (corners.max(axis=0) <= 0).any() or (corners.min(axis=0) >= [x, y]).any():
        return np.zeros((x, y))
    return np.asarray(_covers(corners[None], x, y)[0])


def _covers(corners: FloatArray, x: int, y: int) -> FloatArray:
    """Return the covers (N, x, y) of polygons (N, K, 2), in cells of a grid."""
    n, k = corners.shape[:2]
    pieces = _cut(corners.reshape(-1, 2), np.roll(corners, -1, axis=1).reshape(-1, 2), x, y)
    run = np.diff(pieces[..., 0], axis=1)
    first_row = np.broadcast_to(np.repeat(np.arange(n) * x, k)[:, None], run.shape).ravel()
    run, middle = run.ravel(), ((pieces[:, 1:] + pieces[:, :-1]) / 2).reshape(-1, 2)
    inside = (middle[:, 0] >= 0) & (middle[:, 0] < x) & (middle[:, 1] < y) & (run != 0)
    run, middle = run[inside], middle[inside]
    row = first_row[inside] + middle[:, 0].astype(np.int64)
    side = np.maximum(middle[:, 1], 0.0)  # parts before the grid cover the whole row
    column = side.astype(np.int64)
    beyond = side - column
    size, place = n * x * (y + 1), row * (y + 1) + column
    signed = np.bincount(place, run * (1 - beyond), size) + np.bincount(place + 1, run * beyond, size + 1)[:size]
    return np.asarray(np.clip(np.abs(np.cumsum(signed.reshape(n, x, y + 1), axis=2)[..., :y]), 0.0, 1.0))


def polygon_owner(grid: BEVGrid, outlines_m: FloatArray, least: float) -> IntArray:
    """Return the index (X, Y) of the polygon with the largest cover of each cell; -1 if below the share `least`.

    Args:
        grid: cells.
        outlines_m: (N, K, 2) simple polygons, ego frame; the first one wins ties.
        least: minimum share, up to rounding.

    Raises:
        ShapeError: if the outlines are not (N, K, 2) or not finite.
    """
    check_shape("outlines", outlines_m, (None, None, 2))
    check_finite("outlines", outlines_m)
    best = np.full(grid.shape, least - ROUNDING)
    owner = np.full(grid.shape, -1, dtype=np.int64)
    for i, box, cover in _covered_boxes(grid, outlines_m):
        more = cover > best[box]
        best[box][more], owner[box][more] = cover[more], i
    return owner


def _covered_boxes(grid: BEVGrid, outlines_m: FloatArray) -> Iterator[tuple[int, tuple[slice, slice], FloatArray]]:
    """Yield index, bounding box in cells, and cover of the cells in it, of the polygons (N, K, 2) on a grid."""
    corners = (outlines_m - [grid.x_min_m, grid.y_min_m]) / grid.cell_m
    lows = np.clip(np.floor(corners.min(axis=1)), 0, grid.shape).astype(np.int64)
    highs = np.clip(np.floor(corners.max(axis=1)) + 1, 0, grid.shape).astype(np.int64)
    on_grid = np.flatnonzero((lows < highs).all(axis=1))
    if not len(on_grid):
        return
    x, y = (highs - lows)[on_grid].max(axis=0).tolist()
    together = max(1, _CELLS_AT_ONCE // (x * y))
    for some in np.split(on_grid, range(together, len(on_grid), together)):
        for i, cover in zip(some.tolist(), _covers(corners[some] - lows[some, None], x, y), strict=True):
            (x0, y0), (x1, y1) = lows[i].tolist(), highs[i].tolist()
            yield i, (slice(x0, x1), slice(y0, y1)), cover[: x1 - x0, : y1 - y0]


def vehicle_owner(grid: BEVGrid, boxes_ego: Boxes) -> IntArray:
    """(X, Y) index of the box that covers most of a cell, at least half of it; -1 where none does."""
    return polygon_owner(grid, boxes_ego.corners()[:, :4, :2], VEHICLE_SHARE)


def _cut(start: FloatArray, end: FloatArray, x: int, y: int) -> FloatArray:
    """Return points (K, cuts, 2) along each edge: its ends and its crossings with the lines of an x by y grid."""
    step = end - start
    shares = [np.zeros((len(start), 1)), np.ones((len(start), 1))]
    for axis, size in ((0, x), (1, y)):
        low = int(np.clip(np.floor(start[:, axis].min()), 0, size))
        high = int(np.clip(np.ceil(start[:, axis].max()), 0, size))
        lines = np.arange(low, high + 1, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            share = (lines - start[:, axis, None]) / step[:, axis, None]
        shares.append(np.clip(np.nan_to_num(share, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0))
    t = np.sort(np.concatenate(shares, axis=1), axis=1)
    return np.asarray(start[:, None] + t[..., None] * step[:, None])


def line_cover(grid: BEVGrid, line_xy_m: List2, width_m: float) -> Cover:
    """Return the share (X, Y) of each cell under a polyline (K, 2) with a width; segments add up, to 1 at most."""
    check_shape("line", line_xy_m, (None, 2))
    check_finite("line", line_xy_m)
    step = np.diff(line_xy_m, axis=0)
    length = np.hypot(*step.T)
    start, step, length = line_xy_m[:-1][length > 0], step[length > 0], length[length > 0, None]
    across = np.stack([-step[:, 1], step[:, 0]], axis=1) / length * (width_m / 2)
    outlines_m = np.stack([start + across, start + step + across, start + step - across, start - across], axis=1)
    total = np.zeros(grid.shape)
    for _, box, cover in _covered_boxes(grid, outlines_m):
        total[box] += cover
    return np.minimum(total, 1.0)
