"""Turns about who was told to come, who stands at a vehicle, and where we stand now."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, GREY, RED, WHITE, YELLOW, Street, told


def lanes() -> Street:
    """Two lanes of our way with a white car ahead, a red one that comes up in the right lane, and a full kerb."""
    return (
        Street()
        .car("white", 22, 0.0, WHITE, 0.0, 4.0)
        .car("red", -16, -3.2, RED, 0.0, 9.0)
        .car("yellow", 14, -6.5, YELLOW)
        .car("truck", 24, -6.3, BLACK, size_wlh_m=(2.4, 7.0, 3.0), category="vehicle.truck")
        .car("blue", 33, -6.5, BLUE)
    )


@pytest.mark.parametrize(
    "turn",
    [
        "wait for them to pass and then change lanes to the right",
        "let it go first and then change lanes to the right",
        "okay after it's past, change lanes to the right",
        "once it has gone, change lanes to the right",
    ],
)
def test_who_was_told_to_come_is_awaited(turn: str) -> None:
    session = lanes().grounder().session()
    assert "yes" in told(session, "is anyone coming from behind?")
    answer = session.say(turn)
    assert answer.status == "ok", answer.text()
    wait, change = answer.steps
    assert wait.referent is not None
    assert wait.referent.item.id == "red"
    assert change.query.action == "change_lane"


def test_who_comes_is_what_it_means() -> None:
    session = lanes().grounder().session()
    session.say("is anyone coming from behind?")
    assert "red car" in told(session, "how fast is it going?")


@pytest.mark.parametrize(
    ("question", "vehicle"),
    [
        ("who is parked in front of the black truck?", "blue car"),
        ("what's parked behind the black truck?", "yellow car"),
        ("who is standing in front of the yellow car?", "black truck"),
    ],
)
def test_who_stands_at_a_vehicle_is_another_one(question: str, vehicle: str) -> None:
    assert vehicle in told(lanes().grounder().session(), question)


def test_the_one_before_a_parked_car_is_the_next_of_its_row() -> None:
    session = lanes().grounder().session()
    session.say("let me out by the blue car")
    answer = session.say("actually the one before it")
    assert answer.referent is not None
    assert answer.referent.item.id == "truck"


def test_when_it_is_clear_agrees_with_a_change_of_lanes() -> None:
    session = lanes().grounder().session()
    first = session.say("change lanes to the right")
    answer = session.say("okay, do it when it's clear")
    assert answer.status == "ok"
    assert len(answer.steps) <= 1
    assert answer.target is not None
    assert first.target is not None
    assert answer.target.cell == first.target.cell


def test_a_number_before_several_things_is_a_number() -> None:
    street = Street().car("first", 12, -6.5, GREY).car("second", 24, -6.5, GREY).car("third", 36, -6.5, GREY)
    grounder = street.grounder()
    digits, word = (grounder.ground(f"go past the next {two} cars") for two in ("2", "two"))
    assert digits.target is not None
    assert word.target is not None
    assert digits.target.cell == word.target.cell


@pytest.mark.parametrize("question", ["would it be safe to get out here?", "can I open my door?"])
def test_doors_where_we_stand(question: str) -> None:
    street = Street().car("beside", 1.0, -2.5, GREY)
    grounder = street.grounder()
    grounder.set_scene(street.bev(), street.boxes(), speed_mps=0.0)
    answer = told(grounder.session(), question)
    assert "yes, on our left only" in answer
    grounder.set_scene(street.bev(), street.boxes(), speed_mps=8.0)
    assert "not known" in told(grounder.session(), question)


def test_nobody_gets_out_beside_who_drives_past() -> None:
    street = Street().car("passing", 1.0, 2.8, GREY, 0.0, 8.0)
    grounder = street.grounder()
    grounder.set_scene(street.bev(), street.boxes(), speed_mps=0.0)
    assert "yes, on our right only" in told(grounder.session(), "is it safe to open my door?")


def test_where_there_is_no_spot_another_place_is_offered() -> None:
    street = Street()
    for number in range(9):
        street.car(f"p{number}", -8 + 5.4 * number, -6.9, BLACK)
    session = street.grounder().session()
    assert "no" in told(session, "is there anywhere to park on the right?")
    assert session.question
    assert session.say("ok take it").target is not None


@pytest.mark.parametrize("turn", ["pick him up", "go and pick him up please"])
def test_who_was_seen_is_picked_up(turn: str) -> None:
    size, category = (0.6, 0.6, 1.8), "human.pedestrian.adult"
    session = Street().car("man", 24, -7, GREY, 0.0, 1.0, size, category).grounder().session()
    assert "yes" in told(session, "can you see the man walking on the right?")
    answer = session.say(turn)
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "man"


def test_go_for_it_agrees_with_a_change_of_lanes() -> None:
    session = lanes().grounder().session()
    session.say("we should be in the right lane")
    answer = session.say("ok go for it")
    assert len(answer.steps) < 2
    assert "the goal stays as it is" in answer.reasons


@pytest.mark.parametrize("question", ["which blue car do you mean?", "what car do you have in mind?"])
def test_which_one_is_meant_is_the_one_of_the_goal(question: str) -> None:
    street = lanes().car("near", 4, -6.5, BLUE)
    session = street.grounder().session()
    session.say("stop behind the blue car at the end of the row")
    session.say("the far one")
    assert session.goal is not None
    goal = session.goal
    answer = session.say(question)
    assert answer.referent is not None
    assert goal.referent is not None
    assert answer.referent.item.id == goal.referent.item.id
