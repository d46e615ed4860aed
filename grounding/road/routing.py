"""Ways of a body of the ego's width over free cells: how long they are, where they lead, and the line to draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.grid import BEVGrid

_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
# The line to draw: points so far apart, and so much at either end follows the heading there; how stiff it is, how
# fast a point is held that stays where it is, and how much more in each try that leaves the free cells.
_POINT_M, _LEAD_M = 0.8, 2.4
_STIFF, _FIXED, _HOLD, _TRIES = 300.0, 1e7, 30.0, 6


@dataclass(frozen=True)
class Ways:
    """The best ways from one cell to N cells that can be reached, itself included.

    Attributes:
        grid: cells.
        free: (X, Y) where the middle of the body may be.
        cells: (N,) flat numbers of the cells, rising.
        previous: (N,) which of them comes before on the way; the start's own is the start.
        length_m: (X, Y) metres to go, infinity where no way leads.
    """

    grid: BEVGrid
    free: BoolArray
    cells: IntArray
    previous: IntArray
    length_m: FloatArray

    def before(self, steps: int) -> IntArray:
        """(N,) which cell lies so many steps (a power of two) before on the way; the start where it is nearer."""
        back = self.previous
        while steps > 1:
            back, steps = back[back], steps // 2
        return back

    def chain(self, cell: tuple[int, int]) -> IntArray:
        """(K, 2) cells from the start to one that can be reached."""
        at = int(np.searchsorted(self.cells, np.ravel_multi_index(cell, self.grid.shape)))
        chain = [at]
        while self.previous[at] != at:
            at = int(self.previous[at])
            chain.append(at)
        return np.stack(np.unravel_index(self.cells[chain[::-1]], self.grid.shape), axis=-1)

    def route(self, cell: tuple[int, int], start_m: FloatArray, heading_rad: float) -> FloatArray:
        """The way to a cell that can be reached, from a point (2,) beside the start, heading along x.

        Returns (K, 2) points, ego frame, on a smooth line that ends in the heading where there is room for it.
        """
        points = self.grid.centre_of(self.chain(cell))
        if len(points) > 1 and np.hypot(*(points[0] - start_m)) < self.grid.cell_m:
            points = points[1:]  # The ego stands in that cell.
        return self._smooth(np.concatenate([start_m[None], points]), heading_rad)

    def _smooth(self, steps: FloatArray, heading_rad: float) -> FloatArray:
        """Points (K, 2) along steps from cell to cell, laid so that the line bends little and stays on free cells."""
        gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(steps, axis=0).T))])
        count = int(gone[-1] / _POINT_M) + 2
        points = np.stack([np.interp(np.linspace(0, gone[-1], count), gone, axis) for axis in steps.T], axis=-1)
        fixed = np.zeros(count, np.bool_)
        fixed[[0, -1]] = True
        lead = np.arange(0, _LEAD_M, _POINT_M)[:, None]
        ahead = points[0] + lead * [1.0, 0.0]
        behind = points[-1] - lead[::-1] * [np.cos(heading_rad), np.sin(heading_rad)]
        size = len(lead)
        # Who has to reverse, or has no room, turns as the cells say.
        if count >= 3 * size:
            if self._open(ahead).all() and points[size, 0] > points[0, 0]:
                points[:size], fixed[:size] = ahead, True
            if self._open(behind).all() and (points[-1] - points[-1 - size]) @ (behind[-1] - behind[0]) > 0:
                points[-size:], fixed[-size:] = behind, True
        return self._laid(points, fixed)

    def _laid(self, points: FloatArray, fixed: BoolArray) -> FloatArray:
        """The smooth line near points (K, 2): nearest where it would leave the free cells, and through fixed ones."""
        held = np.where(fixed, _FIXED, 1.0)
        may_leave = ~self._open(points)
        bends = np.diff(np.eye(len(points)), 2, axis=0)
        for _ in range(_TRIES):
            line = np.linalg.solve(np.diag(held) + _STIFF * bends.T @ bends, held[:, None] * points)
            stuck = ~self._open(line) & ~may_leave
            if not stuck.any():
                line[fixed] = points[fixed]
                return np.asarray(line)
            held[stuck] *= _HOLD
        return points

    def _open(self, points: NDArray[np.floating]) -> BoolArray:
        """Whether points (K, 2) lie in free cells."""
        cells = self.grid.cell_of(points)
        inside = self.grid.contains(cells)
        i, j = np.where(inside[:, None], cells, 0).T
        return np.asarray(inside & self.free[i, j])


def ways_from(grid: BEVGrid, free: BoolArray, dislike: FloatArray, start: tuple[int, int] | None) -> Ways:
    """Best ways from a free cell (None: there is none) over free cells, in eight directions.

    Args:
        grid: cells.
        free: (X, Y) where the middle of the body may be.
        dislike: (X, Y) how much more a metre there counts than one, when ways are compared.
        start: cell.
    """
    length_m = np.full(grid.shape, np.inf)
    if start is None:
        none = np.zeros(0, np.int64)
        return Ways(grid, free, none, none, length_m)
    cells = np.flatnonzero(free)
    number = np.cumsum(free).reshape(grid.shape) - 1  # of free cells only: the fewer, the faster
    rows, columns, costs = [], [], []
    for step in _STEPS:
        here, there = _pair(step)
        both = free[here] & free[there]
        cost = grid.cell_m * np.hypot(*step) * (1 + (dislike[here][both] + dislike[there][both]) / 2)
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
    length_m.ravel()[cells[reached]] = _lengths(grid, cells[reached], previous)
    return Ways(grid, free, cells[reached], previous, length_m)


def _pair(step: tuple[int, int]) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Slices of all cells that have a neighbour a step further, and of those neighbours."""
    i, j = step
    rest = slice(None, -1)
    if j < 0:
        return (rest, slice(1, None)), (slice(1, None), rest)
    here = (rest if i else slice(None), rest if j else slice(None))
    return here, (slice(i, None), slice(j, None))


def _lengths(grid: BEVGrid, cells: IntArray, previous: IntArray) -> FloatArray:
    """Metres along the chain of previous cells: each round doubles the part that is added up."""
    i, j = np.unravel_index(cells, grid.shape)
    total = grid.cell_m * np.hypot(i - i[previous], j - j[previous])
    back = previous
    while (total[back] > 0).any():
        total, back = total + total[back], back[back]
    return np.asarray(total)
