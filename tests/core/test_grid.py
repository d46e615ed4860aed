"""The grid: which cell a point falls into, and where a cell lies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appocc.errors import ShapeError
from appocc.grid import BEVGrid


def test_the_two_grids_of_the_paper() -> None:
    assert BEVGrid.surround().shape == (200, 200)
    assert BEVGrid.front().shape == (100, 200)
    np.testing.assert_array_equal(BEVGrid.front().as_array(), [0, 40, -40, 40, 0.4])


@pytest.mark.parametrize(
    ("xy", "cell"),
    [
        ((-40.0, -40.0), (0, 0)),
        ((-39.61, -39.59), (0, 1)),
        ((0.0, 0.0), (100, 100)),
        ((1.2, -0.1), (103, 99)),
        ((39.99, 40.0), (199, 200)),
        ((-40.01, 0.4), (-1, 101)),
    ],
)
def test_index_by_floor(xy: tuple[float, float], cell: tuple[int, int]) -> None:
    assert tuple(BEVGrid.surround().cell_of(xy)) == cell


@given(st.integers(-300, 300), st.integers(-300, 300), st.floats(0.02, 0.98), st.floats(0.02, 0.98))
def test_points_anywhere_in_a_cell_fall_into_it(i: int, j: int, u: float, v: float) -> None:
    grid = BEVGrid.surround()
    corner = grid.centre_of([i, j]) - grid.cell_m / 2
    np.testing.assert_array_equal(grid.cell_of(corner + np.array([u, v]) * grid.cell_m), [i, j])
    np.testing.assert_array_equal(grid.cell_of(corner), [i, j])


def test_centres_are_those_of_the_cells() -> None:
    grid = BEVGrid.front()
    centres = grid.centres()
    assert centres.shape == (100, 200, 2)
    np.testing.assert_allclose(centres[0, 0], [0.2, -39.8])
    np.testing.assert_allclose(centres[99, 0], [39.8, -39.8])
    np.testing.assert_array_equal(grid.cell_of(centres)[..., 1], np.tile(np.arange(200), (100, 1)))


def test_halved_covers_the_same_cells_and_no_less() -> None:
    assert BEVGrid.surround().halved() == BEVGrid(cell_m=0.8)
    odd = BEVGrid(0.0, 1.2, -0.4, 0.4, 0.4).halved()
    assert odd.shape == (2, 1)
    assert odd.centre_of([0, 0]).tolist() == pytest.approx([0.4, 0.0])


def test_contains_looks_at_both_axes() -> None:
    cells = [[0, 0], [99, 199], [100, 0], [0, 200], [-1, 5], [5, -1]]
    assert BEVGrid.front().contains(cells).tolist() == [True, True, False, False, False, False]


@given(st.integers(1, 400), st.integers(1, 400), st.floats(-100, 100), st.floats(0.05, 2))
def test_stored_and_read_back(x: int, y: int, low: float, cell: float) -> None:
    grid = BEVGrid(low, low + x * cell, low, low + y * cell, cell)
    assert grid.shape == (x, y)
    assert BEVGrid.from_array(grid.as_array()) == grid


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ([0, 1, 0, 1], r"expected shape \(5\), got \(4,\)"),
        ([0, np.nan, 0, 1, 0.5], "finite"),
        ([0, 1, 0, 1, 0.0], "positive cell size, got 0"),
        ([0, 1, 0, 1, -0.5], "positive cell size, got -0.5"),
        ([0, 1, 0, 1.1, 0.5], r"grid y: expected a whole number of 0.5 m cells, got 0.0..1.1"),
        ([1, 0, 0, 1, 0.5], r"grid x: expected a whole number of 0.5 m cells, got 1.0..0.0"),
    ],
)
def test_what_is_no_grid(values: list[float], reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        BEVGrid.from_array(values)
