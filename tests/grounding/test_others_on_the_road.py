"""Others on the road: who is let by, who is merged behind, people in a group, and what is asked about them."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREY, WHITE, YELLOW, Street, told

from appocc.geometry import footprints
from grounding.grounder import Grounder

PERSON = "human.pedestrian.adult"


def with_person(street: Street, name: str, x_m: float, y_m: float, speed_mps: float = 0.0) -> Street:
    return street.car(name, x_m, y_m, GREY, 0.0, speed_mps, (0.6, 0.6, 1.7), PERSON)


def traffic() -> Street:
    """A grey car that comes up on our left, a parked one and one that drives away, and a slow white car ahead."""
    return (
        Street()
        .car("comes", -7, 3.5, GREY, speed_mps=9)
        .car("parked", 7, -6, GREY)
        .car("away", 34, 3.5, GREY, speed_mps=5)
        .car("ahead", 22, 0, WHITE, speed_mps=5)
    )


@pytest.mark.parametrize(
    "command", ["let the grey car by first", "wait until the grey car has gone past, then move over to the left"]
)
def test_who_comes_up_behind_us_is_let_by(command: str) -> None:
    answer = traffic().grounder().ground(command)
    assert answer.status == "ok", answer.text()
    first = answer.steps[0] if answer.steps else answer
    assert first.referent is not None
    assert first.referent.item.id == "comes"


@pytest.mark.parametrize("x_m", [14.0, 18.0, 22.0])
def test_a_place_behind_who_drives_in_the_next_lane_is_behind_where_it_is_now(x_m: float) -> None:
    street = Street().car("beside", x_m, 3.5, BLACK, speed_mps=8)
    answer = street.grounder().ground("get in behind the black car in the left lane")
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert abs(answer.target.ego_m[1] - 3.5) < 1
    assert 6 < answer.target.ego_m[0] < x_m


def test_staying_in_our_lane_until_a_stop_is_no_step_of_its_own() -> None:
    street = Street().car("black", 12, -6, BLACK)
    answer = street.grounder().ground("stay in our lane and stop next to the black car")
    assert answer.status == "ok", answer.text()
    assert len(answer.steps) == 1
    assert answer.target is not None
    assert abs(answer.target.ego_m[0] - 12) < 2


def test_the_place_in_front_of_a_vehicle_says_that_it_is_passed() -> None:
    street = Street().car("blue", 14, -4.5, BLUE)
    answer = street.grounder().ground("pass the blue car and stop in front of it")
    assert answer.status == "ok", answer.text()
    assert len(answer.steps) == 1
    assert answer.target is not None
    assert answer.target.ego_m[0] > 14


def test_people_are_those_who_stand_together() -> None:
    street = Street()
    for name, x_m, y_m in (("alone", 12, 6.5), ("one", 18, 6.8), ("two", 19.5, 6.4)):
        with_person(street, name, x_m, y_m)
    answer = street.grounder().ground("stop next to those people on the left")
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id in ("one", "two")


def test_turning_back_to_a_vehicle_behind_us_ends_beside_it() -> None:
    street = Street().car("blue", -16, -6, BLUE)
    answer = street.grounder().ground("turn around at the blue car behind us")
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert answer.target.ego_m[0] < -9
    assert np.cos(answer.target.heading_ego_rad) < 0


def test_who_is_nearer_than_the_distance_to_keep_is_told() -> None:
    answer = Street().car("black", 6.5, 0, BLACK).grounder().ground("stay well back from the black car in front")
    assert answer.status == "ok", answer.text()
    assert any("already" in reason for reason in answer.reasons)
    assert not any("5 m short of it, " in reason for reason in answer.reasons)


QUESTIONS = [
    ("what about the grey one behind us, is it parked?", "no: the grey car 9 m away, behind left, moving at 9 m/s"),
    ("that white car ahead, how fast is it going?", "the white car 21 m away, ahead, moving at 5 m/s"),
    ("is the white car waiting for somebody?", "that is not known here: what others wait for"),
    ("how much room is there between us and the white car?", "from us to the white car"),
]


@pytest.mark.parametrize(("question", "answer"), QUESTIONS)
def test_questions_about_others(question: str, answer: str) -> None:
    assert answer in told(traffic().grounder().session(), question)


@pytest.mark.parametrize(
    ("speed_mps", "question", "answer"),
    [
        (2.0, "is the white car faster than us?", "yes: the white car"),
        (9.0, "is the white car faster than we are?", "no: the white car"),
        (9.0, "is the white car slower than us?", "yes: the white car"),
        (None, "is the white car faster than us?", "that is not known here: our own speed"),
    ],
)
def test_others_are_compared_with_our_own_speed(speed_mps: float | None, question: str, answer: str) -> None:
    street, grounder = traffic(), Grounder()
    grounder.set_scene(street.bev(), street.boxes(), speed_mps=speed_mps)
    assert told(grounder.session(), question).startswith(answer)


def test_nobody_there_is_not_nobody_anywhere() -> None:
    street = Street().car("oncoming", 30, 4, BLACK, np.pi, 9)
    assert told(street.grounder().session(), "is anyone coming up behind us on the left?") == (
        "no: nothing that is seen there comes towards us"
    )


def test_the_lane_that_we_change_to_is_the_one_in_talk() -> None:
    street = Street().car("behind", -14, 0, GREY, speed_mps=8).car("left", 30, 3.5, WHITE, speed_mps=9)
    session = street.grounder().session()
    told(session, "change to the left lane")
    assert told(session, "anything coming from behind in it?").startswith("no")


def test_people_on_the_pavement_are_no_vehicles() -> None:
    street = with_person(Street().car("truck", 5, -6, BLACK), "walker", 11, -7.5, 1.0)
    session = street.grounder().session()
    assert "the person" in told(session, "who's that on the sidewalk?")
    answer = session.say("stop next to her")
    assert answer.referent is not None
    assert answer.referent.item.id == "walker"


def full_kerb() -> Street:
    street = Street()
    for number in range(12):
        street.car(f"p{number}", -8 + 5.4 * number, -6.9, YELLOW)
    return street


def test_an_offer_of_our_lane_is_taken_and_left_again() -> None:
    session = full_kerb().grounder().session()
    assert session.say("pull over on the right").status == "ambiguous"
    assert "taken by" in told(session, "what is in the way?")
    answer = session.say("in the lane is fine")
    assert answer.status == "ok"
    assert answer.target is not None
    place = answer.target.ego_m
    for text in ("OK, she's better. Drive on.",):
        on = session.say(text)
        assert on.target is not None
        assert on.target.ego_m[0] > place[0] + 5


@pytest.mark.parametrize(
    "turn", ["right, everyone's in, off we go", "he's got his bag, carry on", "we're all set, drive on"]
)
def test_a_stop_that_has_served_its_purpose_is_over(turn: str) -> None:
    session = Street().car("blue", 20, -6, BLUE).grounder().session()
    stop = session.say("stop next to the blue car")
    answer = session.say(turn)
    assert answer.status == "ok"
    assert stop.target is not None
    assert answer.target is not None
    assert answer.target.ego_m[0] != stop.target.ego_m[0]
    assert "the goal stays as it is" not in answer.reasons


def test_doors_are_told_for_the_side_that_is_asked_about() -> None:
    session = Street().car("blue", 20, -3.2, BLUE).grounder().session()
    told(session, "stop next to the blue car")
    right = told(session, "is it safe to open the right door?")
    assert "on our right" in right
    assert "on our left" not in right


def test_giving_up_and_another_place_in_one_turn() -> None:
    session = Street().car("black", 20, -6, BLACK).car("blue", 34, -6, BLUE).grounder().session()
    told(session, "stop behind the blue car")
    answer = session.say("never mind, just close up to the black one")
    assert answer.referent is not None
    assert answer.referent.item.id == "black"


@pytest.mark.parametrize(
    "reason", ["so we don't block it", "so that nobody hits us", "so that they don't have to walk around us"]
)
def test_what_is_not_to_happen_asks_for_nothing(reason: str) -> None:
    grounder = Street().car("blue", 20, -6, BLUE).grounder()
    plain, reasoned = (
        grounder.ground("stop behind the blue car"),
        grounder.ground(f"stop behind the blue car {reason}"),
    )
    assert (plain.target and plain.target.cell) == (reasoned.target and reasoned.target.cell)
    assert reasoned.status == "ok"


def test_the_van_is_the_one_that_is_called_so_wherever_it_is() -> None:
    street = Street().car("car", 12, -6, WHITE).car("far", -30, -6, BLACK, size_wlh_m=(2.0, 5.4, 2.4))
    assert "behind right" in told(street.grounder().session(), "where is the van?")


def test_footprint_of_the_gap_is_that_of_the_ego() -> None:
    street = Street().car("ahead", 20, 0, WHITE)
    ego, session = street.grounder().scene.ego, street.grounder().session()  # type: ignore[union-attr]
    front_m = float(footprints([ego.centre_m, 0.0], 0.0, [ego.length_m, ego.width_m])[:, 0].max())
    assert f"{20 - 2.2 - front_m:.1f} m from us" in told(session, "how big is the gap between us and the white car?")


def test_who_is_beside_us_passes_before_we_overtake() -> None:
    street = Street().car("slow", 18, 0, WHITE, speed_mps=3).car("beside", 0, 3.5, GREY, speed_mps=8)
    answer = street.grounder().ground("overtake the white car")
    assert answer.status == "ok", answer.text()
    assert any("grey car" in reason and "passes first" in reason for reason in answer.reasons)


def test_who_is_no_slower_is_told_when_overtaken() -> None:
    street = Street().car("fast", 16, 0, WHITE, speed_mps=7)
    grounder = Grounder()
    grounder.set_scene(street.bev(), street.boxes(), speed_mps=5.0)
    answer = grounder.ground("overtake the white car")
    assert "it drives at 7 m/s, we at 5: to pass it we have to be faster" in answer.reasons


def test_a_lane_change_behind_a_vehicle_means_one_in_that_lane() -> None:
    street = Street().car("lane", 2, 3.5, BLACK, speed_mps=8).car("parked", 5, -6, BLACK).car("other", 9, -6, BLACK)
    answer = street.grounder().ground("get over into the left lane behind that black car")
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id == "lane"


def test_the_next_lane_is_where_vehicles_drive_in_it() -> None:
    street = Street().car("one", 20, 2.7, BLACK, speed_mps=8).car("two", -14, 2.7, GREY, speed_mps=8)
    answer = street.grounder().ground("change to the left lane")
    assert answer.target is not None
    assert answer.target.ego_m[1] == pytest.approx(2.7, abs=0.5)


def test_a_way_across_oncoming_lanes_is_told() -> None:
    street = Street().car("oncoming", 34, 3.6, BLACK, np.pi, 9)
    answer = street.grounder().ground("pull over on the left")
    assert answer.target is not None
    assert any("crosses the lanes of oncoming traffic" in reason for reason in answer.reasons)


def test_warnings_of_a_step_are_told_with_the_last_one() -> None:
    size, category = (0.6, 0.6, 1.8), "human.pedestrian.adult"
    street, grounder = Street().car("walker", 6, -4, GREY, 1.57, 1.0, size, category), Grounder()
    grounder.set_scene(street.bev(), street.boxes(), speed_mps=6.0)
    answer = grounder.ground("let the pedestrian go first, then pull over on the right")
    assert len(answer.steps) == 2
    assert any("too near" in reason for reason in answer.reasons)


@pytest.mark.parametrize("command", ["honk at the white car", "beep at the white car ahead"])
def test_the_horn_is_not_controlled(command: str) -> None:
    answer = Street().car("white", 20, 0, WHITE, speed_mps=3).grounder().ground(command)
    assert answer.plan.refused
    assert "the horn is not controlled here" in answer.reasons


def test_it_comes_closer() -> None:
    session = Street().car("red", 30, 4, (190, 20, 25), np.pi, 9).grounder().session()
    told(session, "what's that red car doing?")
    assert told(session, "is it coming closer?").startswith("yes: the red car")


def test_room_in_front_of_us_at_the_goal_and_the_doors_there() -> None:
    session = Street().car("blue", 24, -6.6, BLUE).grounder().session()
    told(session, "park behind the blue car")
    assert "in front of us" in told(session, "how much space will there be in front of us when we're parked?")
    assert "on our right" in told(session, "can we get out on the right there?")


def test_a_shift_is_not_blocked_by_who_drives_on() -> None:
    session = Street().car("ahead", 22, 0, WHITE, speed_mps=6).car("blue", 10, -6.6, BLUE).grounder().session()
    told(session, "stop in our lane 12 metres ahead")
    answer = session.say("ten metres further")
    assert answer.target is not None
    assert answer.target.ego_m[0] > 20


def test_what_is_asked_twice_is_one_question() -> None:
    session = traffic().grounder().session()
    assert "the white car" in told(session, "which car is right ahead of us, and how far is it?")
