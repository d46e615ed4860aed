from __future__ import annotations

import numpy as np
from tolerances import assert_rounded

from appocc.checks import BoolArray, Float32Array, FloatArray
from appocc.geometry import apply, quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import GroundTruthSettings, ground_colours
from appocc.groundtruth.surface import GroundSurface

GRID = BEVGrid(-4.0, 4.0, -4.0, 4.0, 0.4)
HERE = transform(quaternion_from_yaw(1.0), [100.0, 200.0, 5.0])


def surface(
    cells: list[tuple[int, int]], rgb: list[tuple[float, float, float]], coloured: bool = True
) -> GroundSurface:
    """One fine cell in the middle of each grid cell."""
    xy = GRID.centre_of(np.array(cells).reshape(-1, 2))
    n = len(xy)
    nothing = np.zeros(n, np.float32)
    world = apply(HERE, np.pad(xy, ((0, 0), (0, 1))))
    colours = np.array(rgb, np.float32).reshape(-1, 3)
    return GroundSurface(world, colours, np.full(n, coloured), np.zeros(n, np.bool_), nothing, nothing)


def colours(found: GroundSurface) -> tuple[Float32Array, BoolArray]:
    return ground_colours(GRID, HERE, found)


def test_cells_are_the_mean_of_their_fine_cells() -> None:
    found, known = colours(surface([(3, 4), (3, 4), (10, 12)], [(10, 20, 30), (20, 40, 60), (5, 6, 7)]))
    assert np.argwhere(known).tolist() == [[3, 4], [10, 12]]
    assert found[3, 4].tolist() == [15, 30, 45]
    assert found[10, 12].tolist() == [5, 6, 7]


def test_where_nothing_was_seen_nothing_is_known() -> None:
    for nothing in (surface([], []), surface([(3, 4)], [(0, 0, 0)], coloured=False), surface([(99, 4)], [(9, 9, 9)])):
        assert not colours(nothing)[1].any()


def block(hole: FloatArray) -> GroundSurface:
    """Cells 2..17 in both directions, each of the colour (its column, 100, 0), but for those in a hole."""
    cells = [(i, j) for i in range(2, 18) for j in range(2, 18) if not hole[i, j]]
    return surface(cells, [(float(j), 100.0, 0.0) for _, j in cells])


def test_small_holes_are_filled_from_their_neighbours() -> None:
    hole = np.zeros(GRID.shape)
    hole[5, 5] = hole[9, 8:10] = hole[12:14, 12:14] = 1
    found, known = colours(block(hole))
    assert known[2:18, 2:18].all()
    assert known.sum() == 16 * 16  # nothing grows beyond the edge
    assert_rounded(found[5, 5], [5, 100, 0], 8)
    assert_rounded(found[12:14, 12:14, 1], np.full((2, 2), 100), 8)
    assert abs(found[9, 8, 0] - 8) < 0.5


def test_five_of_eight_neighbours_fill_a_cell_and_four_do_not() -> None:
    around = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    for count, filled in ((4, False), (5, True), (8, True)):
        cells = [(10 + i, 10 + j) for i, j in around[:count]]
        assert colours(surface(cells, [(9.0, 9.0, 9.0)] * count))[1][10, 10] == filled


def test_long_gaps_are_filled_from_their_ends_by_two_cells() -> None:
    hole = np.zeros(GRID.shape)
    hole[8:10, 5:15] = 1
    _, known = colours(block(hole))
    assert known[8:10, 5:15].sum(axis=0).tolist() == [2, 2, 0, 0, 0, 0, 0, 0, 2, 2]


def test_large_holes_stay_unknown() -> None:
    hole = np.zeros(GRID.shape)
    hole[5:13, 5:13] = 1
    _, known = colours(block(hole))
    assert not known[7:11, 7:11].any()
    assert known[2:18, 2:18].sum() < 16 * 16 - 16


def test_settings_identify_runs() -> None:
    plain = GroundTruthSettings(BEVGrid.surround(), "robust").as_meta()
    assert plain == GroundTruthSettings(BEVGrid.surround(), "robust").as_meta()
    assert plain != GroundTruthSettings(BEVGrid.front(), "robust").as_meta()
    assert plain != GroundTruthSettings(BEVGrid.surround(), "mode").as_meta()
