"""Places that a passenger leaves open: at the kerb, somewhere convenient, anywhere on a side."""

from __future__ import annotations

import pytest
from street import BLUE, WHITE, WORLD_FROM_EGO, Street

from grounding import Answer, Grounder
from grounding.dialogue.session import Session
from grounding.language.parser import parse

STREET = Street().car("w", 24, -5, WHITE).car("b", 34, -5, BLUE)


def session() -> Session:
    grounder = Grounder()
    grounder.set_scene(STREET.bev(), STREET.boxes(), WORLD_FROM_EGO)
    return grounder.session()


def ask(text: str) -> Answer:
    return session().say(text)


@pytest.mark.parametrize(
    "text",
    [
        "halt tight against the curb",
        "pull in nice and close to the kerb",
        "go right over to the kerb",
        "get tight to our curb",
    ],
)
def test_tight_is_not_right(text: str) -> None:
    reading = parse(text)
    assert not reading.corrections
    assert reading.query.goal_side is None
    assert reading.query.action == "pull_over" or reading.query.road_side == "kerb"


@pytest.mark.parametrize(
    "text", ["stop anywhere sensible", "drop us at the nearest suitable spot", "park some place safe"]
)
def test_a_convenient_place_is_at_the_kerb(text: str) -> None:
    place = ask(text).target
    assert place is not None
    assert place.ego_m[1] < -1


@pytest.mark.parametrize(
    ("text", "side"),
    [("somewhere on the right before the blue car", "right"), ("anywhere on the right after the white one", "right")],
)
def test_an_open_place_keeps_its_side(text: str, side: str) -> None:
    reading = parse(text)
    assert reading.query.goal_side == side
    assert ask(text).status == "ok"


def test_praise_of_an_open_place_is_understood() -> None:
    reading = parse("anywhere behind the blue car is perfect")
    assert (reading.query.relation, reading.query.action, reading.dropped) == ("behind", "park", ())


def test_a_place_in_the_shade_is_told() -> None:
    assert "the map holds no shade: it was left out" in ask("park on the right in the shade").text()


@pytest.mark.parametrize(
    ("goal", "further", "sign"),
    [
        ("stop before the blue car", "park a little further before it", -1),
        ("stop past the white car", "a bit farther past that", 1),
    ],
)
def test_further_off_the_same_end(goal: str, further: str, sign: int) -> None:
    talk = session()
    first, second = talk.say(goal).target, talk.say(further).target
    assert first is not None
    assert second is not None
    assert sign * (second.ego_m[0] - first.ego_m[0]) > 0.5


def test_anywhere_but_one_place_rules_it_out() -> None:
    excluded = parse("anywhere but next to the blue car").query.excluded
    assert [(one.relation, one.noun, one.colour) for one in excluded] == [("next_to", "car", "blue")]


def test_where_one_can_get_out_is_at_the_kerb() -> None:
    assert parse("park where we can hop out easily").query.road_side == "kerb"


@pytest.mark.parametrize(
    "text", ["park past the car that is behind the blue car", "halt past the car behind the blue car"]
)
def test_the_second_vehicle_of_a_description_counts(text: str) -> None:
    answer = ask(text)
    assert [part.of for part in answer.query.secondary] == ["referent"]
    assert [one.item.id for one in answer.candidates] == ["w"]


def test_a_vehicle_that_no_vehicle_has_beside_it_is_not_left_out() -> None:
    assert ask("stop behind the car that is in front of the blue car").status == "not_found"


def test_the_vehicle_nearest_to_another_is_not_the_one_nearest_to_us() -> None:
    answer = ask("stop beside the car closest to the blue car")
    assert [one.item.id for one in answer.candidates][:1] == ["w"]
