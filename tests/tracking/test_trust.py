from __future__ import annotations

import numpy as np
import pytest
from test_association import BLUE, RED, labs, predicted, seen

from tracking.association import AssociationConfig, Pairs, possible
from tracking.trust import ColourTrust, agreement

FAR_APART = [(20.0 * i, 0.0) for i in range(10)]
GREY = (60.0, 0.0, 0.0)


def alone(count: int, cost: float = -8.0) -> Pairs:
    every = np.arange(count)
    return Pairs(every, every, np.zeros((count, 2, 2)), np.zeros(count), np.full(count, cost))


def doubt_after(shown: tuple[float, ...], frames: int = 5, cost: float = -8.0) -> float:
    """Ten red tracks are each seen in a colour, frame after frame."""
    trust = ColourTrust(0.1)
    tracks, sights = predicted(FAR_APART, lab=labs(*[RED] * 10)), seen(FAR_APART, lab=labs(*[shown] * 10))
    for _ in range(frames):
        trust.learn(alone(10, cost), tracks, sights)
    return trust.doubt


def test_colours_that_agree_are_trusted_more_and_others_less() -> None:
    assert doubt_after(RED) < 0.05
    assert doubt_after(BLUE) > 0.8
    assert doubt_after((np.nan,) * 3) == pytest.approx(0.1)


def test_pairs_that_hardly_go_together_teach_nothing() -> None:
    assert doubt_after(BLUE, cost=-1.0) == pytest.approx(0.1)


def test_what_is_long_ago_is_forgotten() -> None:
    trust = ColourTrust(0.1)
    tracks = predicted(FAR_APART, lab=labs(*[RED] * 10))
    for colour in (BLUE, RED):
        for _ in range(400):
            trust.learn(alone(10), tracks, seen(FAR_APART, lab=labs(*[colour] * 10)))
    assert trust.doubt < 0.05


def test_pairs_that_compete_teach_nothing() -> None:
    trust = ColourTrust(0.1)
    tracks, sights = predicted([(0, 0), (1, 0)], lab=labs(RED, RED)), seen([(0.5, 0)], lab=labs(BLUE))
    pairs = possible(tracks, sights, np.arange(2), np.zeros(2, np.int64), AssociationConfig())
    assert len(pairs.rows) == 2
    trust.learn(pairs, tracks, sights)
    assert trust.doubt == 0.1


def test_the_blind_stay_blind() -> None:
    trust, tracks, sights = ColourTrust(1.0), predicted([(0, 0)], lab=labs(RED)), seen([(0, 0)], lab=labs(RED))
    trust.learn(alone(1), tracks, sights)
    assert trust.doubt == 1.0
    assert trust.weighed(alone(1), tracks, sights).cost.tolist() == [-8.0]


def test_like_colours_cost_less_and_unlike_ones_more_and_unknown_ones_nothing() -> None:
    tracks = predicted([(0, 0), (0, 0), (0, 0)], lab=labs(RED, RED, RED))
    sights = seen([(0, 0), (0, 0), (0, 0)], lab=labs(RED, BLUE, (np.nan,) * 3))
    like, unlike, unknown = ColourTrust(0.1).weighed(alone(3), tracks, sights).cost
    assert like < -8.0 < unlike
    assert unlike == pytest.approx(-8.0 - 2 * np.log(0.1))  # it may have been seen wrongly
    assert unknown == -8.0


def test_a_rare_colour_that_agrees_says_more_than_a_frequent_one() -> None:
    colours = labs(RED, GREY)
    rare, frequent = agreement(alone(2), predicted([(0, 0)] * 2, lab=colours), seen([(0, 0)] * 2, lab=colours))
    assert rare > 10 * frequent > 0
