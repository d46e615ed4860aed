"""Questions in everyday words: places that are too small, choices, what is beside "it", and what no map shows."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREEN, RED, WHITE, Street, told

from grounding.dialogue.session import Session


def drive() -> Session:
    """A row at the kerb of a blue, a red and a white car, a van ahead of us, a bus that comes, and a person."""
    street = Street().car("blue", 12, -6, BLUE).car("red", 24, -6, RED).car("white", 34, -6, WHITE)
    street.car("van", 20, 0, BLACK, speed_mps=4.0, size_wlh_m=(2.0, 5.2, 2.2))
    street.car(
        "bus", 30, 4, GREEN, yaw_rad=np.pi, speed_mps=6.0, size_wlh_m=(2.5, 11.0, 3.2), category="vehicle.bus.rigid"
    )
    street.car("person", 18, -7.5, WHITE, size_wlh_m=(0.6, 0.6, 1.7), category="human.pedestrian.adult")
    return street.grounder().session()


@pytest.mark.parametrize(
    "question",
    [
        "is it too short for us?",
        "is that spot too cramped?",
        "isn't the gap too narrow?",
        "are we too long for that?",
    ],
)
def test_a_place_with_room_is_not_too_small(question: str) -> None:
    session = drive()
    assert session.say("park behind the white car").status == "ok"
    assert told(session, question).startswith("no: there is room")


def test_a_place_without_room_is_too_small() -> None:
    session = Street().car("near", 12, -6, BLUE).car("next", 16.6, -6, RED).grounder().session()
    assert session.say("park behind the red car").question
    assert session.say("is it too small for our car?").reasons[0] == "yes"


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("how fast is one allowed to go here?", "signs, and the speed limit"),
        ("what's the highest speed on this road?", "signs, and the speed limit"),
        ("must we yield here?", "who has right of way"),
        ("do they have the right of way?", "who has right of way"),
        ("who is sitting in the van?", "who or what is in a vehicle"),
        ("what's inside that green bus?", "who or what is in a vehicle"),
        ("is it a hybrid?", "makes"),
        ("is it safe to get off here?", "rules of parking"),
        ("is there a chemist nearby?", "'chemist'"),
        ("do you see a petrol station?", "'petrol station'"),
        ("are there speed bumps?", "'speed bumps'"),
    ],
)
def test_what_no_map_shows_is_said_to_be_not_known(question: str, expected: str) -> None:
    session = drive()
    goal = session.say("park behind the white car").target
    answer = told(session, question)
    assert "not known here" in answer
    assert expected in answer
    assert session.goal is not None
    assert session.goal.target is goal


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("which is longer, the bus or the van?", ["green bus", "11.0 m long", "black van", "5.2 m long"]),
        ("is the van or the bus nearer?", ["black van", "green bus"]),
        ("which is the bus, the green thing or the black one?", ["green bus"]),
        ("what is further off, the red car or the white one?", ["red car", "white car"]),
    ],
)
def test_a_choice_is_told_of_each(question: str, expected: list[str]) -> None:
    answer = told(drive(), question)
    assert all(one in answer for one in expected)
    assert "blue car" not in answer


@pytest.mark.parametrize("question", ["is the van moving or parked?", "is the red car standing or driving?"])
def test_a_choice_is_not_answered_by_yes_or_no(question: str) -> None:
    assert told(drive(), question).startswith("the ")


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("what is behind it?", "blue car"),
        ("what's in front of it?", "white car"),
        ("what colour is the one in front of it?", "white car"),
        ("how far is the car behind that?", "blue car"),
        ("what is next to it?", "nothing is seen next to it"),
    ],
)
def test_it_is_the_vehicle_in_talk(question: str, expected: str) -> None:
    session = drive()
    assert "red car" in told(session, "do you see the red car?")
    answer = told(session, question)
    assert expected in answer
    assert "red car" not in answer


@pytest.mark.parametrize(
    "question",
    ["is anybody standing there?", "is someone walking about?", "who is crossing?", "anyone waiting here?"],
)
def test_somebody_on_foot_is_no_vehicle(question: str) -> None:
    answer = told(drive(), question)
    assert "person" in answer
    assert "car" not in answer


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("how many metres is it from us?", "23 m away"),
        ("how far is it from here?", "23 m away"),
        ("how many metres long is it?", "4.4 m long"),
        ("is it close?", "23 m away"),
        ("where is it going?", "it faces the same way"),
        ("does it face us?", "it faces the same way"),
        ("is it wider than us?", "we are"),
    ],
)
def test_what_is_measured_of_the_vehicle_in_talk(question: str, expected: str) -> None:
    session = drive()
    told(session, "do you see the red car?")
    assert expected in told(session, question)


@pytest.mark.parametrize("question", ["what colour is the one behind us?", "how fast is the one behind us going?"])
def test_the_one_at_a_place_is_of_any_class(question: str) -> None:
    session = (
        Street().car("van", 20, 0, BLACK, size_wlh_m=(2.0, 5.2, 2.2)).car("back", -12, 0, RED).grounder().session()
    )
    assert "black van" in told(session, "do you see the van?")
    assert "red car" in told(session, question)


def test_the_time_of_arrival() -> None:
    session = drive()
    session.say("park behind the white car")
    assert "the way to the goal is" in told(session, "when do we arrive?")
