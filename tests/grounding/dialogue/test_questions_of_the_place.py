"""Questions about how we get to the goal and stand there; the goal in force stays."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, RED, WHITE, Street, told

from grounding.dialogue.session import Session


def drive(command: str = "park behind the white car") -> Session:
    """A gap between a blue and a white car at the right kerb, a red van ahead, a black car behind us."""
    street = Street().car("blue", 10, -6.8, BLUE).car("white", 24, -6.8, WHITE).car("black", -12, 0, BLACK)
    street.car("van", 36, 0, RED, size_wlh_m=(2.0, 5.0, 2.2))
    session = street.grounder().session()
    assert session.say(command).status == "ok"
    return session


@pytest.mark.parametrize(
    ("command", "question", "expected"),
    [
        ("park behind the white car", "are you going to block the road?", "no: the place is at the edge"),
        ("park behind the white car", "is that at the side of the road?", "yes: the place is at the edge"),
        ("stop next to the blue car", "will we be in the way there?", "yes: the place is in the road"),
        ("stop next to the blue car", "is that in the middle of the road?", "yes: the place is in the road"),
        ("stop next to the blue car", "will we be at the kerb?", "no: the place is in the road"),
        ("park behind the blue car", "do we have to reverse into it?", "yes: "),
        ("stop here", "will you have to back up?", "no: the way there goes forwards only"),
        ("stop here", "why do we have to reverse?", "no: the way there goes forwards only"),
        ("park behind the white car", "how close will we be?", "m from the white car"),
        ("park behind the white car", "how far behind?", "m from the white car"),
        ("park behind the white car", "is there a car behind that spot?", "yes: the blue car"),
        ("park behind the white car", "what will be in front of us there?", "white car"),
        ("park behind the white car", "how much room is there to the car in front then?", "the gap is"),
        ("stop next to the blue car", "is there enough room for the door to open?", "on our right: "),
        ("stop next to the blue car", "can i open the door there?", "to the blue car"),
        ("stop next to the blue car", "can everyone get out there?", "to the blue car"),
        ("stop next to the blue car", "could the others still get past us?", "others have to drive around us"),
        ("stop next to the blue car", "how much space is at the side?", "on our left: "),
        ("stop next to the blue car", "how close do we get to it?", "m from the blue car"),
        ("stop next to the blue car", "is it better behind or in front?", "in front: "),
    ],
)
def test_how_we_stand_is_told(command: str, question: str, expected: str) -> None:
    session = drive(command)
    goal = session.goal
    assert goal is not None
    assert expected in told(session, question)
    assert session.goal is not None
    assert session.goal.target is goal.target


def test_it_is_the_place_that_was_asked_about() -> None:
    session = drive()
    session.say("is that the gap you meant?")
    assert "blue car" in told(session, "is anything parked behind it?")


def test_a_place_that_is_asked_about_can_be_taken() -> None:
    session = drive("stop here")
    assert told(session, "what's wrong with the gap behind the white car?").startswith("nothing: there is room")
    target = session.say("can we use that one?").target
    assert target is not None
    assert target.ego_m[1] < -4


def test_changes_of_others_are_told_to_be_unknown() -> None:
    assert "whether it gets faster or slower" in told(drive("stop here"), "is the red van slowing down?")


def test_the_road_ahead_is_told_to_be_unknown() -> None:
    assert "how the road goes on" in told(drive("stop here"), "which way does the road go?")


def test_the_pavement_is_not_agreed_to() -> None:
    session = drive()
    assert session.say("use the pavement if you have to").plan.refused


def test_a_gap_to_another_vehicle_offers_no_place() -> None:
    session = drive()
    assert "m from the blue car" in told(session, "how much gap is there till the blue car")
    assert not session.proposes
