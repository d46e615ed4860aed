"""Referent scoring: colours, ordinals, distances."""

from __future__ import annotations

import numpy as np
import pytest
from asking import VAN_WLH_M, ask, best, car
from street import BLACK, BLUE, EGO, RED, WHITE, Street

from appocc.colours import fit
from grounding.query import Query, Referent
from grounding.referent.predicates import fit_words
from grounding.referent.scene import NEUTRAL_LIGHT, SceneModel
from grounding.referent.scoring import score_objects

# More red than brown.
REDDISH = (113, 91, 93)


def shown(scene: SceneModel, word: str, name: str) -> float:
    """Return the membership of a vehicle in a colour word."""
    row = [item.id for item in scene.objects].index(name)
    return float(fit(word, scene.paint_rgb[row], NEUTRAL_LIGHT))


def test_a_doubtful_colour_excludes_no_vehicle_that_fits_all_other_words() -> None:
    street = Street().car("van", 16, -6, REDDISH, size_wlh_m=VAN_WLH_M)
    scene = street.car("a", 10, 6, WHITE).car("b", 24, 6, BLACK).car("c", 12, -6, BLUE).scene()
    assert 0.05 < shown(scene, "brown", "van") < 0.2
    found = ask(Referent("van", "van", "brown"), scene)
    assert best(found) == "van"
    assert any("rather than brown" in reason for reason in found.reasons)
    assert ask(Referent("van", "van", "green"), scene).status == "not_found"


def test_a_doubtful_noun_and_a_doubtful_colour_do_not_match() -> None:
    """An object that is hardly a van and hardly brown is not a brown van."""
    street = Street().car("high", 16, -6, REDDISH, size_wlh_m=(1.8, 4.6, 1.7))
    scene = street.car("a", 10, 6, WHITE).car("b", 24, 6, BLACK).car("c", 12, -6, BLUE).scene()
    van = fit_words(Referent("van", "van"), scene)["van"]
    assert 0.12 < van[0] < 0.3
    assert not score_objects(Query(""), Referent("van", "van", "brown"), scene).matches.any()
    assert score_objects(Query(""), Referent("van", "van"), scene).matches[0]


def test_the_best_match_counts_fully() -> None:
    """A speaker who calls one minivan a van does so for the other."""
    street = Street().car("near", 12, 3.5, BLACK, size_wlh_m=(1.9, 4.9, 1.75))
    scene = street.car("far", 32, -2.5, WHITE, size_wlh_m=(1.9, 4.9, 1.75)).car("car", 20, -6, RED).scene()
    assert 0.3 < fit_words(Referent("van", "van"), scene)["van"][:2].max() < 0.6
    assert best(ask(Referent("van", "van", None, ("rightmost",)), scene)) == "far"
    assert best(ask(Referent("van", "van", None, ("leftmost",)), scene)) == "near"


@pytest.mark.parametrize("word", ["nearest", "farthest"])
def test_a_better_colour_counts_more(word: str) -> None:
    scene = Street().car("red", 14, -6, RED).car("brown", 22, -6, REDDISH).car("white", 18, 6, WHITE).scene()
    scores = score_objects(Query(""), car("red", word), scene)
    assert np.argmax(scores.probability) == (0 if word == "nearest" else 1)
    assert scores.probability[2] == 0


def test_colours_have_a_reduced_weight() -> None:
    scene = Street().car("red", 14, -6, RED).car("reddish", 14, 6, REDDISH).scene()
    scores = score_objects(Query(""), car("red"), scene)
    fit = scores.word_fits["red"]
    assert fit[0] > 1.3 * fit[1] > 0.1
    assert scores.probability[0] / scores.probability[1] == pytest.approx((fit[0] / fit[1]) ** 0.7)


def distance_fit(distance_m: float, x_m: float, size_wlh_m: tuple[float, float, float] = (1.8, 4.4, 1.5)) -> float:
    """Return the membership of a vehicle straight ahead in a distance."""
    scene = Street().car("it", x_m, 0, size_wlh_m=size_wlh_m).scene()
    query = Query("", distance_m=distance_m, distance_of="descriptor")
    return float(score_objects(query, Referent("vehicle", "vehicle"), scene).word_fits[f"{distance_m:g} m away"][0])


def test_distances_are_between_centres_or_bumpers() -> None:
    assert distance_fit(20, EGO.centre_m + 20) == pytest.approx(1, abs=1e-3)
    assert distance_fit(20, EGO.centre_m + 20 + EGO.length_m / 2 + 4.0, (2.5, 8.0, 3.2)) == pytest.approx(1, abs=1e-3)


def test_a_deviation_of_a_quarter_is_one_standard_deviation() -> None:
    assert distance_fit(20 * np.exp(0.25), EGO.centre_m + 20) == pytest.approx(np.exp(-0.5), rel=0.01)
