"""Distances without a unit of length: bare numbers after a direction, and numbers of vehicles."""

import pytest

from grounding.language import parse

METRES = {
    "forward twelve": ("other", 12.0, None),
    "go forward twenty five": ("other", 25.0, "onward"),
    "drive straight on thirty": ("other", 30.0, None),
    "reverse four": ("other", 4.0, "back"),
    "go back three": ("other", 3.0, "back"),
    "eight metres further": ("stop", 8.0, None),
    "another five metres": ("other", 5.0, None),
    "six more metres": ("stop", 6.0, None),
    "go back four metres": ("other", 4.0, "back"),
    "back two metres": ("other", 2.0, "back"),
}


@pytest.mark.parametrize("text", METRES)
def test_metres_to_go(text: str) -> None:
    query = parse(text).query
    assert (query.action, query.distance_m, query.manoeuvre) == METRES[text]
    assert query.distance_of == "ego"


@pytest.mark.parametrize(
    ("text", "relation", "metres"),
    [
        ("stop two cars behind the van", "behind", 12),
        ("park three cars past the truck", "past", 18),
        ("wait one car behind the bus", "behind", 6),
        ("pull over two vehicles before the van", "before", 12),
        ("three cars behind the truck", "behind", 18),
    ],
)
def test_vehicles_tell_how_far(text: str, relation: str, metres: float) -> None:
    reading = parse(text)
    query = reading.query
    assert (query.relation, query.distance_m, query.distance_of) == (relation, metres, "referent")
    assert query.referent is not None
    assert query.referent.noun in ("van", "truck", "bus")
    assert any(note.endswith(f"is taken as {metres} m") for note in reading.notes)


@pytest.mark.parametrize(
    "text", ["park behind the two cars", "overtake two cars behind the bus", "let two cars past", "go thirty"]
)
def test_other_numbers_are_no_distance(text: str) -> None:
    assert parse(text).query.distance_m is None


def test_a_number_of_the_road_is_no_distance() -> None:
    reading = parse("slow down to thirty")
    assert reading.query.distance_m is None
    assert any("thirty" in note for note in reading.notes)
