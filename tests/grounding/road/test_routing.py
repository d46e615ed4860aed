from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import BoolArray
from appocc.grid import BEVGrid
from grounding.road.routing import ShortestPaths, find_shortest_paths

GRID = BEVGrid(-10.0, 10.0, -10.0, 10.0, 0.5)
START = GRID.cell_of([-8.0, 0.0])


def paths(free: BoolArray, start: tuple[int, int] | None = (4, 20)) -> ShortestPaths:
    return find_shortest_paths(GRID, free, np.zeros(GRID.shape), start)


def everywhere() -> BoolArray:
    return np.ones(GRID.shape, np.bool_)


def test_path_lengths_straight_and_diagonal() -> None:
    length = paths(everywhere()).length_m
    assert length[4, 20] == 0
    assert length[14, 20] == pytest.approx(5)
    assert length[8, 24] == pytest.approx(4 * 0.5 * np.sqrt(2))
    assert length[14, 24] == pytest.approx(0.5 * (6 + 4 * np.sqrt(2)))
    assert np.isfinite(length).all()


def test_paths_go_around_walls_and_not_through_them() -> None:
    free = everywhere()
    free[20, 5:] = False
    made = paths(free)
    assert made.length_m[24, 20] > 2 * made.length_m[19, 20]
    assert not np.isfinite(made.length_m[20, 20])
    free[20] = False
    assert not np.isfinite(paths(free).length_m[21:]).any()


def test_paths_avoid_costly_cells_if_the_detour_is_short() -> None:
    extra_cost = np.zeros(GRID.shape)
    extra_cost[20, 18:23] = 5
    chain = find_shortest_paths(GRID, everywhere(), extra_cost, (4, 20)).cells_to((36, 20))
    assert not np.isin(chain[chain[:, 0] == 20][:, 1], np.arange(18, 23)).any()


def test_without_a_start_no_cell_is_reachable() -> None:
    made = paths(everywhere(), None)
    assert not np.isfinite(made.length_m).any()
    assert len(made.cells) == 0


def test_a_path_visits_neighbouring_cells() -> None:
    chain = paths(everywhere()).cells_to((30, 7))
    assert chain[0].tolist() == [4, 20]
    assert chain[-1].tolist() == [30, 7]
    assert np.abs(np.diff(chain, axis=0)).max() == 1


def test_ancestors() -> None:
    made = paths(everywhere())
    at = int(np.searchsorted(made.cells, np.ravel_multi_index((14, 20), GRID.shape)))
    assert np.unravel_index(made.cells[made.ancestors(8)[at]], GRID.shape) == (6, 20)
    assert np.unravel_index(made.cells[made.ancestors(16)[at]], GRID.shape) == (4, 20)


@pytest.mark.parametrize("cell", [(14, 20), (34, 20)])
def test_a_costly_goal_is_reached_from_any_side(cell: tuple[int, int]) -> None:
    extra_cost = np.zeros(GRID.shape)
    extra_cost[cell] = 100
    made = find_shortest_paths(GRID, everywhere(), extra_cost, (24, 20))
    assert made.length_m[cell] == pytest.approx(5)
