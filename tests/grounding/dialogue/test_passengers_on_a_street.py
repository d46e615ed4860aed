"""Turns of passengers on a busy street: who waits where, who passes, until we are level, and what was told."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREY, RED, WHITE, YELLOW, Street, told


def row() -> Street:
    """A yellow car, a black truck and a white van at the right kerb."""
    return (
        Street()
        .car("yellow", 12, -6.5, YELLOW)
        .car("truck", 26, -6.3, BLACK, size_wlh_m=(2.4, 7.0, 3.0), category="vehicle.truck")
        .car("van", 38, -6.4, WHITE, size_wlh_m=(2.0, 5.4, 2.4))
    )


@pytest.mark.parametrize(
    ("first", "turn", "x_m"),
    [
        ("pull over for my friend", "she's standing by the yellow car", 12),
        ("stop on the right", "he's waiting next to the black truck", 26),
        ("pick me up on the right", "I'm right by the yellow car", 12),
    ],
)
def test_who_waits_for_us_tells_where(first: str, turn: str, x_m: float) -> None:
    session = row().grounder().session()
    session.say(first)
    answer = session.say(turn)
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert abs(answer.target.ego_m[0] - x_m) < 9


def test_a_friend_is_at_the_vehicle_where_nobody_is_seen() -> None:
    size, category = (0.6, 0.6, 1.8), "human.pedestrian.adult"
    street = row().car("stranger", 44, -7, GREY, 0.0, 1.0, size, category)
    answer = street.grounder().ground("pick up my friend, she's by the yellow car")
    assert answer.referent is not None
    assert answer.referent.item.id == "yellow"


def test_forward_until_we_are_level_is_a_place() -> None:
    session = row().grounder().session()
    told(session, "stop behind the yellow car")
    answer = session.say("come forward till we are just next to it")
    assert answer.target is not None
    assert abs(answer.target.ego_m[0] - 12) < 2


def test_too_far_is_more_than_a_bit() -> None:
    session = Street().grounder().session()
    far = session.say("stop 30 metres ahead").target
    near = session.say("that's too far, stop closer").target
    assert far is not None
    assert near is not None
    assert far.ego_m[0] - near.ego_m[0] > 5


def test_between_the_two_that_were_told() -> None:
    session = row().grounder().session()
    told(session, "how far is it from the yellow car to the black truck?")
    answer = session.say("stop between the two")
    assert answer.target is not None
    assert 12 < answer.target.ego_m[0] < 26


def test_who_comes_is_to_pass_first() -> None:
    street = Street().car("slow", 18, 0, WHITE, speed_mps=3).car("beside", 2, 3.5, GREY, speed_mps=8)
    session = street.grounder().session()
    told(session, "overtake the white car")
    assert "beside us: the grey car" in told(session, "is anyone coming up on the left behind us?")
    answer = session.say("okay go after that one has passed")
    assert [step.query.action for step in answer.steps] == ["wait", "overtake"]
    assert answer.steps[0].referent is not None
    assert answer.steps[0].referent.item.id == "beside"


def test_who_was_told_to_come_is_awaited_without_a_goal() -> None:
    session = Street().car("red", 25, 4, RED, np.pi, 9).car("black", 10, -6, BLACK).grounder().session()
    assert told(session, "what colour is the car that is coming towards us?").startswith("the red car")
    answer = session.say("wait till it's past")
    assert answer.pace == "standing"
    assert answer.referent is not None
    assert answer.referent.item.id == "red"


def test_done_and_on_with_a_question_open() -> None:
    session = row().grounder().session()
    assert session.say("pull up right next to him").status == "ambiguous"
    answer = session.say("ok done, carry on")
    assert answer.status == "ok"
    assert answer.query.manoeuvre == "onward"


def test_a_wait_at_the_place_that_was_agreed_to() -> None:
    street = Street()
    for number in range(12):
        street.car(f"p{number}", -8 + 5.4 * number, -6.9, YELLOW)
    session = street.grounder().session()
    session.say("pull over")
    agreed = session.say("yes").target
    waiting = session.say("wonderful, wait there").target
    assert agreed is not None
    assert waiting is not None
    assert agreed.cell == waiting.cell


def test_a_fallback_is_taken_where_there_was_no_room() -> None:
    street = Street().car("yellow", 14, -6.5, YELLOW).car("close", 19, -6.5, BLUE)
    session = street.grounder().session()
    assert "there is no room" in told(session, "stop in front of the yellow car")
    answer = session.say("well, if there is no space, just stop beside it in our lane")
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert abs(answer.target.ego_m[0] - 14) < 2


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("which is closer, the yellow car or the truck", "nearer is the yellow car"),
        ("is there a van or a truck around here?", "the white van"),
        ("where could I get out around here?", "at the right edge"),
        ("tell me the colours of the ones parked on the right", "yellow"),
        ("that yellow one, have we passed it?", "the yellow car"),
    ],
)
def test_questions_as_they_are_spoken(question: str, answer: str) -> None:
    assert answer in told(row().grounder().session(), question)


def test_room_at_each_of_several_and_only_in_the_road() -> None:
    street = Street().car("one", 12, -6.9, WHITE).car("two", 30, -6.9, WHITE).car("tail", 25.4, -6.9, RED)
    session = street.grounder().session()
    told(session, "are there any white cars parked ahead?")
    both = told(session, "which of them has more room behind it?")
    assert "yes, if the white car" in both
    assert "no, if the white car" in both


def test_the_distance_of_the_place_to_a_vehicle() -> None:
    session = (
        Street().car("truck", 20, -6.5, BLACK, size_wlh_m=(2.4, 7, 3), category="vehicle.truck").grounder().session()
    )
    told(session, "stop at the kerb on the right")
    assert "the place is" in told(session, "how far from the truck would that be?")


def test_how_old_people_are_is_not_known() -> None:
    street = Street().car("someone", 14, -7.2, GREY, 0.0, 0.0, (0.6, 0.6, 1.4), "human.pedestrian.adult")
    assert "how old" in told(street.grounder().session(), "are there any kids near the road?")
