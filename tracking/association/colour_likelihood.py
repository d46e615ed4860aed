"""Colour likelihood ratio as an association cost; the outlier rate of colours is learnt online."""

from __future__ import annotations

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.association.costs import CandidatePairs
from tracking.compiled import compiled

# Outlier rates that are considered, denser towards 0 and 1.
_RATES = 1 / (1 + np.exp(-np.linspace(-6.0, 6.0, 61)))
# Weight of the initial outlier rate in pairs, and the number of pairs after which old ones are forgotten.
_PRIOR_WEIGHT, _MEMORY = 4.0, 500.0
# Below this cost without colours, a pair is certainly the same vehicle, if no other pair of its track or detection
# costs less than this much more.
_CERTAIN_COST, _MARGIN = -3.0, 6.0


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
            self._rate = _mean_rate(*arrays, self._log_prior, self._log_likelihood, self._rate)

    def add_cost(self, pairs: CandidatePairs) -> CandidatePairs:
        """Return the pairs with colour costs added: negative for similar colours, zero for unknown ones."""
        if not self._enabled or not len(pairs.rows):
            return pairs
        rate = self._rate
        cost = -2 * np.log((1 - rate) * pairs.colour_ratio + rate)
        return pairs._replace(cost=pairs.cost + np.where(np.isfinite(cost), cost, 0.0))


@compiled
def _mean_rate(
    rows: IntArray,
    columns: IntArray,
    cost: FloatArray,
    ratio: FloatArray,
    log_prior: FloatArray,
    log_likelihood: FloatArray,
    rate: float,
) -> float:
    """Add certain pairs to the likelihood, in place, and return the mean of the posterior; `rate` without such pairs."""
    certain = (cost < _CERTAIN_COST) & np.isfinite(ratio) & _unrivalled(rows, cost) & _unrivalled(columns, cost)
    count = certain.sum()
    if not count:
        return rate
    for k in range(len(_RATES)):
        for pair in range(len(ratio)):
            if certain[pair]:
                log_likelihood[k] += np.log(_RATES[k] + (1 - _RATES[k]) * ratio[pair])
        log_likelihood[k] *= _MEMORY / (_MEMORY + count)
    weight = np.exp(log_prior + log_likelihood - (log_prior + log_likelihood).max())
    return float((weight * _RATES).sum() / weight.sum())


@compiled
def _unrivalled(index: IntArray, cost: FloatArray) -> BoolArray:
    """(P,) whether each pair costs at least the margin less than all others of its track or detection (P,)."""
    least = np.full((2, index.max() + 1), np.inf)
    for pair, own in enumerate(index):
        low, high = min(cost[pair], least[0, own]), max(cost[pair], least[0, own])
        least[0, own], least[1, own] = low, min(high, least[1, own])
    result = np.empty(len(index), np.bool_)
    for pair, own in enumerate(index):
        result[pair] = cost[pair] == least[0, own] and cost[pair] + _MARGIN <= least[1, own]
    return result
