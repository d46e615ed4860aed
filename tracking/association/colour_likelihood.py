"""Colour likelihood ratio as an association cost; the outlier rate of colours is learnt online."""

from __future__ import annotations

import numpy as np

from tracking.association.costs import CandidatePairs

# Weight of the initial outlier rate in pairs, and the number of pairs after which old ones are forgotten.
_PRIOR_WEIGHT, _MEMORY = 10.0, 500.0
# Below this cost without colours, a pair is certainly the same vehicle.
_CERTAIN_COST = -3.0


class ColourLikelihood:
    """Adds colour costs to pairs and estimates how often a colour is an outlier.

    Outliers are rare in daylight and common in predicted maps.
    """

    def __init__(self, outlier_rate: float) -> None:
        """Start with an outlier rate, 0..1; 1 disables colours."""
        self._prior = outlier_rate
        self._outliers = 0.0
        self._pairs = 0.0

    @property
    def outlier_rate(self) -> float:
        """Estimated probability that a colour is an outlier."""
        return (self._prior * _PRIOR_WEIGHT + self._outliers) / (_PRIOR_WEIGHT + self._pairs)

    def update(self, pairs: CandidatePairs) -> None:
        """Update the outlier rate from unambiguous pairs: one candidate each, and certain without colours.

        Each pair counts with its probability of being an outlier (one step of expectation maximisation).
        """
        if self._prior == 1:
            return
        single = (np.bincount(pairs.rows)[pairs.rows] == 1) & (np.bincount(pairs.columns)[pairs.columns] == 1)
        ratio = pairs.colour_ratio[single & (pairs.cost < _CERTAIN_COST) & np.isfinite(pairs.colour_ratio)]
        rate = self.outlier_rate
        outlier = rate / (rate + (1 - rate) * ratio)
        decay = _MEMORY / (_MEMORY + len(ratio))
        self._outliers = decay * (self._outliers + float(outlier.sum()))
        self._pairs = decay * (self._pairs + len(ratio))

    def add_cost(self, pairs: CandidatePairs) -> CandidatePairs:
        """Return the pairs with colour costs added: negative for similar colours, zero for unknown ones."""
        if self._prior == 1 or not len(pairs.rows):
            return pairs
        rate = self.outlier_rate
        cost = -2 * np.log((1 - rate) * pairs.colour_ratio + rate)
        return pairs._replace(cost=pairs.cost + np.where(np.isfinite(cost), cost, 0.0))
