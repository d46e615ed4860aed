from collections import Counter

import numpy as np
import pytest

from appocc.colours import WORDS, word_probabilities
from appocc.errors import NotFoundError
from appocc.simulation.actors.paint import COLOUR_WORDS, draw_paint, draw_paints
from appocc.simulation.traffic import KINDS, Actor


def fleet(kind: str, count: int) -> list[Actor]:
    return [Actor(f"{kind}{i}", kind, "sedan", (4.5, 1.8, 1.5)) for i in range(count)]


def shares(kind: str, count: int = 5000) -> dict[str, float]:
    counts = Counter(paint.name for paint in draw_paints(fleet(kind, count), 3))
    return {name: n / count for name, n in counts.items()}


def test_colour_words_are_those_of_commands() -> None:
    assert set(COLOUR_WORDS) == set(WORDS)


def test_cars_are_mostly_white_black_grey_and_silver() -> None:
    cars = shares("car")
    expected = {"white": 0.34, "black": 0.21, "grey": 0.18, "silver": 0.09, "blue": 0.075, "red": 0.055}
    for name, share in expected.items():
        assert cars[name] == pytest.approx(share, abs=0.02)
    assert sum(cars[name] for name in ("white", "black", "grey", "silver")) == pytest.approx(0.82, abs=0.02)
    assert {"green", "brown", "orange", "yellow", "purple"} <= set(cars)


def test_vans_and_trucks_are_mostly_white() -> None:
    assert shares("van", 2000)["white"] > 0.6
    assert shares("truck", 2000)["white"] > 0.5


def test_most_buses_of_a_town_are_of_one_fleet() -> None:
    common = []
    for seed in range(12):
        counts = Counter(paint.rgb for paint in draw_paints(fleet("bus", 60), seed))
        rgb, count = counts.most_common(1)[0]
        assert count >= 40
        common.append(rgb)
    assert len(set(common)) > 6


@pytest.mark.parametrize("kind", KINDS)
def test_names_agree_with_the_colour_classifier(kind: str) -> None:
    paints = draw_paints(fleet(kind, 1500), 11)
    said = np.array(WORDS)[word_probabilities(np.array([paint.rgb for paint in paints])).argmax(axis=1)]
    assert np.mean(said == [paint.name for paint in paints]) > 0.95


def test_paints_of_a_colour_differ() -> None:
    white = {paint.rgb for paint in draw_paints(fleet("car", 500), 0) if paint.name == "white"}
    assert len(white) > 80


def test_a_paint_follows_from_seed_and_name_alone() -> None:
    car = Actor("veh7", "car", "sedan", (4.5, 1.8, 1.5))
    again = Actor("veh7", "car", "estate", (4.9, 1.9, 1.5))
    assert draw_paint(car, 5) == draw_paint(again, 5)
    others = {draw_paint(car, seed).rgb for seed in range(20)}
    assert len(others) > 10
    assert all(0 <= value <= 255 for rgb in others for value in rgb)


def test_a_kind_without_paints_is_refused() -> None:
    with pytest.raises(NotFoundError, match="no kind 'tram'"):
        draw_paint(Actor("x", "tram", "bus", (30.0, 2.6, 3.5)), 0)


def test_rare_paints_are_drawn_uniformly_for_a_share_of_the_vehicles() -> None:
    cars, people = fleet("car", 6000), fleet("pedestrian", 200)
    plain, mixed, rare = (draw_paints(cars, 3, share) for share in (0.0, 0.4, 1.0))
    counts = Counter(paint.name for paint in rare)
    assert set(counts) == set(COLOUR_WORDS)
    assert max(counts.values()) < 1.25 * min(counts.values())
    assert np.mean([a == b for a, b in zip(plain, mixed, strict=True)]) == pytest.approx(0.6, abs=0.02)
    assert draw_paints(people, 3, 1.0) == draw_paints(people, 3)
