"""Shortest paths of a point over free cells: which roads lead where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.grid import BEVGrid

_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


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
