from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from tracking.instances.robust_colour import MIN_INNER_CELLS, robust_lab


def labs(lightness: list[float]) -> FloatArray:
    """Colours whose a and b follow their lightness, so that it shows which ones count."""
    light = np.array(lightness, np.float64)
    return np.stack([light, light + 1, -light], axis=1)


def test_the_lighter_half_without_the_lightest_tenth_counts() -> None:
    lab = labs([90, 10, 20, 30, 80, 40, 50, 60, 70, 100])
    found = robust_lab(lab, np.ones(10, np.bool_), np.zeros(10, np.int64), 1)
    np.testing.assert_allclose(found, [[75, 76, -75]])  # of 60, 70, 80, 90


def test_few_cells_have_a_colour_too() -> None:
    member = np.array([0, 1, 1, 2, 2, 2])
    found = robust_lab(labs([30, 40, 20, 7, 9, 5]), np.ones(6, np.bool_), member, 4)
    np.testing.assert_allclose(found[:, 0], [30, 40, 8, np.nan])


def test_cells_inside_count_first_where_there_are_enough() -> None:
    lab = labs([50.0] * MIN_INNER_CELLS + [90.0] * 20)
    inside = np.arange(len(lab)) < MIN_INNER_CELLS
    one = np.zeros(len(lab), np.int64)
    np.testing.assert_allclose(robust_lab(lab, inside, one, 1)[:, 0], [50.0])
    np.testing.assert_allclose(robust_lab(lab[1:], inside[1:], one[1:], 1)[:, 0], [90.0])


def test_groups_do_not_mix_and_order_does_not_matter() -> None:
    dice = np.random.default_rng(0)
    lab, member = dice.uniform(0, 100, (60, 3)), np.repeat(np.arange(3), 20)
    inside = np.ones(60, np.bool_)
    alone = [robust_lab(lab[member == k], inside[:20], np.zeros(20, np.int64), 1)[0] for k in range(3)]
    order = dice.permutation(60)
    np.testing.assert_allclose(robust_lab(lab[order], inside, member[order], 3), alone)
