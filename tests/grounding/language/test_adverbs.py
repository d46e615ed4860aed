"""Adverbs before a place: "right" is no turn there, and "not far from" no warning."""

import pytest

from grounding.language import parse

PLACES = {
    "go right opposite the van": ("approach", "opposite"),
    "head right in front of the third bike": ("approach", "in_front_of"),
    "drive right between the van and the bus": ("approach", "between"),
    "park just left of the green bike": ("park", "left_of"),
    "stop directly to the right of the van": ("stop", "right_of"),
}


@pytest.mark.parametrize("text", PLACES)
def test_the_grammar_reads_a_place(text: str) -> None:
    query = parse(text, revised=False).query
    assert (query.action, query.relation) == PLACES[text]
    assert query.direction is None


@pytest.mark.parametrize("text", ["go right after the van", "go right at the van", "head right past the church"])
def test_a_turn_stays_one(text: str) -> None:
    query = parse(text, revised=False).query
    assert (query.action, query.direction) == ("turn", "right")


@pytest.mark.parametrize("text", ["move not far from the car on the right", "stop not too far from the bus"])
def test_not_far_from_is_near(text: str) -> None:
    query = parse(text).query
    assert query.action != "avoid"
    assert query.relation == "near"
