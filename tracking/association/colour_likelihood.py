"""What colours say about who is who, and how far they can be trusted: learnt while tracking."""

from __future__ import annotations

import numpy as np

from tracking.association.costs import Pairs

# What is believed at first weighs as much as so many pairs; what was seen longer ago than about so many is forgotten.
_AT_FIRST, _REMEMBERED = 4.0, 500.0
# A pair that costs less than this is the same vehicle, whatever its colours.
_SURE = -3.0


class ColourTrust:
    """Weighs colours, and learns how often those of a recording are wrong.

    In good light they hardly ever are, in predicted maps now and then.
    """

    def __init__(self, doubt: float) -> None:
        """How likely a colour is seen wrongly, before more is known; 1 leaves colours out."""
        self._at_first = doubt
        self._wrong = 0.0
        self._pairs = 0.0

    @property
    def doubt(self) -> float:
        """How likely a colour is seen wrongly, as far as is known."""
        return (self._at_first * _AT_FIRST + self._wrong) / (_AT_FIRST + self._pairs)

    def learn(self, pairs: Pairs) -> None:
        """Look at the colours of pairs that have no other choice and go well together, colours aside.

        Each counts as wrong by the probability that it is (one step of expectation maximisation).
        """
        if self._at_first == 1:
            return
        alone = (np.bincount(pairs.rows)[pairs.rows] == 1) & (np.bincount(pairs.columns)[pairs.columns] == 1)
        alike = pairs.alike[alone & (pairs.cost < _SURE) & np.isfinite(pairs.alike)]
        doubt = self.doubt
        wrong = doubt / (doubt + (1 - doubt) * alike)
        kept = _REMEMBERED / (_REMEMBERED + len(alike))
        self._wrong = kept * (self._wrong + float(wrong.sum()))
        self._pairs = kept * (self._pairs + len(alike))

    def weighed(self, pairs: Pairs) -> Pairs:
        """Pairs with what their colours cost: less if they agree better than those of any two, nothing if unknown."""
        if self._at_first == 1 or not len(pairs.rows):
            return pairs
        doubt = self.doubt
        cost = -2 * np.log((1 - doubt) * pairs.alike + doubt)
        return pairs._replace(cost=pairs.cost + np.where(np.isfinite(cost), cost, 0.0))
