"""Questions about two vehicles: how far they are apart, whether we fit between them, and how they compare."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, GREEN, RED, WHITE, Street, told

from grounding.dialogue.session import Session


def drive() -> Session:
    """A row at the kerb of a blue, a white and a red car with a long gap, a van across the road, a car behind us."""
    street = Street().car("blue", 12, -6, BLUE).car("white", 18, -6, WHITE).car("red", 32, -6, RED)
    street.car("van", 14, 6, GREEN, size_wlh_m=(2.0, 5.2, 2.2)).car("black", -12, 0, BLACK, speed_mps=3.0)
    return street.grounder().session()


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("how far is it from the blue car to the red car?", "15.6 m from the blue car"),
        ("what's the distance from the red one to the white car?", "9.6 m from the red car"),
        ("how long is the gap between the red car and the one behind it?", "9.6 m from the red car"),
        ("how much space is there between the white car and the red one?", "there is room for us"),
        ("how wide is the gap between the blue car and the white car?", "there is no room for us"),
        ("is there room between the blue car and the white one?", "1.6 m apart, we are"),
    ],
)
def test_how_far_two_vehicles_are_apart(question: str, expected: str) -> None:
    assert expected in told(drive(), question)


def test_a_gap_between_two_vehicles_can_be_taken() -> None:
    session = drive()
    told(session, "how big is the gap between the white car and the red car?")
    assert session.say("ok, take it").target is not None


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("which is closer, the blue car or the van?", "blue"),
        ("is the red car nearer than the white car?", "no: nearer is the white"),
        ("who is farther away, the red car or the blue one?", "farther is the red"),
    ],
)
def test_two_things_are_compared(text: str, first: str) -> None:
    assert first in told(drive(), text)


def test_it_is_the_one_that_is_more_so() -> None:
    talk = drive()
    told(talk, "which is farther, the red car or the blue one?")
    answer = talk.say("stop next to it")
    assert answer.referent is not None
    assert answer.referent.item.id == "red"
