"""Calibration of probabilities: reliability table, expected calibration error, and temperature scaling.

Guo et al., On Calibration of Modern Neural Networks, ICML 2017 (arXiv 1706.04599); Platt, Probabilistic Outputs for
Support Vector Machines, 1999. Everything is computed from
histograms of probabilities, so that memory does not grow with the number of cells.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, FloatArray

# Edges of the rows of the reliability table.
TABLE_EDGES = np.linspace(0.0, 1.0, 11)
# Fine bins: uniform in probability for the table, and uniform in the logit, because most cells are almost certain.
_LOGITS = np.linspace(-16.0, 16.0, 901)
EDGES = np.unique(np.concatenate([np.linspace(0.0, 1.0, 101).round(2), 1 / (1 + np.exp(-_LOGITS))]))
BINS = len(EDGES) - 1
_LEAST_PROBABILITY = 1e-7
_TEMPERATURES, _MOST_BIAS = (0.05, 20.0), 10.0
_STEPS, _ENOUGH = 50, 1e-9


class Calibration(NamedTuple):
    """Map from the logit of a network to that of a calibrated probability: logit / temperature + bias."""

    temperature: float
    bias: float

    @property
    def inverse(self) -> Calibration:
        """Map back from calibrated logits."""
        return Calibration(1 / self.temperature, -self.bias * self.temperature)

    def of(self, probability: float) -> float:
        """Return the calibrated probability, 0..1, of a probability in (0, 1)."""
        logit = math.log(probability) - math.log1p(-probability)
        return 1 / (1 + math.exp(-(logit / self.temperature + self.bias)))


IDENTITY = Calibration(1.0, 0.0)


class ProbabilityHistogram(NamedTuple):
    """Histogram of the predicted probabilities of one class; histograms of several maps can be added.

    Attributes:
        cells: (B,) cells of each bin of probability.
        probability: (B,) sum of their probabilities.
        true: (B,) number of them that are of the class.
    """

    cells: FloatArray
    probability: FloatArray
    true: FloatArray

    @classmethod
    def zeros(cls) -> ProbabilityHistogram:
        """Return an empty histogram."""
        return cls(np.zeros(BINS), np.zeros(BINS), np.zeros(BINS))

    def plus(self, other: ProbabilityHistogram) -> ProbabilityHistogram:
        """Return the sum of both histograms."""
        return ProbabilityHistogram(*(a + b for a, b in zip(self, other, strict=True)))

    @property
    def certain(self) -> bool:
        """Whether all probabilities are 0 or 1, as in ground truth."""
        return not self.cells[1:-1].any() and self.probability[0] == 0 and self.probability[-1] == self.cells[-1]


def histogram_of(probability: NDArray[np.floating[Any]], true: BoolArray) -> ProbabilityHistogram:
    """Return the histogram of probabilities (N,), 0..1, of cells (N,) that are of the class or not."""
    values = probability.astype(np.float64)
    place = np.clip(np.searchsorted(EDGES, values, side="right") - 1, 0, BINS - 1)
    sums = [np.bincount(place, weights, BINS) for weights in (None, values, true.astype(np.float64))]
    return ProbabilityHistogram(*(each.astype(np.float64) for each in sums))


def calibration_error(histogram: ProbabilityHistogram) -> float:
    """Return the expected calibration error (ECE), 0..1; NaN without cells.

    Mean over the cells of |mean probability - observed share| of their row of the table (Guo et al., eq. 3).
    """
    table = _by_row(histogram)
    return _mean(np.abs(table.probability - table.true).sum(), table.cells.sum())


def reliability_table(histogram: ProbabilityHistogram) -> list[dict[str, Any]]:
    """Return the rows of the reliability table: bounds of the probability, its mean, observed share, and cells.

    Mean and share are NaN in a row without cells.
    """
    table = _by_row(histogram)
    return [
        {
            "from": float(low),
            "to": float(high),
            "mean_probability": _mean(probability, cells),
            "observed_share": _mean(true, cells),
            "cells": int(cells),
        }
        for low, high, cells, probability, true in zip(TABLE_EDGES, TABLE_EDGES[1:], *table, strict=False)
    ]


def fit_temperature(histogram: ProbabilityHistogram) -> float:
    """Return the temperature T of a class: sigmoid(logit / T) has the least cross-entropy over the histogram.

    T above 1 means that the network is too sure. It is within 0.05..20, and 1 without cells.
    """
    return _fit(histogram, with_bias=False).temperature


def fit_temperature_and_bias(histogram: ProbabilityHistogram) -> Calibration:
    """Return the temperature and the bias of a class with the least cross-entropy over the histogram.

    This is Platt scaling. A negative bias undoes a weight of the class in the training loss. The temperature is
    within 0.05..20, the bias within -10..10; 1 and 0 without cells.
    """
    return _fit(histogram, with_bias=True)


def _fit(histogram: ProbabilityHistogram, with_bias: bool) -> Calibration:
    """Minimise the cross-entropy, convex in scale = 1 / T and bias, by Newton's method with step halving."""
    logit, cells, true = _logits(histogram)
    inputs = np.stack([logit, np.ones_like(logit)], axis=1)[:, : 2 if with_bias else 1]  # K P
    low, high = ([1 / _TEMPERATURES[1], -_MOST_BIAS], [1 / _TEMPERATURES[0], _MOST_BIAS])
    weights = np.array([1.0, 0.0])[: inputs.shape[1]]

    def loss(trial: FloatArray) -> float:
        return _cross_entropy_sum(inputs @ trial, cells, true)

    for _ in range(_STEPS):
        share = 0.5 * (1 + np.tanh(inputs @ weights / 2))  # sigmoid, without overflow
        slope = inputs.T @ (cells * share - true)
        curvature = inputs.T @ (inputs * (cells * share * (1 - share))[:, None])
        step = np.linalg.lstsq(curvature, slope, rcond=None)[0]
        new, before = weights, loss(weights)
        for halving in range(_STEPS):
            trial = np.clip(weights - step / 2**halving, low[: len(weights)], high[: len(weights)])
            if loss(trial) < before:
                new = trial
                break
        if np.abs(new - weights).max() < _ENOUGH:
            break
        weights = new
    return Calibration(1 / float(weights[0]), float(weights[1]) if with_bias else 0.0)


def cross_entropy(histogram: ProbabilityHistogram, calibration: Calibration = IDENTITY) -> float:
    """Return the mean cross-entropy of a class, calibrated, in nats per cell; NaN without cells."""
    logit, cells, true = _logits(histogram)
    scaled = logit / calibration.temperature + calibration.bias
    return _mean(_cross_entropy_sum(scaled, cells, true), cells.sum())


def _cross_entropy_sum(logit: FloatArray, cells: FloatArray, true: FloatArray) -> float:
    return float((cells * np.logaddexp(0.0, logit) - true * logit).sum())


def _by_row(histogram: ProbabilityHistogram) -> ProbabilityHistogram:
    """Return the histogram by rows of the table."""
    starts = np.searchsorted(EDGES, TABLE_EDGES[:-1] - 1e-9)
    return ProbabilityHistogram(*(np.add.reduceat(sums, starts) for sums in histogram))


def _logits(histogram: ProbabilityHistogram) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the logits (K,) of the mean probabilities of the bins with cells, their cells, and true cells."""
    used = histogram.cells > 0
    cells, probability, true = (sums[used] for sums in histogram)
    mean = np.clip(probability / cells, _LEAST_PROBABILITY, 1 - _LEAST_PROBABILITY)
    return np.log(mean) - np.log1p(-mean), cells, true


def _mean(total: float, count: float) -> float:
    return float(total / count) if count else float("nan")
