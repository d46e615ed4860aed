"""Alternative readings of a sentence, and problems of sentences without one."""

from __future__ import annotations

import json

import pytest

from grounding.language import MAX_CHARACTERS, parse, parse_all, underline
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
        ("turn the music down", "not controlled here"),
        ("turn on the lights", "not controlled here"),
        ("stop the music", "no driving action"),
        ("pass me the salt", "no driving action"),
        ("get me a coffee", "no driving action"),
        ("let me tell you a story", "no driving action"),
        ("watch a movie", "no driving action"),
        ("follow me on twitter", "no driving action"),
        ("pprrk behind the van", "did you mean 'park behind the van'?"),
        ("park behind the car " * 600, f"expected at most {MAX_CHARACTERS} characters, got 12000"),
    ],
)
def test_problems_are_one_line(text: str, message: str) -> None:
    (reading,) = parse_all(text)
    assert reading.problem is not None
    assert message in reading.problem.message
    assert "\n" not in reading.problem.message
    assert reading.query.action is None
    assert reading.query.to_dict()["status"] == "reject"
    assert len(reading.query.command) <= MAX_CHARACTERS


def test_the_misspelt_word_is_underlined() -> None:
    text = "Pprrk  behind the van"
    problem = parse(text).problem
    assert problem is not None
    sentence, marks = underline(text, problem).splitlines()
    start = marks.index("^")
    assert sentence[start : start + marks.count("^")] == "pprrk"


def test_a_problem_of_the_whole_sentence_is_not_underlined() -> None:
    problem = parse("the bus is red").problem
    assert problem is not None
    assert underline("the bus is red", problem) == ""


def alternatives(text: str) -> list[Query]:
    """Return the queries of all readings but the first, best first."""
    found = parse_all(text)
    assert [one.score for one in found] == sorted((one.score for one in found), reverse=True)
    assert found[0].score == 0
    assert all(one.score < 0 for one in found[1:])
    return [one.query for one in found[1:]]


def test_a_side_of_the_vehicle_or_of_the_road() -> None:
    (other,) = alternatives("park behind the van on the left")
    assert other.goal_side == "left"
    assert other.referent is not None
    assert other.referent.qualifiers == ()
    assert alternatives("follow the van on the left") == []


def test_a_bike_is_a_motorcycle_or_a_bicycle() -> None:
    (other,) = alternatives("follow the bike")
    assert other.referent is not None
    assert (other.referent.noun, other.to_dict()["referent"]["noun_alt"]) == ("bicycle", ["bicycle"])


def test_a_landmark_of_the_goal_or_of_the_vehicle() -> None:
    (other,) = alternatives("park behind the van next to the tree")
    assert [mark.of for mark in other.secondary] == ["goal"]
    (other,) = alternatives("park behind the van, next to the tree")
    assert {mark.of for mark in other.secondary} == {"referent"}


def test_ahead_qualifies_the_goal_or_the_vehicle() -> None:
    (other,) = alternatives("park behind the van in front of us")
    assert other.referent is not None
    assert (other.referent.qualifiers, other.referent.qualifiers_optional) == ((), ("ahead",))
    (other,) = alternatives("park up ahead behind the van")
    assert other.referent is not None
    assert (other.referent.qualifiers, other.referent.qualifiers_optional) == (("ahead",), ())


def test_at_most_six_readings() -> None:
    found = parse_all("park up ahead behind the bike on the left next to the tree, in front of us")
    assert len(found) == 6
    assert len({json.dumps(one.query.to_dict()) for one in found}) == 6
