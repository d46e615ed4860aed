"""Questions that take what they lack from the question before, and questions after other words; the goal stays."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, GREEN, RED, WHITE, Street, told

from grounding.dialogue.session import Session


def drive() -> Session:
    """A blue, a white and a red car at the right kerb ahead, a green car across the road, a black car behind us."""
    street = Street().car("blue", 10, -6, BLUE).car("white", 22, -6, WHITE).car("red", 34, -6, RED)
    street.car("green", 16, 6, GREEN, yaw_rad=3.14).car("black", -12, 0, BLACK, speed_mps=3.0)
    return street.grounder().session()


def say(*turns: str) -> str:
    """What is told at the last turn of a conversation."""
    session = drive()
    for turn in turns[:-1]:
        session.say(turn)
    return told(session, turns[-1])


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        (("what's ahead of us?", "and behind us?"), "black car"),
        (("what's ahead?", "and behind?"), "black car"),
        (("what's ahead of us?", "what about behind us?"), "black car"),
        (("what is on the right?", "and on the left?"), "green car"),
        (("are there any blue cars?", "and red ones?"), "red car"),
        (("what's ahead of us?", "i mean just the ones behind us"), "black car"),
        (("is there a car on the left?", "behind us i mean"), "black car"),
        (("what's behind the white car?", "and in front of it?"), "red car"),
        (("what's ahead of us on the right?", "which one is the furthest away?"), "red car"),
        (("how many cars are on the right?", "which one is the nearest?", "and the second nearest?"), "white car"),
        (("is there a red car?", "how far is it?", "and the green one?"), "green car"),
        (("how many cars are there?", "the second nearest one?"), "car"),
        (("what's the blue car?", "and after that one?"), "white car"),
        (("how far's the red car?", "and what stands between?"), "2 seen"),
        (("park by the red car", "what else do you see ahead?"), "blue car"),
    ],
)
def test_a_question_is_followed_up(turns: tuple[str, ...], expected: str) -> None:
    answer = say(*turns)
    assert expected in answer
    assert "do you mean" not in answer


def test_what_is_corrected_to_people_is_no_vehicle() -> None:
    assert "car" not in say("is there someone on the left?", "i mean a person")


@pytest.mark.parametrize("fragment", ["and the one behind that?", "the one after that?", "and the yellow one?"])
def test_no_command_is_guessed_from_a_question(fragment: str) -> None:
    session = drive()
    session.say("what's that on the left?")
    assert session.say(fragment).target is None
    assert "do you mean" not in session.question


@pytest.mark.parametrize(
    "text",
    [
        "list all the cars behind us",
        "show me everything you see behind us",
        "tell me all the vehicles behind us",
        "what do you see behind",
    ],
)
def test_a_list_is_of_its_place(text: str) -> None:
    answer = say(text)
    assert "black car" in answer
    assert "blue car" not in answer


@pytest.mark.parametrize(
    "text",
    [
        "ok thats better. whats behind us?",
        "right you are. what is behind us?",
        "hi there, what's behind us?",
        "no no i was only asking. what's behind us?",
    ],
)
def test_words_before_a_question_do_not_hide_it(text: str) -> None:
    answer = say("stop behind the white car", text)
    assert "black car" in answer
    assert "red car" not in answer


@pytest.mark.parametrize("text", ["what about the red car?", "and what about the green car on the left?"])
def test_another_vehicle_is_told_and_the_goal_stays(text: str) -> None:
    session = drive()
    goal = session.say("stop next to the blue car").target
    answer = told(session, text)
    assert "the goal stays" in answer
    assert session.goal is not None
    assert session.goal.target is goal


def test_another_vehicle_is_taken_once_it_is_agreed_to() -> None:
    session = drive()
    session.say("stop next to the blue car")
    session.say("what about the red car?")
    assert session.proposes
    taken = session.say("yes").target
    assert taken is not None
    assert taken.ego_m[0] == pytest.approx(34, abs=2)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("what is between us and the red car?", "2 seen"),
        ("how far apart are the blue car and the white car?", "7.6 m"),
        ("what's between the blue car and the red car?", "white car"),
    ],
)
def test_two_things_are_told_of(text: str, expected: str) -> None:
    assert expected in say(text)


def test_what_is_in_between_is_up_to_what_was_asked_about() -> None:
    assert "blue car" in say("how far is it to the white car?", "and what's in between?")


@pytest.mark.parametrize(
    "text", ["what speed are we doing now?", "what's our current speed?", "how fast am i going?", "and our speed?"]
)
def test_our_own_speed_is_not_known(text: str) -> None:
    assert "not known here: our own speed" in say("slow down a bit", text)


def test_a_place_after_a_question_is_a_place_to_go_to() -> None:
    session = drive()
    session.say("stop between the blue car and the white car")
    told(session, "is anything parked after the red car?")
    assert session.say("just behind the white car then").target is not None
