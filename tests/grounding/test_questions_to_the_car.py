"""Questions to the car: the scene and the plan answer them, and what is not known is said to be so."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREY, RED, WHITE, Street, told

from grounding.dialogue.session import Session
from grounding.language.questions import read_question


def drive() -> Session:
    """A bus ahead of us in our lane, a gap between a blue and a white car at the kerb, a car behind us."""
    street = Street().car("bus", 26, 0, RED, speed_mps=2.0, size_wlh_m=(2.5, 11.0, 3.2), category="vehicle.bus.rigid")
    street.car("blue", 10, -6, BLUE).car("white", 22, -6, WHITE).car("back", -12, 0, BLACK, speed_mps=3.0)
    street.car("facing", 30, 5, GREY, yaw_rad=np.pi).car("grey", 36, 5, GREY, yaw_rad=np.pi)
    return street.grounder().session()


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("my daughter wants to know how long the bus is", "red bus 25 m away"),
        ("how long is that bus?", "11.0 m long, 2.5 m wide, 3.2 m high"),
        ("hey how far off is the bus", "25 m away"),
        ("is the bus moving again?", "yes: the red bus"),
        ("is the white car parked?", "yes: the white car"),
        ("is the blue car moving?", "no: the blue car"),
        ("how fast is the bus going?", "moving at 2 m/s"),
        ("which way is the blue car facing?", "it faces the same way as we do now"),
        ("are there two grey ones next to each other?", "yes: the grey car"),
        ("who is behind us?", "black car"),
        ("could you tell me where the white car is", "white car"),
        ("is the road clear?", "ahead of us: the red bus"),
    ],
)
def test_what_is_asked_of_a_vehicle_is_told_and_the_goal_stays(question: str, expected: str) -> None:
    session = drive()
    goal = session.say("stop behind the white car").target
    assert expected in told(session, question)
    assert session.goal is not None
    assert session.goal.target is goal


def test_it_is_the_vehicle_that_was_asked_about() -> None:
    session = drive()
    session.say("stop behind the white car")
    assert told(session, "what do you see in front of us?").startswith("5 fit")
    assert "blue car" in told(session, "how wide is the blue car?")
    assert "4.4 m long" in told(session, "and how long is it?")
    assert told(session, "is it the same blue car as before").startswith("yes")


@pytest.mark.parametrize(
    "question",
    ["why are we crawling like this?", "what are we waiting for?", "why arent you moving", "what's the hold-up?"],
)
def test_who_is_ahead_holds_us_up(question: str) -> None:
    session = drive()
    session.say("carry on")
    assert "ahead of us: the red bus" in told(session, question)


@pytest.mark.parametrize(
    "question",
    [
        *("is the light green?", "what's the speed limit here?", "is it going to rain?", "whose car is that"),
        *(
            "where are we?",
            "how fast are we going?",
            "do we have to wait long?",
            "is that allowed there?",
            "why is the bus so slow?",
        ),
    ],
)
def test_what_is_not_known_is_said_to_be_so(question: str) -> None:
    session = drive()
    session.say("stop behind the white car")
    assert "that is not known here" in told(session, question)


def test_the_gap_and_the_way_at_the_goal() -> None:
    session = drive()
    session.say("park between the blue car and the white car")
    assert "the gap is 7.6 m long" in told(session, "looks good. how big is the gap?")
    assert "the way to the goal is" in told(session, "how long will it take")


def test_room_at_another_vehicle_is_not_that_at_the_goal() -> None:
    session = drive()
    session.say("stop behind the white car")
    assert told(session, "hmm actually is there more room after the blue car?").startswith("yes; 'blue car'")
    answer = session.say("ok do that")
    assert answer.referent is not None
    assert answer.referent.item.id == "blue"


def test_an_offer_stays_open_when_its_room_is_asked_about() -> None:
    street = Street().car("near", 12, -6, BLUE).car("next", 16.6, -6, RED)
    session = street.grounder().session()
    offer = session.say("park behind the red car")
    assert (offer.status, bool(offer.question)) == ("ambiguous", True)
    answer = session.say("is there enough room?")
    assert (answer.reasons[0], answer.question) == ("no", offer.question)


def test_the_steps_are_read_out() -> None:
    session = drive()
    session.say("stop behind the blue car")
    session.say("and then stop behind the white car")
    for question in ("read me the list", "where are we going?"):
        assert told(session, question).startswith("step 1: stop behind the blue car")


@pytest.mark.parametrize("text", ["did you see that car stop behind the white one", "is there a white car?"])
def test_a_question_alone_is_answered_and_no_command(text: str) -> None:
    street = Street().car("white", 22, -5, WHITE).car("red", 34, -5, RED)
    answer = street.grounder().ground(text)
    assert (answer.status, answer.target) == ("not_a_command", None)
    assert "car" in answer.reasons[0]


@pytest.mark.parametrize(
    "text",
    [
        *("could you stop behind the van?", "can we park there?", "is it ok if you park on the left?"),
        *("why don't you stop there?", "do you see the blue car stop next to it", "any chance you could stop here?"),
        *(
            "how about behind the red one?",
            "what about the blue one?",
            "what we had before",
            "what else have you got",
        ),
        *("Why, the one in the oncoming lane", "is he stopped the truck is stopped okay go around him"),
        *("when we're done there go to the truck", "where the van is", "would you mind waiting here?"),
    ],
)
def test_a_wish_in_the_form_of_a_question_is_none(text: str) -> None:
    assert read_question(text) is None


def test_another_noun_is_not_like_what_was_sought() -> None:
    """Neither the colour nor the class of what was not found is part of the next question."""
    session = Street().car("w", 14, -5, WHITE).car("b", 24, -5, BLUE).grounder().session()
    assert session.say("stop next to the yellow minibus").status != "ok"
    told = session.say("what cars can you see on our side?")
    assert told.status == "ok"
    assert "white car" in told.text()
    assert "blue car" in told.text()
