from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.path import Path as Outline

from appocc.checks import FloatArray
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from appocc.rasterise import line_cover, polygon_cover, polygon_owner

GRID = BEVGrid(-4.0, 4.0, -2.0, 4.0, 0.4)
CELL_M2 = GRID.cell_m**2
FINE = 40


def sampled(polygon: FloatArray) -> FloatArray:
    """The cover by 40 x 40 places a cell, classified by other code."""
    x, y = GRID.shape
    step = GRID.cell_m / FINE
    xs = GRID.x_min_m + (np.arange(x * FINE) + 0.5) * step
    ys = GRID.y_min_m + (np.arange(y * FINE) + 0.5) * step
    places = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = Outline(np.vstack([polygon, polygon[:1]])).contains_points(places).reshape(x, FINE, y, FINE)
    return np.asarray(inside.mean(axis=(1, 3)))


def area(polygon: FloatArray) -> float:
    """Shoelace area."""
    x, y = polygon.T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)


def clipped_area(polygon: FloatArray) -> float:
    """Area of the part inside the grid, by Sutherland and Hodgman's clipping."""
    points = [tuple(p) for p in polygon]
    bounds = ((0, GRID.x_min_m, 1), (0, GRID.x_max_m, -1), (1, GRID.y_min_m, 1), (1, GRID.y_max_m, -1))
    for axis, bound, side in bounds:
        kept: list[tuple[float, ...]] = []
        for a, b in zip(points, [*points[1:], *points[:1]], strict=True):
            a_in, b_in = side * (a[axis] - bound) >= 0, side * (b[axis] - bound) >= 0
            if a_in:
                kept.append(a)
            if a_in != b_in:
                t = (bound - a[axis]) / (b[axis] - a[axis])
                kept.append((a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])))
        points = kept
        if not points:
            return 0.0
    return area(np.array(points))


def rectangle(x: float, y: float, length: float, width: float, yaw: float) -> FloatArray:
    local = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return np.asarray(local @ turn.T + [x, y])


def star(x: float, y: float, radii: list[float], turn: float) -> FloatArray:
    """A simple polygon around a centre, mostly not convex."""
    angle = turn + np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    radius = np.array(radii)
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


SHAPES = {
    "car": rectangle(1.0, 0.5, 4.5, 1.9, 0.3),
    "along the grid": rectangle(0.0, 0.0, 2.0, 1.2, 0.0),
    "across": rectangle(0.1, 0.2, 2.0, 1.2, math.pi / 4),
    "triangle": np.array([[-3.0, -1.5], [3.1, 0.2], [-1.0, 3.7]]),
    "smaller than a cell": rectangle(0.13, 0.21, 0.1, 0.07, 0.5),
    "sliver": np.array([[-3.9, -1.9], [3.9, 3.9], [3.9, 3.8]]),
    "hollow": np.array([[-3, -1], [3, -1], [3, 3], [2, 3], [2, 0], [-2, 0], [-2, 3], [-3, 3.0]]),
    "over the left edge": rectangle(0.0, 4.0, 3.0, 2.0, 0.4),
    "over the right edge": rectangle(0.0, -2.0, 3.0, 2.0, 0.4),
    "over the front": rectangle(4.0, 1.0, 3.0, 2.0, 0.4),
    "over the rear": rectangle(-4.0, 1.0, 3.0, 2.0, 0.4),
    "over a corner": rectangle(4.0, 4.0, 3.0, 2.0, 0.4),
    "around the grid": rectangle(0.0, 1.0, 30.0, 30.0, 0.4),
    "around but for a notch": np.array([[-9, -9], [9, -9], [9, 9], [0.5, 0.3], [-9, 9.0]]),
    "far edges": rectangle(1e4, 0.0, 2e4 + 1, 2.0, 1e-3),
}


@pytest.mark.parametrize("name", SHAPES)
def test_cover_is_that_of_fine_sampling(name: str) -> None:
    cover = polygon_cover(GRID, SHAPES[name])
    assert cover.shape == GRID.shape
    difference = np.abs(cover - sampled(SHAPES[name]))
    assert difference.max() < 0.03
    assert difference.mean() < 1e-3
    assert cover.sum() * CELL_M2 == pytest.approx(clipped_area(SHAPES[name]), abs=1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_direction_and_first_corner_do_not_matter(name: str) -> None:
    cover = polygon_cover(GRID, SHAPES[name])
    np.testing.assert_allclose(polygon_cover(GRID, SHAPES[name][::-1].copy()), cover, atol=1e-9)
    np.testing.assert_allclose(polygon_cover(GRID, np.roll(SHAPES[name], 1, axis=0)), cover, atol=1e-9)


@settings(max_examples=60)
@given(
    st.floats(-6, 6),
    st.floats(-4, 6),
    st.lists(st.floats(0.05, 6), min_size=3, max_size=9),
    st.floats(0, 6.3),
)
def test_any_polygon(x: float, y: float, radii: list[float], turn: float) -> None:
    polygon = star(x, y, radii, turn)
    cover = polygon_cover(GRID, polygon)
    assert cover.min() >= 0
    assert cover.max() <= 1
    assert cover.sum() * CELL_M2 == pytest.approx(clipped_area(polygon), abs=1e-9)


@settings(max_examples=60)
@given(st.integers(-12, 12), st.integers(-8, 12), st.integers(1, 9), st.integers(1, 9))
def test_corners_on_grid_lines(i: int, j: int, length: int, width: int) -> None:
    """Whole cells are covered wholly, and no other is touched."""
    low = np.array([i, j]) * 0.4
    high = low + np.array([length, width]) * 0.4
    cover = polygon_cover(GRID, np.array([low, [high[0], low[1]], high, [low[0], high[1]]]))
    centres = GRID.centres()
    inside = ((centres > low) & (centres < high)).all(axis=2)
    np.testing.assert_allclose(cover, inside.astype(float), atol=1e-9)


def test_cover_is_exact_and_not_sampled() -> None:
    # A triangle over one cell and a half: a half of the first, an eighth of the second.
    triangle = np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.4]]) * 1.5
    cover = polygon_cover(GRID, triangle)
    assert cover[10, 5] == pytest.approx(0.5)
    assert cover[11, 5] == pytest.approx(0.5)
    assert cover[11, 6] == pytest.approx(0.125)
    assert cover.sum() == pytest.approx(1.125)


@pytest.mark.parametrize(
    "polygon",
    [
        rectangle(0, 20, 3, 2, 0.3),
        rectangle(0, -20, 3, 2, 0.3),
        rectangle(20, 0, 3, 2, 0.3),
        rectangle(-20, 0, 3, 2, 0.3),
        np.array([[4.0, 0], [5, 0], [5, 1]]),  # touches the grid's edge
        np.zeros((0, 2)),
        np.array([[0.0, 0.0], [1.0, 1.0]]),
        np.array([[0.0, 0.0], [1.0, 1.0], [0.5, 0.5]]),
        np.array([[0.3, 0.3]] * 4),
    ],
)
def test_nothing_is_covered(polygon: FloatArray) -> None:
    assert polygon_cover(GRID, polygon).sum() == pytest.approx(0, abs=1e-12)


def test_tiny_numbers_at_the_grid_s_corner() -> None:
    corner = BEVGrid(0.0, 4.0, 0.0, 4.0, 0.4)
    cover = polygon_cover(corner, np.array([[0.0, 0.0], [1e-310, 2.0], [2.0, 1e-310]]))
    assert cover.sum() * CELL_M2 == pytest.approx(2.0)


def test_bad_polygons() -> None:
    with pytest.raises(ShapeError, match=r"polygon: expected shape \(any, 2\), got \(3, 3\)"):
        polygon_cover(GRID, np.zeros((3, 3)))
    with pytest.raises(ShapeError, match="polygon: expected finite numbers, got 1 of 6"):
        polygon_cover(GRID, np.array([[0, 0], [1, np.nan], [1, 1]]))


def test_line_cover() -> None:
    straight = line_cover(GRID, np.array([[-2.0, 0.2], [2.0, 0.2]]), 0.15)
    assert straight.sum() * CELL_M2 == pytest.approx(4.0 * 0.15)
    assert straight[5:15, 5] == pytest.approx(0.375)
    bent = line_cover(GRID, np.array([[-2.0, 0.2], [0.0, 0.2], [0.0, 0.2], [0.0, 3.0]]), 0.15)
    assert bent.sum() * CELL_M2 == pytest.approx((2.0 + 2.8) * 0.15)
    wide = line_cover(GRID, np.array([[-2.0, 0.2], [2.0, 0.2], [-2.0, 0.2]]), 0.8)
    assert wide.max() == 1.0  # twice over the same cells
    assert line_cover(GRID, np.array([[1.0, 1.0]]), 0.15).sum() == 0
    assert line_cover(GRID, np.zeros((0, 2)), 0.15).sum() == 0


def test_a_cell_belongs_to_the_polygon_that_covers_most_of_it() -> None:
    rng = np.random.default_rng(4)
    shapes = [rectangle(*rng.uniform([-5, -3, 0.3, 0.3, 0], [5, 5, 0.9, 0.9, 6.3])) for _ in range(120)]
    shapes += [shapes[3], rectangle(90.0, 0.0, 2.0, 1.0, 0.0)]
    covers = np.stack([polygon_cover(GRID, shape) for shape in shapes])
    expected = np.where(covers.max(axis=0) >= 0.3, covers.argmax(axis=0), -1)
    assert len(np.unique(expected)) > 60
    np.testing.assert_array_equal(polygon_owner(GRID, np.stack(shapes), 0.3), expected)
    assert (polygon_owner(GRID, np.stack(shapes[-1:]), 0.3) == -1).all()
    assert (polygon_owner(GRID, np.zeros((0, 4, 2)), 0.3) == -1).all()


def test_outlines_that_are_no_list_of_polygons_are_refused() -> None:
    with pytest.raises(ShapeError, match="outlines"):
        polygon_owner(GRID, np.zeros((4, 2)), 0.5)
    with pytest.raises(ShapeError, match="outlines"):
        polygon_owner(GRID, np.full((1, 4, 2), np.nan), 0.5)
