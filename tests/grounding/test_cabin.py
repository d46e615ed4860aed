"""Wishes about the cabin and the lights: told to be not controlled here, and never taken for driving."""

from __future__ import annotations

import pytest
from street import RED, Street

from grounding.language.cabin import NOT_CONTROLLED, without_cabin
from grounding.language.parser import parse

WISHES = [
    "turn the radio up",
    "could you turn up the heating a bit",
    "open the window please",
    "turn off the lights",
    "flash your lights at him",
    "put the hazards on",
    "indicate left",
    "and pop the heating up a notch",
    "move my seat back a bit",
    "roll down the rear window",
]


@pytest.mark.parametrize("wish", WISHES)
def test_a_wish_about_the_cabin_is_no_command(wish: str) -> None:
    answer = Street().grounder().ground(wish)
    assert answer.status == "not_a_command"
    assert NOT_CONTROLLED in answer.reasons


@pytest.mark.parametrize("wish", WISHES)
def test_the_goal_stays(wish: str) -> None:
    session = Street().car("red", 20, -6, RED).grounder().session()
    goal = session.say("stop behind the red car").target
    assert session.say(wish).status == "not_a_command"
    assert session.goal is not None
    assert session.goal.target is goal


@pytest.mark.parametrize(
    ("text", "rest"),
    [
        ("turn left at the junction and turn the music down", "turn left at the junction"),
        ("turn the heating down a bit, then park behind the van", "park behind the van"),
        ("turn left, open the window and stop", "turn left and stop"),
        ("indicate right and pull over", "pull over"),
    ],
)
def test_the_other_clauses_are_read(text: str, rest: str) -> None:
    found = without_cabin(text)
    assert found is not None
    assert found[0] == rest
    reading, plain = parse(text), parse(rest)
    assert (reading.query.action, reading.query.direction) == (plain.query.action, plain.query.direction)
    assert any(NOT_CONTROLLED in note for note in reading.notes)


@pytest.mark.parametrize(
    "text", ["turn left at the lights", "stop at the lights", "turn off the road", "put me by the van", "turn around"]
)
def test_driving_is_no_wish_about_the_cabin(text: str) -> None:
    assert without_cabin(text) is None


def test_a_yes_beside_a_wish_is_heard() -> None:
    session = Street().car("one", 20, -6, RED).car("two", 32, -6, RED).grounder().session()
    session.say("stop behind the red car on the right")
    answer = session.say("the nearer one, and turn the radio down")
    assert answer.referent is not None
    assert answer.referent.item.id == "one"
    assert NOT_CONTROLLED in answer.reasons


@pytest.mark.parametrize(
    "text", ["pop up on the pavement beside the red car", "nip onto the pavement next to the red car"]
)
def test_the_pavement_stays_refused(text: str) -> None:
    assert Street().car("red", 20, -6, RED).grounder().ground(text).plan.refused


def test_a_class_that_is_named_is_not_widened() -> None:
    answer = (
        Street().car("red", 20, -6, RED).grounder().session().say("there's a red bus up there, tuck in behind it")
    )
    assert answer.status != "ok"
