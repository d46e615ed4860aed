"""Calibration of probabilities, against sums over all cells and a minimisation by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from appocc.checks import BoolArray, FloatArray
from appocc.probability_calibration import (
    BINS,
    Calibration,
    ProbabilityHistogram,
    calibration_error,
    cross_entropy,
    fit_temperature,
    fit_temperature_and_bias,
    histogram_of,
    reliability_table,
)


def sigmoid(logit: FloatArray) -> FloatArray:
    return np.asarray(1 / (1 + np.exp(-logit)))


def cells(sharpness: float, number: int = 200_000, seed: int = 0) -> tuple[FloatArray, BoolArray]:
    """Logits of a network that is too sure by a factor, and what is there: mostly nothing, as in a map."""
    random = np.random.default_rng(seed)
    logit = random.normal(-3, 4, number)
    return sharpness * logit, random.random(number) < sigmoid(logit)


def naive_table(probability: FloatArray, true: BoolArray) -> list[tuple[int, float, float]]:
    """Cells, mean probability and observed share of ten rows, by hand."""
    row = np.minimum((probability * 10).astype(int), 9)
    chosen = [row == i for i in range(10)]
    return [(int(c.sum()), float(probability[c].mean()), float(true[c].mean())) for c in chosen]


@pytest.mark.parametrize("sharpness", [0.5, 1.0, 2.0])
def test_table_and_error_agree_with_sums_over_all_cells(sharpness: float) -> None:
    logit, true = cells(sharpness)
    probability = sigmoid(logit)
    expected = naive_table(probability, true)
    histogram = histogram_of(probability, true)
    table = reliability_table(histogram)
    assert [row["cells"] for row in table] == [count for count, _, _ in expected]
    assert [row["mean_probability"] for row in table] == pytest.approx([mean for _, mean, _ in expected])
    assert [row["observed_share"] for row in table] == pytest.approx([share for _, _, share in expected])
    error = sum(count * abs(mean - share) for count, mean, share in expected) / len(true)
    assert calibration_error(histogram) == pytest.approx(error)
    assert (calibration_error(histogram) < 0.002) == (sharpness == 1)


def test_three_cells_by_hand() -> None:
    histogram = histogram_of(np.array([0.1, 0.15, 0.95], np.float32), np.array([False, True, True]))
    table = reliability_table(histogram)
    assert [row["cells"] for row in table] == [0, 2, 0, 0, 0, 0, 0, 0, 0, 1]
    assert (table[1]["mean_probability"], table[1]["observed_share"]) == (pytest.approx(0.125), 0.5)
    assert np.isnan(table[0]["observed_share"])
    assert calibration_error(histogram) == pytest.approx((2 * 0.375 + 0.05) / 3)


@pytest.mark.parametrize("sharpness", [0.3, 0.7, 1.0, 1.7, 2.5])
def test_the_temperature_undoes_a_wrong_sharpness(sharpness: float) -> None:
    logit, true = cells(sharpness)
    probability = sigmoid(logit)
    histogram = histogram_of(probability, true)
    temperature = fit_temperature(histogram)
    # SciPy, over the logits themselves.
    best = minimize_scalar(
        lambda t: float(np.mean(np.logaddexp(0, logit / t) - true * logit / t)), bounds=(0.05, 20), method="bounded"
    )
    assert temperature == pytest.approx(best.x, rel=0.02)
    assert temperature == pytest.approx(sharpness, rel=0.03)
    assert cross_entropy(histogram, Calibration(temperature, 0.0)) == pytest.approx(best.fun, rel=2e-3)
    assert cross_entropy(histogram, Calibration(temperature, 0.0)) <= cross_entropy(histogram)
    better = histogram_of(sigmoid(logit / temperature), true)
    assert calibration_error(better) < 0.003


@pytest.mark.parametrize(("temperature", "bias"), [(1.0, 1.5), (1.5, 2.0), (0.6, -1.0)])
def test_temperature_and_bias_undo_a_weighted_loss(temperature: float, bias: float) -> None:
    logit, true = cells(1.0)
    skewed = sigmoid((logit - bias) * temperature)  # what the network says
    histogram = histogram_of(skewed, true)
    fitted = fit_temperature_and_bias(histogram)
    assert fitted == pytest.approx((temperature, bias), abs=0.05)
    restored = sigmoid((logit - bias) * temperature / fitted.temperature + fitted.bias)
    assert calibration_error(histogram_of(restored, true)) < 0.003 < calibration_error(histogram)
    assert cross_entropy(histogram, fitted) < cross_entropy(histogram, Calibration(fit_temperature(histogram), 0.0))


def test_histograms_are_added() -> None:
    logit, true = cells(1.5, 1000)
    probability = sigmoid(logit)
    halves = [histogram_of(probability[part], true[part]) for part in (slice(0, 400), slice(400, None))]
    whole = histogram_of(probability, true)
    for a, b in zip(halves[0].plus(halves[1]), whole, strict=True):
        np.testing.assert_allclose(a, b)
    assert whole.cells.shape == (BINS,)
    assert whole.cells.sum() == 1000


def test_the_temperature_stays_within_its_bounds() -> None:
    everywhere_right = histogram_of(np.array([0.2, 0.8]), np.array([False, True]))
    everywhere_wrong = histogram_of(np.array([0.2, 0.8]), np.array([True, False]))
    assert fit_temperature(everywhere_right) == pytest.approx(0.05, rel=0.01)
    assert fit_temperature(everywhere_wrong) == pytest.approx(20, rel=0.01)
    assert fit_temperature(ProbabilityHistogram.zeros()) == 1
    assert fit_temperature_and_bias(ProbabilityHistogram.zeros()) == (1, 0)
    never = fit_temperature_and_bias(histogram_of(np.array([0.2, 0.8]), np.array([False, False])))
    assert never.bias == pytest.approx(-10, abs=3)
    assert 0.05 <= never.temperature <= 20
    assert np.isnan(calibration_error(ProbabilityHistogram.zeros()))
    assert np.isnan(cross_entropy(ProbabilityHistogram.zeros()))


def test_half_and_certain_probabilities_are_finite() -> None:
    histogram = histogram_of(np.array([0.0, 1.0, 0.5, 1.0], np.float16), np.array([True, True, False, False]))
    assert np.isfinite(fit_temperature(histogram))
    assert np.isfinite(cross_entropy(histogram))
    assert not histogram.certain
    assert histogram_of(np.array([0.0, 1.0, 1.0]), np.array([True, True, False])).certain
    assert not histogram_of(np.array([0.0, 0.9999]), np.array([False, True])).certain
