"""Shortest paths of the ego over free cells, and smooth routes along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.grid import BEVGrid
from appocc.polylines import arc_m, points_at

_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
# Spacing of route points, and length at both ends that follows the heading there.
_POINT_M, _LEAD_M = 0.8, 2.4
# Smoothing: stiffness, weight of fixed points, factor on the weight of points that leave the free cells, and tries.
_STIFFNESS, _FIXED, _HOLD, _TRIES = 300.0, 1e7, 30.0, 6


@dataclass(frozen=True, eq=False)
class ShortestPaths:
    """Shortest paths from one cell to the N cells that can be reached, itself included.

    Attributes:
        grid: cells.
        free: (X, Y) cells where the ego's centre may be.
        cells: (N,) flat indices of the reached cells, ascending.
        previous: (N,) index into `cells` of the predecessor; the start is its own predecessor.
        length_m: (X, Y) path length, infinity where there is no path.
    """

    grid: BEVGrid
    free: BoolArray
    cells: IntArray
    previous: IntArray
    length_m: FloatArray

    def ancestors(self, steps: int) -> IntArray:
        """Return the predecessor (N,) a power of two steps back, or the start if that is nearer."""
        back = self.previous
        while steps > 1:
            back, steps = back[back], steps // 2
        return back

    def cells_to(self, cell: tuple[int, int]) -> IntArray:
        """Return the cells (K, 2) of the path from the start to a reached cell."""
        at = int(np.searchsorted(self.cells, np.ravel_multi_index(cell, self.grid.shape)))
        chain = [at]
        while self.previous[at] != at:
            at = int(self.previous[at])
            chain.append(at)
        return np.stack(np.unravel_index(self.cells[chain[::-1]], self.grid.shape), axis=-1)

    def route_to(self, cell: tuple[int, int], start_m: FloatArray, heading_rad: float) -> FloatArray:
        """Return a smooth route (K, 2), ego frame, to a reached cell and a heading.

        The route starts at a point (2,) near the start cell, heading along x. Both headings are kept where there is
        room.
        """
        points = self.grid.centre_of(self.cells_to(cell))
        if len(points) > 1 and np.hypot(*(points[0] - start_m)) < self.grid.cell_m:
            points = points[1:]  # the start is in that cell
        return self._smooth(np.concatenate([start_m[None], points]), heading_rad)

    def _smooth(self, steps: FloatArray, heading_rad: float) -> FloatArray:
        """Return a smooth line (K, 2) along steps from cell to cell that stays on free cells."""
        length_m = float(arc_m(steps)[-1])
        count = int(length_m / _POINT_M) + 2
        points = points_at(steps, np.linspace(0, length_m, count))
        fixed = np.zeros(count, np.bool_)
        fixed[[0, -1]] = True
        lead = np.arange(0, _LEAD_M, _POINT_M)[:, None]
        ahead = points[0] + lead * [1.0, 0.0]
        behind = points[-1] - lead[::-1] * [np.cos(heading_rad), np.sin(heading_rad)]
        size = len(lead)
        # Without room, or if the route reverses, its ends turn as the cells do.
        if count >= 3 * size:
            if self._is_free(ahead).all() and points[size, 0] > points[0, 0]:
                points[:size], fixed[:size] = ahead, True
            if self._is_free(behind).all() and (points[-1] - points[-1 - size]) @ (behind[-1] - behind[0]) > 0:
                points[-size:], fixed[-size:] = behind, True
        return self._fit(points, fixed)

    def _fit(self, points: FloatArray, fixed: BoolArray) -> FloatArray:
        """Return a line through fixed points and near the others (K, 2), closer where it leaves free cells."""
        weights = np.where(fixed, _FIXED, 1.0)
        may_leave = ~self._is_free(points)
        bends = np.diff(np.eye(len(points)), 2, axis=0)
        for _ in range(_TRIES):
            line = np.linalg.solve(np.diag(weights) + _STIFFNESS * bends.T @ bends, weights[:, None] * points)
            stuck = ~self._is_free(line) & ~may_leave
            if not stuck.any():
                line[fixed] = points[fixed]
                return np.asarray(line)
            weights[stuck] *= _HOLD
        return points

    def _is_free(self, points: NDArray[np.floating]) -> BoolArray:
        """(K,) whether points (K, 2) are in free cells."""
        cells = self.grid.cell_of(points)
        inside = self.grid.contains(cells)
        i, j = np.where(inside[:, None], cells, 0).T
        return np.asarray(inside & self.free[i, j])


def find_shortest_paths(
    grid: BEVGrid, free: BoolArray, extra_cost: FloatArray, start: tuple[int, int] | None
) -> ShortestPaths:
    """Return the shortest paths from a free cell (None if there is none) over free cells, in eight directions.

    Args:
        grid: cells.
        free: (X, Y) cells where the ego's centre may be.
        extra_cost: (X, Y) cost of a metre in a cell, beyond one, when paths are compared.
        start: cell.
    """
    length_m = np.full(grid.shape, np.inf)
    if start is None:
        none = np.zeros(0, np.int64)
        return ShortestPaths(grid, free, none, none, length_m)
    cells = np.flatnonzero(free)
    number = np.cumsum(free).reshape(grid.shape) - 1  # the graph holds free cells only, which is faster
    rows, columns, costs = [], [], []
    for step in _STEPS:
        here, there = _neighbours(step)
        both = free[here] & free[there]
        cost = grid.cell_m * np.hypot(*step) * (1 + (extra_cost[here][both] + extra_cost[there][both]) / 2)
        rows += [number[here][both], number[there][both]]
        columns += [number[there][both], number[here][both]]
        costs += [cost, cost]
    size = len(cells)
    graph = csr_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))
    first = int(number[start])
    cost, found = dijkstra(graph, directed=True, indices=np.array(first), return_predecessors=True)
    reached = np.flatnonzero(np.isfinite(cost))
    found[first] = first
    previous = np.searchsorted(reached, found[reached])
    length_m.ravel()[cells[reached]] = _path_lengths_m(grid, cells[reached], previous)
    return ShortestPaths(grid, free, cells[reached], previous, length_m)


def _neighbours(step: tuple[int, int]) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return slices of all cells that have a neighbour one step away, and of those neighbours."""
    i, j = step
    rest = slice(None, -1)
    if j < 0:
        return (rest, slice(1, None)), (slice(1, None), rest)
    here = (rest if i else slice(None), rest if j else slice(None))
    return here, (slice(i, None), slice(j, None))


def _path_lengths_m(grid: BEVGrid, cells: IntArray, previous: IntArray) -> FloatArray:
    """Return lengths (N,) along the chains of predecessors, by pointer doubling."""
    i, j = np.unravel_index(cells, grid.shape)
    total = grid.cell_m * np.hypot(i - i[previous], j - j[previous])
    back = previous
    while (total[back] > 0).any():
        total, back = total + total[back], back[back]
    return np.asarray(total)
