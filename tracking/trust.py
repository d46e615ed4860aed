"""What colours say about who is who, and how far they can be trusted: learnt while tracking."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from tracking.association import Pairs, Predicted, Seen

# What is believed at first weighs as much as so many pairs; what was seen longer ago than about so many is forgotten.
_AT_FIRST, _REMEMBERED = 10.0, 500.0
# A pair that costs less than this is the same vehicle, whatever its colours.
_SURE = -3.0
# Vehicles' paints: lightness, and the two colour axes of the white, grey and black ones and of all others.
_LIGHTNESS = (55.0, 30.0)
_GREYS, _GREY_AB, _OTHER_AB = 0.7, np.array([4.0, 5.0]), np.array([25.0, 25.0])


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

    def learn(self, pairs: Pairs, tracks: Predicted, seen: Seen) -> None:
        """Look at the colours of pairs that have no other choice and go well together, colours aside.

        Each counts as wrong by the probability that it is (one step of expectation maximisation).
        """
        if self._at_first == 1:
            return
        alone = (np.bincount(pairs.rows)[pairs.rows] == 1) & (np.bincount(pairs.columns)[pairs.columns] == 1)
        ratio = agreement(pairs.of(alone & (pairs.cost < _SURE)), tracks, seen)
        ratio, doubt = ratio[np.isfinite(ratio)], self.doubt
        wrong = doubt / (doubt + (1 - doubt) * ratio)
        kept = _REMEMBERED / (_REMEMBERED + len(ratio))
        self._wrong = kept * (self._wrong + float(wrong.sum()))
        self._pairs = kept * (self._pairs + len(ratio))

    def weighed(self, pairs: Pairs, tracks: Predicted, seen: Seen) -> Pairs:
        """Pairs with what their colours cost: less if they agree better than those of any two, nothing if unknown."""
        if self._at_first == 1:
            return pairs
        ratio, doubt = agreement(pairs, tracks, seen), self.doubt
        cost = np.where(np.isfinite(ratio), -2 * np.log((1 - doubt) * ratio + doubt), 0.0)
        return pairs._replace(cost=pairs.cost + cost)


def agreement(pairs: Pairs, tracks: Predicted, seen: Seen) -> FloatArray:
    """(P,) how much likelier the colours of sightings are, if they are those tracks than if they are any vehicle."""
    lab, variance = seen.lab[pairs.columns], tracks.lab_variance[pairs.rows]
    far = ((tracks.lab[pairs.rows] - lab) ** 2 / variance).sum(axis=1)
    return np.asarray(np.exp(-far / 2) / np.sqrt(variance.prod(axis=1)) / _paints(lab))


def _paints(lab: FloatArray) -> FloatArray:
    """(P,) how frequent colours are among vehicles, as densities but for the factor of a standard normal one's peak."""
    middle, spread = _LIGHTNESS
    lightness = np.exp(-(((lab[:, 0] - middle) / spread) ** 2) / 2) / spread
    greys, others = (
        np.exp(-((lab[:, 1:] / each) ** 2).sum(axis=1) / 2) / each.prod() for each in (_GREY_AB, _OTHER_AB)
    )
    return np.asarray(lightness * (_GREYS * greys + (1 - _GREYS) * others))
