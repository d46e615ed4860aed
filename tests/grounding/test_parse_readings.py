"""Several readings of a sentence, and why it has none."""

from __future__ import annotations

import json

import pytest

from grounding.language.parser import caret, read, readings
from grounding.language.tokenizer import MAX_CHARACTERS
from grounding.query import Query


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no words"),
        ("   \t ", "holds no words"),
        ("\U0001f697\U0001f697", "holds no words"),
        ("停在白色汽车后面", "no word of it is understood"),
        ("tell me a joke", "'tell me' is no driving action"),
        ("wash the silver car", "'wash' is no driving action"),
        ("what colour is the bus?", "a question"),
        ("when do we stop?", "a question"),
        ("is the van parked?", "a question"),
        ("the bus is red", "no driving action in it"),
        ("turn the music down", "no driving action"),
        ("turn on the lights", "no driving action"),
        ("stop the music", "no driving action"),
        ("pass me the salt", "no driving action"),
        ("get me a coffee", "no driving action"),
        ("let me tell you a story", "no driving action"),
        ("watch a movie", "no driving action"),
        ("follow me on twitter", "no driving action"),
        ("parj behind the van", "did you mean 'park behind the van'?"),
        ("park behind the car " * 600, f"expected at most {MAX_CHARACTERS} characters, got 12000"),
    ],
)
def test_what_is_no_command_gets_one_clear_line(text: str, message: str) -> None:
    (reading,) = readings(text)
    assert reading.problem is not None
    assert message in reading.problem.message
    assert "\n" not in reading.problem.message
    assert reading.query.action is None
    assert reading.query.to_dict()["status"] == "reject"
    assert len(reading.query.command) <= MAX_CHARACTERS


def test_caret_points_at_the_word() -> None:
    text = "Parj  behind the van"
    problem = read(text).problem
    assert problem is not None
    sentence, marks = caret(text, problem).splitlines()
    start = marks.index("^")
    assert sentence[start : start + marks.count("^")] == "parj"


def test_no_caret_for_the_whole_sentence() -> None:
    problem = read("the bus is red").problem
    assert problem is not None
    assert caret("the bus is red", problem) == ""


def others(text: str) -> list[Query]:
    """All readings but the first, best first."""
    found = readings(text)
    assert [one.score for one in found] == sorted((one.score for one in found), reverse=True)
    assert found[0].score == 0
    assert all(one.score < 0 for one in found[1:])
    return [one.query for one in found[1:]]


def test_a_side_may_be_that_of_the_road() -> None:
    (other,) = others("park behind the van on the left")
    assert other.goal_side == "left"
    assert other.referent is not None
    assert other.referent.qualifiers == ()
    assert others("follow the van on the left") == []


def test_a_bike_may_be_a_bicycle() -> None:
    (other,) = others("follow the bike")
    assert other.referent is not None
    assert (other.referent.noun, other.to_dict()["referent"]["noun_alt"]) == ("bicycle", ["bicycle"])


def test_a_landmark_may_belong_to_the_goal_or_to_the_vehicle() -> None:
    (other,) = others("park behind the van next to the tree")
    assert [mark.of for mark in other.secondary] == ["goal"]
    (other,) = others("park behind the van, next to the tree")
    assert {mark.of for mark in other.secondary} == {"referent"}


def test_ahead_may_be_said_of_the_place_or_of_the_vehicle() -> None:
    (other,) = others("park behind the van in front of us")
    assert other.referent is not None
    assert (other.referent.qualifiers, other.referent.qualifiers_optional) == ((), ("ahead",))
    (other,) = others("park up ahead behind the van")
    assert other.referent is not None
    assert (other.referent.qualifiers, other.referent.qualifiers_optional) == (("ahead",), ())


def test_six_readings_at_most() -> None:
    found = readings("park up ahead behind the bike on the left next to the tree, in front of us")
    assert len(found) == 6
    assert len({json.dumps(one.query.to_dict()) for one in found}) == 6
