"""Questions of passengers about the goal, free places and who is in the way; the goal in force stays."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, RED, WHITE, Street, told

from grounding.dialogue.session import Session


def drive() -> Session:
    """A gap between a blue and a white car at the kerb, a red van ahead of us in our lane, a black car behind us."""
    street = Street().car("blue", 10, -6, BLUE).car("white", 24, -6, WHITE).car("back", -12, 0, BLACK, speed_mps=3.0)
    street.car("van", 36, 0, RED, size_wlh_m=(2.0, 5.0, 2.2))
    return street.grounder().session()


def park() -> Session:
    """The goal in that gap is in force."""
    session = drive()
    assert session.say("park behind the white car").status == "ok"
    return session


@pytest.mark.parametrize(
    "question",
    [
        "remind us once more where we stop",
        "tell us once again what you are planning",
        "could you quickly tell me what we are up to",
        "can you remind me once more where you are heading",
    ],
)
def test_the_plan_is_told_again(question: str) -> None:
    session = park()
    assert told(session, question).startswith("park behind the white car")
    assert session.say("warn me once we are past it").status == "not_a_command"


def test_a_time_in_the_order_of_a_statement_is_told() -> None:
    assert "the way to the goal is" in told(park(), "do you know how long that will take")
