"""Traffic beside and behind us: who passes before we leave our lane, who is followed, and where the kerb is full."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, GREY, WHITE, Street

from grounding.answer import Answer


def answer_to(street: Street, command: str) -> Answer:
    return street.grounder().session().say(command)


def beside_us() -> Street:
    """A car that comes up in the lane on our left, and a slow one ahead of us."""
    return (
        Street()
        .car("rear", -12, 3.5, GREY, speed_mps=9)
        .car("slow", 16, 0, WHITE, speed_mps=3)
        .car("parked", 14, -3.2, BLACK)
    )


@pytest.mark.parametrize("command", ["overtake the white car", "change to the left lane", "make a u-turn"])
def test_who_comes_up_beside_us_passes_first(command: str) -> None:
    answer = answer_to(beside_us(), command)
    assert answer.status == "ok"
    assert any("grey car" in reason and "passes first" in reason for reason in answer.reasons)


@pytest.mark.parametrize("command", ["follow the white car", "stop behind the white car", "carry on"])
def test_nobody_has_to_pass_while_we_keep_our_lane(command: str) -> None:
    answer = answer_to(beside_us(), command)
    assert answer.status == "ok"
    assert not any("passes first" in reason for reason in answer.reasons)


def test_a_follower_keeps_its_lane_and_never_backs_up() -> None:
    answer = answer_to(Street().car("ahead", 14, -1.2, WHITE, speed_mps=3), "follow the white car")
    assert answer.status == "ok"
    assert answer.target is not None
    assert abs(answer.target.ego_m[1]) < 0.5
    assert not any("backwards" in reason for reason in answer.reasons)


def test_we_stay_behind_a_queue_that_creeps() -> None:
    answer = answer_to(Street().car("queue", 15, 0, WHITE, speed_mps=1.6), "carry on")
    assert answer.target is not None
    assert answer.target.ego_m[0] < 10
    assert abs(answer.target.ego_m[1]) < 0.8


def test_a_full_kerb_is_no_place_to_pull_over() -> None:
    street = Street()
    for number in range(9):
        street.car(f"p{number}", -8 + 5.4 * number, -6.9, BLACK)
    answer = answer_to(street, "pull over on the right")
    assert answer.status == "ambiguous"
    assert "in our lane" in answer.question


def test_a_place_across_the_road_says_that_it_faces_the_traffic() -> None:
    street = Street().car("oncoming", 30, 4, GREY, yaw_rad=np.pi, speed_mps=10)
    answer = answer_to(street, "pull over on the left")
    assert any("facing the traffic" in reason for reason in answer.reasons)


def test_whether_the_lane_beside_us_is_free() -> None:
    session = beside_us().grounder().session()
    assert "not free: the grey car" in session.say("is the left lane free?").reasons[0]
    assert "not free: the black car" in session.say("is the lane on our right clear?").reasons[0]
    assert len(session.say("is the lane next to us empty?").reasons) == 2
    assert "free, as far as is seen" in Street().grounder().session().say("is the right lane clear?").reasons[0]


@pytest.mark.parametrize("command", ["get behind the grey car on the left", "change lanes behind the grey car"])
def test_we_move_in_behind_a_car_that_is_about_to_be_ahead(command: str) -> None:
    answer = answer_to(Street().car("beside", 2, 3.5, GREY, speed_mps=8), command)
    assert answer.status == "ok"
    assert answer.target is not None
    assert answer.target.ego_m[0] > 8
    assert answer.target.ego_m[1] == pytest.approx(3.5, abs=0.8)
    assert any("once it is ahead of us" in reason for reason in answer.reasons)


def test_to_go_with_the_traffic_is_to_drive_on() -> None:
    answer = answer_to(Street(), "just follow the traffic")
    assert answer.status == "ok"
    assert answer.target is not None
    assert abs(answer.target.ego_m[1]) < 1


def test_who_comes_up_from_behind_is_told() -> None:
    answer = answer_to(beside_us(), "who is that coming up behind us?")
    assert any("grey car" in reason for reason in answer.reasons)


def test_who_passes_first_is_spoken_of() -> None:
    session = beside_us().grounder().session()
    session.say("change to the left lane")
    answer = session.say("let him pass first")
    assert answer.status == "ok"
    waits, changes = answer.steps
    assert waits.referent is not None
    assert waits.referent.item.id == "rear"
    assert changes.query.action == "change_lane"


def test_the_kerb_is_on_the_left_where_traffic_drives_there() -> None:
    grounder = Street().grounder()
    grounder.set_left_hand_traffic(True)
    grounder.set_scene(Street().bev(), Street().boxes())
    place = grounder.ground("pull over").target
    assert place is not None
    assert place.ego_m[1] > 4


def test_vehicles_that_stand_our_way_across_the_road_show_a_one_way_road() -> None:
    street = Street().car("a", 22, 6.5, WHITE).car("b", 34, 6.5, BLACK)
    answer = answer_to(street, "stop behind the white car")
    assert answer.status == "ok"
    assert answer.target is not None
    assert abs(answer.target.heading_ego_rad) < 0.3


def test_the_last_one_is_one_of_those_that_were_counted() -> None:
    street = Street().car("r1", 12, -6.5, GREY).car("r2", 24, -6.5, BLACK).car("l", 38, 6.5, WHITE, yaw_rad=np.pi)
    session = street.grounder().session()
    assert "2 fit" in session.say("how many cars are parked on the right?").reasons[0]
    answer = session.say("stop beside the last one")
    assert answer.referent is not None
    assert answer.referent.item.id == "r2"


def test_who_comes_from_behind_and_whether_a_manoeuvre_is_clear() -> None:
    session = beside_us().car("oncoming", 25, 6.5, BLACK, yaw_rad=np.pi, speed_mps=10).grounder().session()
    told = session.say("is there anything coming from behind on the left?").reasons
    assert "grey car" in "; ".join(told)
    assert "black" not in "; ".join(told)
    assert "passes first" in session.say("is it safe to change to the left lane?").reasons[0]
    alone = Street().car("slow", 16, 0, WHITE, speed_mps=3).grounder().session()
    assert "oncoming traffic" in alone.say("is it safe to change to the left lane?").reasons[0]
    assert "nobody" in alone.say("is it safe to overtake the white car?").reasons[0]


def test_a_side_said_after_a_change_of_lane_without_one_is_its_side() -> None:
    session = (
        Street().car("with us", -25, 3.5, GREY, speed_mps=9).car("b", 30, 3.5, GREY, speed_mps=9).grounder().session()
    )
    session.say("change lanes")
    answer = session.say("left, obviously")
    assert answer.query.direction == "left"
    assert answer.target is not None
    assert answer.target.ego_m[1] == pytest.approx(3.5, abs=0.8)


def test_to_back_up_because_of_the_car_ahead_is_to_back_up() -> None:
    answer = answer_to(Street().car("ahead", 8, 0, WHITE), "back up a little, we're too close to the car in front")
    assert answer.status == "ok"
    assert answer.target is not None
    assert answer.target.ego_m[0] < 1


def test_how_long_the_way_is() -> None:
    session = Street().car("ahead", 30, -6, WHITE).grounder().session()
    session.say("stop next to the white car")
    assert "the way to the goal is" in session.say("how long is the way there?").reasons[0]


@pytest.mark.parametrize("turn", ["ok he's in, carry on", "everyone is in, let's go"])
def test_we_drive_on_when_somebody_got_in(turn: str) -> None:
    session = Street().car("red", 14, -6, WHITE).grounder().session()
    session.say("stop beside the white car")
    answer = session.say(turn)
    assert answer.query.action == "other"
    assert answer.target is not None
    assert answer.target.ego_m[0] > 16
