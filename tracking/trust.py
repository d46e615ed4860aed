"""How far colours can be trusted, learnt while tracking: from pairs that the place alone settles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracking.association import AssociationConfig, Pairs, Predicted, Seen, agreement

# What is believed at first weighs as much as so many pairs; what was seen longer ago than about so many is forgotten.
_AT_FIRST, _REMEMBERED = 10.0, 500.0


class ColourTrust:
    """How often the colours of a recording are wrong: in good light hardly ever, in predicted maps now and then."""

    def __init__(self) -> None:
        """Nothing was seen."""
        self._wrong = 0.0
        self._pairs = 0.0

    def applied(self, rule: AssociationConfig) -> AssociationConfig:
        """The rule with the doubt that what was seen suggests; a rule that leaves colour out stays as it is."""
        if rule.colour_doubt == 1:
            return rule
        doubt = (rule.colour_doubt * _AT_FIRST + self._wrong) / (_AT_FIRST + self._pairs)
        return replace(rule, colour_doubt=doubt)

    def learn(self, pairs: Pairs, tracks: Predicted, seen: Seen, doubt: float) -> None:
        """Look at the colours of pairs that have no other choice, under the doubt there is by now.

        Each counts as wrong by the probability that it is (one step of expectation maximisation).
        """
        alone = (np.bincount(pairs.rows)[pairs.rows] == 1) & (np.bincount(pairs.columns)[pairs.columns] == 1)
        ratio = agreement(tracks.of(pairs.rows[alone]), seen.of(pairs.columns[alone]))
        ratio = ratio[np.isfinite(ratio)]
        wrong = doubt / (doubt + (1 - doubt) * ratio)
        kept = _REMEMBERED / (_REMEMBERED + len(ratio))
        self._wrong = kept * (self._wrong + float(wrong.sum()))
        self._pairs = kept * (self._pairs + len(ratio))
