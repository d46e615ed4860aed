"""Where the edge of the road is full, or the place beyond the map: what is offered, and how we drive on."""

from __future__ import annotations

import pytest
from street import BLUE, GREY, RED, WHITE, YELLOW, Street

from grounding.answer import Answer
from grounding.grounder import Grounder


def full_kerb() -> Street:
    street = Street()
    for number in range(12):
        street.car(f"p{number}", -8 + 5.4 * number, -6.9, YELLOW)
    return street


def along_m(answer: Answer) -> float:
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    return float(answer.target.ego_m[0])


@pytest.mark.parametrize(
    "command",
    [
        "pull over as soon as there is room",
        "pull over when you can",
        "let me out at the side of the road wherever there's a space",
        "park at the first opportunity",
        "keep going until there's a space, then park",
    ],
)
def test_we_drive_on_until_there_is_room(command: str) -> None:
    answer = full_kerb().grounder().ground(command)
    assert along_m(answer) > 12
    assert any("until there is" in reason for reason in answer.reasons)


def test_where_there_is_room_it_is_taken() -> None:
    answer = Street().grounder().ground("pull over as soon as there is room")
    assert along_m(answer) < 16
    assert answer.target is not None
    assert answer.target.ego_m[1] < -4


@pytest.mark.parametrize(
    "reply", ["no, drive on until there's a space", "find the next free space", "no, not in the road. Carry on."]
)
def test_the_offer_of_our_lane_is_declined_by_driving_on(reply: str) -> None:
    session = full_kerb().grounder().session()
    assert session.say("pull over").status == "ambiguous"
    answer = session.say(reply)
    assert along_m(answer) > 12
    assert answer.query.action == "pull_over"


def test_a_second_row_is_refused_and_our_lane_offered() -> None:
    street = full_kerb().car("white", 20, 6.9, WHITE)
    answer = street.grounder().ground("double park next to the white car")
    assert answer.plan.refused
    assert "shall we stop in our lane" in answer.question
    free = Street().car("blue", 20, -6.9, BLUE).grounder().ground("double park next to the blue car")
    assert free.plan.refused
    assert not free.question


@pytest.mark.parametrize(("relation", "sign"), [("just before", -1), ("just past", 1)])
def test_a_place_at_the_kerb_before_or_past_a_vehicle(relation: str, sign: int) -> None:
    answer = Street().car("red", 18, -6.5, RED).grounder().ground(f"pull up on the right, {relation} the red car")
    assert sign * (along_m(answer) - 18) > 4
    assert answer.target is not None
    assert answer.target.ego_m[1] < -5


def test_a_stop_beyond_the_map_leads_to_its_end_for_now() -> None:
    answer = Street().grounder().ground("carry on for a hundred metres and then pull over on the right")
    assert along_m(answer) > 25
    assert any("beyond the map" in reason for reason in answer.reasons)


def test_who_is_behind_us_is_let_by_at_the_kerb() -> None:
    session = Street().car("hurry", -12, 0, GREY, speed_mps=7).grounder().session()
    answer = session.say("let the car behind us by")
    assert answer.target is not None
    assert answer.target.ego_m[1] < -4
    on = session.say("ok carry on then")
    assert on.target is not None
    assert abs(on.target.ego_m[1]) < 1


@pytest.mark.parametrize("command", ["overtake whoever is in front of us", "follow the car in front"])
def test_parked_vehicles_lead_nobody(command: str) -> None:
    answer = Street().car("parked", 20, -6.5, WHITE).grounder().ground(command)
    assert answer.status == "not_found"
    assert "nobody is seen ahead of us in our lane" in answer.reasons


def at_speed(street: Street, speed_mps: float) -> Grounder:
    grounder = Grounder()
    grounder.set_scene(street.bev(), street.boxes(), speed_mps=speed_mps)
    return grounder


def test_we_stop_short_of_who_goes_first() -> None:
    size, category = (0.6, 0.6, 1.8), "human.pedestrian.adult"
    for x_m, too_near in ((18.0, False), (6.0, True)):
        street = Street().car("walker", x_m, -4, GREY, 1.57, 1.0, size, category)
        answer = at_speed(street, 6.0).ground("let the pedestrian go first")
        assert (along_m(answer) + 2.3 < x_m) is not too_near
        assert any("too near" in reason for reason in answer.reasons) is too_near


def test_hard_braking_is_told() -> None:
    street = Street().car("red", 14, -6.5, RED)
    answer = at_speed(street, 12.0).ground("stop next to the red car")
    assert any("hard braking" in reason for reason in answer.reasons)
    gentle = at_speed(street, 4.0).ground("stop next to the red car")
    assert not any("hard braking" in reason for reason in gentle.reasons)


def test_who_overtakes_does_not_swing_out_around_those_who_drive_on() -> None:
    street = (
        Street()
        .car("slow", 16, 0, WHITE, speed_mps=4)
        .car("beside", 22, 3.4, GREY, speed_mps=9)
        .car("oncoming", 30, 6.6, BLUE, 3.1416, 10)
    )
    answer = street.grounder().ground("overtake the white car")
    assert answer.status == "ok", answer.text()
    assert answer.plan.route is not None
    assert float(answer.plan.route[:, 1].max()) < 5
