"""How colours and counting words are weighed against what a map shows."""

from __future__ import annotations

import numpy as np
import pytest
from asking import VAN_WLH_M, ask, best, car
from street import BLACK, BLUE, EGO, RED, WHITE, Street

from appocc.colours import fit
from grounding.query import Query, Referent
from grounding.referent.predicates import fits
from grounding.referent.scene import NEUTRAL, Scene
from grounding.referent.scoring import weigh

# It may be brown; rather it is red.
REDDISH = (113, 91, 93)


def shown(scene: Scene, word: str, name: str) -> float:
    """How well a colour word fits a vehicle."""
    row = [item.id for item in scene.objects].index(name)
    return float(fit(word, scene.paint_rgb[row], NEUTRAL))


def test_a_doubtful_colour_rules_nothing_out_that_all_else_fits() -> None:
    street = Street().car("van", 16, -6, REDDISH, size_wlh_m=VAN_WLH_M)
    scene = street.car("a", 10, 6, WHITE).car("b", 24, 6, BLACK).car("c", 12, -6, BLUE).scene()
    assert 0.05 < shown(scene, "brown", "van") < 0.2
    found = ask(Referent("van", "van", "brown"), scene)
    assert best(found) == "van"
    assert any("rather than brown" in reason for reason in found.reasons)
    assert ask(Referent("van", "van", "green"), scene).status == "not_found"


def test_a_doubtful_colour_makes_no_doubtful_noun_better() -> None:
    """All words together decide: what is hardly a van and hardly brown is no brown van."""
    street = Street().car("high", 16, -6, REDDISH, size_wlh_m=(1.8, 4.6, 1.7))
    scene = street.car("a", 10, 6, WHITE).car("b", 24, 6, BLACK).car("c", 12, -6, BLUE).scene()
    van = fits(Referent("van", "van"), scene)["van"]
    assert 0.12 < van[0] < 0.3
    assert not weigh(Query(""), Referent("van", "van", "brown"), scene).matches.any()
    assert weigh(Query(""), Referent("van", "van"), scene).matches[0]


def test_what_fits_best_is_one_of_those_that_are_counted() -> None:
    """Some call a minivan a van, and who does so of one does so of the other."""
    street = Street().car("near", 12, 3.5, BLACK, size_wlh_m=(1.9, 4.9, 1.75))
    scene = street.car("far", 32, -2.5, WHITE, size_wlh_m=(1.9, 4.9, 1.75)).car("car", 20, -6, RED).scene()
    assert 0.3 < fits(Referent("van", "van"), scene)["van"][:2].max() < 0.6
    assert best(ask(Referent("van", "van", None, ("rightmost",)), scene)) == "far"
    assert best(ask(Referent("van", "van", None, ("leftmost",)), scene)) == "near"


@pytest.mark.parametrize("word", ["nearest", "farthest"])
def test_a_better_colour_counts_more(word: str) -> None:
    scene = Street().car("red", 14, -6, RED).car("brown", 22, -6, REDDISH).car("white", 18, 6, WHITE).scene()
    weighed = weigh(Query(""), car("red", word), scene)
    assert np.argmax(weighed.chance) == (0 if word == "nearest" else 1)
    assert weighed.chance[2] == 0


def test_a_colour_tells_less_than_its_fit_says() -> None:
    scene = Street().car("red", 14, -6, RED).car("reddish", 14, 6, REDDISH).scene()
    weighed = weigh(Query(""), car("red"), scene)
    fit = weighed.said["red"]
    assert fit[0] > 1.3 * fit[1] > 0.1
    assert weighed.chance[0] / weighed.chance[1] == pytest.approx((fit[0] / fit[1]) ** 0.7)


def distance_fit(distance_m: float, x_m: float, size_wlh_m: tuple[float, float, float] = (1.8, 4.4, 1.5)) -> float:
    """How well a vehicle straight ahead is so far away."""
    scene = Street().car("it", x_m, 0, size_wlh_m=size_wlh_m).scene()
    query = Query("", distance_m=distance_m, distance_of="descriptor")
    return float(weigh(query, Referent("vehicle", "vehicle"), scene).said[f"{distance_m:g} m away"][0])


def test_distances_are_from_middle_to_middle_or_from_bumper_to_bumper() -> None:
    assert distance_fit(20, EGO.centre_m + 20) == pytest.approx(1, abs=1e-3)
    assert distance_fit(20, EGO.centre_m + 20 + EGO.length_m / 2 + 4.0, (2.5, 8.0, 3.2)) == pytest.approx(1, abs=1e-3)


def test_a_distance_that_is_a_quarter_off_is_one_standard_deviation_off() -> None:
    assert distance_fit(20 * np.exp(0.25), EGO.centre_m + 20) == pytest.approx(np.exp(-0.5), rel=0.01)
