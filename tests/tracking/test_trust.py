from __future__ import annotations

import numpy as np
import pytest
from test_association import BLUE, RED, labs, predicted, seen

from tracking.association import AssociationConfig, Pairs, possible
from tracking.trust import ColourTrust

RULE = AssociationConfig(colour_doubt=0.1)
FAR_APART = [(20.0 * i, 0.0) for i in range(10)]


def doubt_after(shown: tuple[float, ...], frames: int = 5, places: list[tuple[float, float]] = FAR_APART) -> float:
    """Ten red tracks are each seen in a colour, frame after frame."""
    trust = ColourTrust()
    tracks = predicted(places, lab=labs(*[RED] * 10))
    sights = seen(places, lab=labs(*[shown] * 10))
    every = np.arange(10)
    for _ in range(frames):
        rule = trust.applied(RULE)
        pairs = Pairs(every, every, np.zeros((10, 2, 2)), np.zeros(10), np.full(10, -1.0))
        trust.learn(pairs, tracks, sights, rule.colour_doubt)
    return trust.applied(RULE).colour_doubt


def test_colours_that_agree_are_trusted_more_and_others_less() -> None:
    assert doubt_after(RED) < 0.05
    assert doubt_after(BLUE) > 0.8
    assert doubt_after((np.nan,) * 3) == pytest.approx(0.1)


def test_what_is_long_ago_is_forgotten() -> None:
    trust, every = ColourTrust(), np.arange(10)
    tracks = predicted(FAR_APART, lab=labs(*[RED] * 10))
    pairs = Pairs(every, every, np.zeros((10, 2, 2)), np.zeros(10), np.full(10, -1.0))
    for colour in (BLUE, RED):
        for _ in range(400):
            trust.learn(pairs, tracks, seen(FAR_APART, lab=labs(*[colour] * 10)), trust.applied(RULE).colour_doubt)
    assert trust.applied(RULE).colour_doubt < 0.05


def test_pairs_that_compete_teach_nothing() -> None:
    trust = ColourTrust()
    tracks, sights = predicted([(0, 0), (1, 0)], lab=labs(RED, RED)), seen([(0.5, 0)], lab=labs(BLUE))
    pairs = possible(tracks, sights, np.arange(2), np.zeros(2, np.int64), RULE)
    assert len(pairs.rows) == 2
    trust.learn(pairs, tracks, sights, RULE.colour_doubt)
    assert trust.applied(RULE) == RULE


def test_a_rule_without_colour_stays_without() -> None:
    blind = AssociationConfig(colour_doubt=1.0)
    assert ColourTrust().applied(blind) is blind
