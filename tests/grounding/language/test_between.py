"""Both ends of "between", also where only the reader network finds the relation."""

import pytest

from grounding.language import parse


@pytest.mark.parametrize(
    "text",
    [
        "is there room between the van and the bus",
        "Between the van and the bus there is a free place, correct?",
    ],
)
def test_both_vehicles_are_named(text: str) -> None:
    query = parse(text).query
    assert query.relation == "between"
    assert query.referent is not None
    assert [query.referent.noun, *(one.noun for one in query.secondary)] == ["van", "bus"]


def test_a_pair_is_two() -> None:
    query = parse("theres a gap tween the two white vans").query
    assert query.referent is not None
    assert (query.relation, query.referent.number) == ("between", 2)


def test_each_end_has_its_own_qualifiers() -> None:
    query = parse("halt in the gap between the red van on the right and the first grey car on the left").query
    assert query.referent is not None
    assert (query.referent.noun, query.referent.qualifiers) == ("van", ("right_side",))
    assert [(one.noun, {*one.qualifiers}) for one in query.secondary] == [("car", {"first", "left_side"})]


def test_instead_is_no_landmark() -> None:
    for text in ("stop by him instead", "park behind the red car instead", "go in behind that insted"):
        reading = parse(text)
        assert not reading.query.secondary, text
        assert not reading.dropped, text


def test_who_waits_is_the_passenger() -> None:
    assert [step.action for step in parse("Stop in front of the white van and I'll wait.").steps] == ["stop"]


@pytest.mark.parametrize(
    "text", ["stop opposite the gold car, our side", "park across from the gold car, on this side"]
)
def test_our_side_of_a_place_opposite_is_the_kerb(text: str) -> None:
    reading = parse(text)
    assert (reading.query.relation, reading.query.road_side, reading.doubt) == ("opposite", "kerb", "")


def test_its_colour_may_be_told_afterwards() -> None:
    referent = parse("behind the van pls, its white").query.referent
    assert referent is not None
    assert referent.colour == "white"


@pytest.mark.parametrize(
    ("text", "colour", "clothes"),
    [
        ("stop next to the lady in green", "green", None),
        ("stop next to the woman in the green coat", None, "green"),
        ("pick up the guy with the big red jacket", None, "red"),
        ("stop beside the man in the red car", None, None),
    ],
)
def test_clothes_are_no_colour_of_a_vehicle(text: str, colour: str | None, clothes: str | None) -> None:
    referent = parse(text).query.referent
    assert referent is not None
    if referent.noun == "person":
        assert (referent.colour, referent.clothes) == (colour, clothes)
    else:
        assert referent.clothes is None


@pytest.mark.parametrize(
    ("text", "noun", "colours"),
    [
        ("park between the red and blue cars", "car", ["red", "blue"]),
        ("stop in the gap between the silver and green vans", "van", ["silver", "green"]),
        ("between the black and white cars", "car", ["black", "white"]),
        ("squeeze in between the dark blue and grey trucks", "truck", ["dark blue", "grey"]),
        ("between the yellow and the red car", "car", ["yellow", "red"]),
    ],
)
def test_two_colours_are_two_vehicles(text: str, noun: str, colours: list[str]) -> None:
    reading = parse(text)
    referent = reading.query.referent
    assert referent is not None
    assert (reading.query.relation, reading.dropped) == ("between", ())
    ends = [(referent.noun, referent.colour), *((one.noun, one.colour) for one in reading.query.secondary)]
    assert ends == [(noun, colour) for colour in colours]


def test_two_colours_of_one_vehicle_are_no_pair() -> None:
    referent = parse("park behind the blue and white van").query.referent
    assert referent is not None
    assert (referent.noun, referent.colour) == ("van", "blue")
