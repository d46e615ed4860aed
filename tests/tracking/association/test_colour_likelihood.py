from __future__ import annotations

import numpy as np
import pytest
from test_association import BLUE, RED, labs, predicted, seen

from tracking.association.colour_likelihood import ColourLikelihood
from tracking.association.costs import AssociationConfig, CandidatePairs, gate_pairs

FAR_APART = [(20.0 * i, 0.0) for i in range(10)]
GREY = (60.0, 0.0, 0.0)


def alone(track: tuple[float, ...], sight: tuple[float, ...], cost: float = -8.0) -> CandidatePairs:
    """Ten tracks of a colour, each seen in another one, with no other choice."""
    every = np.arange(10)
    tracks, sights = predicted(FAR_APART, lab=labs(*[track] * 10)), seen(FAR_APART, lab=labs(*[sight] * 10))
    return gate_pairs(tracks, sights, every, every, AssociationConfig())._replace(cost=np.full(10, cost))


def doubt_after(shown: tuple[float, ...], cost: float = -8.0) -> float:
    """Ten red tracks are each seen in a colour, frame after frame."""
    likelihood = ColourLikelihood(0.1)
    for _ in range(5):
        likelihood.update(alone(RED, shown, cost))
    return likelihood.outlier_rate


def test_colours_that_agree_are_trusted_more_and_others_less() -> None:
    assert doubt_after(RED) < 0.05
    assert doubt_after(BLUE) > 0.8
    assert doubt_after((np.nan,) * 3) == pytest.approx(0.1)


def test_pairs_that_hardly_go_together_teach_nothing() -> None:
    assert doubt_after(BLUE, cost=-1.0) == pytest.approx(0.1)


def test_what_is_long_ago_is_forgotten() -> None:
    likelihood = ColourLikelihood(0.1)
    for colour in (BLUE, RED):
        for _ in range(400):
            likelihood.update(alone(RED, colour))
    assert likelihood.outlier_rate < 0.05


def test_colours_that_stay_wrong_stay_doubted() -> None:
    """What is remembered of them all fades alike."""
    likelihood = ColourLikelihood(0.1)
    for _ in range(400):
        likelihood.update(alone(RED, BLUE))
    assert likelihood.outlier_rate > 0.9


def test_pairs_that_compete_teach_nothing() -> None:
    likelihood = ColourLikelihood(0.1)
    tracks, sights = predicted([(0, 0), (1, 0)], lab=labs(RED, RED)), seen([(0.5, 0)], lab=labs(BLUE))
    pairs = gate_pairs(tracks, sights, np.arange(2), np.zeros(2, np.int64), AssociationConfig())
    assert len(pairs.rows) == 2
    likelihood.update(pairs._replace(cost=np.full(2, -8.0)))
    assert likelihood.outlier_rate == 0.1


def test_a_rival_that_is_much_worse_leaves_a_pair_certain() -> None:
    tracks, sights = predicted([(0, 0), (1, 0)], lab=labs(RED, RED)), seen([(0, 0)], lab=labs(BLUE))
    pairs = gate_pairs(tracks, sights, np.arange(2), np.zeros(2, np.int64), AssociationConfig())
    for rival_cost, learns in ((-7.0, False), (0.0, True)):
        likelihood = ColourLikelihood(0.1)
        likelihood.update(pairs._replace(cost=np.array([-8.0, rival_cost])))
        assert (likelihood.outlier_rate > 0.1) == learns


def test_colours_that_are_wrong_lose_their_weight_within_few_pairs() -> None:
    likelihood = ColourLikelihood(0.1)
    likelihood.update(alone(RED, BLUE))
    assert likelihood.outlier_rate > 0.7


def test_disabled_colours_stay_disabled() -> None:
    likelihood, pairs = ColourLikelihood(1.0), alone(RED, RED)
    likelihood.update(pairs)
    assert likelihood.outlier_rate == 1.0
    assert likelihood.add_cost(pairs) is pairs


def test_like_colours_cost_less_and_unlike_ones_more_and_unknown_ones_nothing() -> None:
    like, unlike, unknown = (
        ColourLikelihood(0.1).add_cost(alone(RED, other)).cost[0] for other in (RED, BLUE, (np.nan,) * 3)
    )
    assert like < -8.0 < unlike
    assert unlike == pytest.approx(-8.0 - 2 * np.log(0.1))  # it may have been seen wrongly
    assert unknown == -8.0


def test_a_rare_colour_that_agrees_says_more_than_a_frequent_one() -> None:
    rare, frequent = alone(RED, RED).colour_ratio[0], alone(GREY, GREY).colour_ratio[0]
    assert rare > 10 * frequent > 0
