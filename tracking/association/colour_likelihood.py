"""Colour likelihood ratio as an association cost; the outlier rate of colours is learnt online."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray, IntArray
from tracking.association.costs import CandidatePairs
from tracking.compiled import compiled

# Outlier rates that are considered, denser towards 0 and 1.
_RATES = 1 / (1 + np.exp(-np.linspace(-6.0, 6.0, 61)))
# Weight of the initial outlier rate in pairs, and the number of pairs after which old ones are forgotten.
_PRIOR_WEIGHT, _MEMORY = 4.0, 500.0
# Below this cost without colours, a pair is certainly the same vehicle, if no other pair of its track or detection
# costs less than this much more.
_CERTAIN_COST, _MARGIN = -3.0, 6.0
# Products of likelihoods stay above this and below its inverse.
_LEAST = 1e-100


class ColourLikelihood:
    """Adds colour costs to pairs and estimates how often a colour is an outlier.

    Outliers are rare in daylight and common in predicted maps.
    """

    def __init__(self, outlier_rate: float) -> None:
        """Start with an outlier rate, 0..1; 1 disables colours."""
        self._enabled = outlier_rate < 1
        # A beta distribution of the rate.
        self._log_prior = _PRIOR_WEIGHT * (outlier_rate * np.log(_RATES) + (1 - outlier_rate) * np.log1p(-_RATES))
        self._log_likelihood = np.zeros_like(_RATES)
        self._rate = outlier_rate

    @property
    def outlier_rate(self) -> float:
        """Estimated probability that a colour is an outlier."""
        return self._rate

    def update(self, pairs: CandidatePairs) -> None:
        """Update the outlier rate from pairs that are certain without colours and have no rivals.

        The rate is the mean of its posterior distribution. Colours that turn out wrong lose their weight within few
        pairs: expectation maximisation, which keeps what it thought of earlier pairs, takes many.
        """
        if self._enabled and len(pairs.rows):
            arrays = pairs.rows, pairs.columns, pairs.cost, pairs.colour_ratio
            least = np.full((4, 1 + max(pairs.rows.max(), pairs.columns.max())), np.inf)
            certain = np.empty(len(pairs.rows))
            self._rate = _mean_rate(*arrays, least, certain, self._log_prior, self._log_likelihood, self._rate)

    def add_cost(self, pairs: CandidatePairs) -> CandidatePairs:
        """Return the pairs with colour costs added: negative for similar colours, zero for unknown ones."""
        if not self._enabled or not len(pairs.rows):
            return pairs
        cost = np.empty(len(pairs.rows))
        _add_cost(pairs.cost, pairs.colour_ratio, self._rate, cost)
        return pairs._replace(cost=cost)


@compiled
def _add_cost(cost: FloatArray, ratio: FloatArray, rate: float, result: FloatArray) -> None:
    """See `ColourLikelihood.add_cost`; written to `result` (P,)."""
    for pair in range(len(cost)):
        of_colour = -2 * np.log((1 - rate) * ratio[pair] + rate)
        result[pair] = cost[pair] + (of_colour if np.isfinite(of_colour) else 0.0)


@compiled
def _mean_rate(
    rows: IntArray,
    columns: IntArray,
    cost: FloatArray,
    ratio: FloatArray,
    least: FloatArray,
    certain: FloatArray,
    log_prior: FloatArray,
    log_likelihood: FloatArray,
    rate: float,
) -> float:
    """Add certain pairs to the likelihood, in place, and return the mean of the posterior; `rate` without such pairs.

    `least` (4, K) is infinity; lowest and second lowest costs of tracks and of detections are written to it, and the
    ratios of certain pairs to `certain` (P,).
    """
    for pair in range(len(cost)):
        _note_least(least, 0, rows[pair], cost[pair])
        _note_least(least, 2, columns[pair], cost[pair])
    count = 0
    for pair in range(len(cost)):
        n, m = rows[pair], columns[pair]
        best = cost[pair] == least[0, n] and cost[pair] == least[2, m]
        unrivalled = best and cost[pair] + _MARGIN <= min(least[1, n], least[3, m])
        if unrivalled and cost[pair] < _CERTAIN_COST and np.isfinite(ratio[pair]):
            certain[count] = ratio[pair]
            count += 1
    if not count:
        return rate
    highest = -np.inf
    for k in range(len(_RATES)):
        product = 1.0
        for index in range(count):
            product *= _RATES[k] + (1 - _RATES[k]) * certain[index]
            if not _LEAST < product < 1 / _LEAST:  # logarithms are slow
                log_likelihood[k] += np.log(product)
                product = 1.0
        log_likelihood[k] = (log_likelihood[k] + np.log(product)) * (_MEMORY / (_MEMORY + count))
        highest = max(highest, log_prior[k] + log_likelihood[k])
    total, mean = 0.0, 0.0
    for k in range(len(_RATES)):
        weight = np.exp(log_prior[k] + log_likelihood[k] - highest)
        total += weight
        mean += weight * _RATES[k]
    return mean / total


@compiled
def _note_least(least: FloatArray, first: int, index: int, cost: float) -> None:
    """Write a cost to the lowest and second lowest ones of an index, in two rows from `first` on."""
    if cost < least[first, index]:
        least[first + 1, index] = least[first, index]
        least[first, index] = cost
    elif cost < least[first + 1, index]:
        least[first + 1, index] = cost
