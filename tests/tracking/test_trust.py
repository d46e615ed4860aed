from __future__ import annotations

import numpy as np
import pytest
from test_association import BLUE, RED, labs, predicted, seen

from tracking.association.colour_likelihood import ColourTrust
from tracking.association.costs import AssociationConfig, Pairs, possible

FAR_APART = [(20.0 * i, 0.0) for i in range(10)]
GREY = (60.0, 0.0, 0.0)


def alone(track: tuple[float, ...], sight: tuple[float, ...], cost: float = -8.0) -> Pairs:
    """Ten tracks of a colour, each seen in another one, with no other choice."""
    every = np.arange(10)
    tracks, sights = predicted(FAR_APART, lab=labs(*[track] * 10)), seen(FAR_APART, lab=labs(*[sight] * 10))
    return possible(tracks, sights, every, every, AssociationConfig())._replace(cost=np.full(10, cost))


def doubt_after(shown: tuple[float, ...], cost: float = -8.0) -> float:
    """Ten red tracks are each seen in a colour, frame after frame."""
    trust = ColourTrust(0.1)
    for _ in range(5):
        trust.learn(alone(RED, shown, cost))
    return trust.doubt


def test_colours_that_agree_are_trusted_more_and_others_less() -> None:
    assert doubt_after(RED) < 0.05
    assert doubt_after(BLUE) > 0.8
    assert doubt_after((np.nan,) * 3) == pytest.approx(0.1)


def test_pairs_that_hardly_go_together_teach_nothing() -> None:
    assert doubt_after(BLUE, cost=-1.0) == pytest.approx(0.1)


def test_what_is_long_ago_is_forgotten() -> None:
    trust = ColourTrust(0.1)
    for colour in (BLUE, RED):
        for _ in range(400):
            trust.learn(alone(RED, colour))
    assert trust.doubt < 0.05


def test_colours_that_stay_wrong_stay_doubted() -> None:
    """What is remembered of them all fades alike."""
    trust = ColourTrust(0.1)
    for _ in range(400):
        trust.learn(alone(RED, BLUE))
    assert trust.doubt > 0.9


def test_pairs_that_compete_teach_nothing() -> None:
    trust = ColourTrust(0.1)
    tracks, sights = predicted([(0, 0), (1, 0)], lab=labs(RED, RED)), seen([(0.5, 0)], lab=labs(BLUE))
    pairs = possible(tracks, sights, np.arange(2), np.zeros(2, np.int64), AssociationConfig())
    assert len(pairs.rows) == 2
    trust.learn(pairs._replace(cost=np.full(2, -8.0)))
    assert trust.doubt == 0.1


def test_the_blind_stay_blind() -> None:
    trust, pairs = ColourTrust(1.0), alone(RED, RED)
    trust.learn(pairs)
    assert trust.doubt == 1.0
    assert trust.weighed(pairs) is pairs


def test_like_colours_cost_less_and_unlike_ones_more_and_unknown_ones_nothing() -> None:
    like, unlike, unknown = (
        ColourTrust(0.1).weighed(alone(RED, other)).cost[0] for other in (RED, BLUE, (np.nan,) * 3)
    )
    assert like < -8.0 < unlike
    assert unlike == pytest.approx(-8.0 - 2 * np.log(0.1))  # it may have been seen wrongly
    assert unknown == -8.0


def test_a_rare_colour_that_agrees_says_more_than_a_frequent_one() -> None:
    rare, frequent = alone(RED, RED).alike[0], alone(GREY, GREY).alike[0]
    assert rare > 10 * frequent > 0
