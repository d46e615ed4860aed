from __future__ import annotations

import numpy as np
import pytest

from appocc.evaluation.bootstrap import confidence_interval, resampled_median


def test_an_interval_is_reproducible_and_contains_the_mean() -> None:
    values = np.arange(20.0)
    first, again = (
        confidence_interval(20, lambda weights: float(weights @ values / weights.sum())) for _ in range(2)
    )
    assert first is not None
    assert first == again
    assert first[0] < values.mean() < first[1]
    # Of a mean of 20 values the standard error is 5.77 / sqrt(20) = 1.29.
    assert first[1] - first[0] == pytest.approx(2 * 1.96 * 1.29, rel=0.15)


def test_no_interval_for_one_scene_or_no_values() -> None:
    assert confidence_interval(1, lambda weights: 1.0) is None
    assert confidence_interval(5, lambda weights: float("nan")) is None


def test_equal_scenes_have_an_interval_of_zero_width() -> None:
    assert confidence_interval(4, lambda weights: float(weights @ np.ones(4) / 4)) == (1.0, 1.0)


def test_values_count_as_often_as_their_scene() -> None:
    values, scene = np.array([1.0, 2.0, 9.0]), np.array([0, 0, 1])
    assert resampled_median(values, scene, np.array([2, 0])) == 1.5
    assert resampled_median(values, scene, np.array([1, 5])) == 9
    assert np.isnan(resampled_median(values, scene, np.array([0, 0])))
