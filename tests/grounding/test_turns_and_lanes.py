"""Straight on, keeping a side, the other side of what is crossed, counted turns, and places that are ruled out."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLUE, GREY, WHITE, Street, told
from test_crossings import HALF_M, ask, place

from appocc.bevmap import ROAD
from grounding.language import parse


def two_way(junction_m: float = 0.0) -> Street:
    """A road with one lane each way, the middle of ours at the ego, and a road to both sides 20 m ahead, if asked."""
    street = Street()
    x, y = street.grid.centres()[:, 0, 0], street.grid.centres()[0, :, 1]
    street.occupancy[ROAD] = 0
    street.occupancy[ROAD, :, (y > -2.0) & (y < 5.4)] = 1
    if junction_m:
        street.occupancy[ROAD, (x > 16) & (x < 16 + junction_m)] = 1
    return street.car("oncoming", 32, 3.5, GREY, np.pi, 8.0)


@pytest.mark.parametrize("text", ["straight on at the junction", "straight over at the crossroads"])
def test_straight_on_behind_traffic_is_no_worse_a_place(text: str) -> None:
    junction = {"junction": [(10.0, 20.0)]}
    behind = ask(text, junction, Street().car("ahead", 13, 0, BLUE, 0.0, 6.0))
    alone = ask(text, junction)
    assert place(behind) == place(alone)
    assert behind.target is not None
    assert alone.target is not None
    assert behind.target.score > 0.9 * alone.target.score


@pytest.mark.parametrize("text", ["get in the left lane", "change lanes to the left"])
@pytest.mark.parametrize("junction_m", [0.0, 8.0])
def test_the_lane_of_oncoming_traffic_is_no_lane_to_change_to(text: str, junction_m: float) -> None:
    answer = two_way(junction_m).grounder().ground(text)
    assert answer.target is None, answer.text()
    assert "oncoming traffic" in answer.question


@pytest.mark.parametrize("text", ["keep left", "stay left", "keep right"])
def test_to_keep_a_side_is_no_turn_at_a_crossroads(text: str) -> None:
    answer = two_way(8.0).grounder().ground(text)
    assert abs(place(answer)[1]) < 2


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("go straight through and stop on the other side", "junction"),
        ("cross the junction and stop on the other side", "junction"),
        ("go over the crossing and pull over on the far side", "crossing"),
    ],
)
def test_the_other_side_of_what_is_crossed_is_past_it(text: str, kind: str) -> None:
    assert place(ask(text, {kind: [(10.0, 16.0)]}))[0] - HALF_M > 16


@pytest.mark.parametrize("text", ["swing round and park facing the other way", "park facing the other way"])
def test_who_faces_the_other_way_turns_around_first(text: str) -> None:
    assert [step.action for step in parse(text).steps] == ["turn", "park"]


@pytest.mark.parametrize(
    "text", ["next right then first left", "first right then first left", "take the next right then the first left"]
)
def test_counted_turns_are_two_turns(text: str) -> None:
    assert [step.direction for step in parse(text).steps] == ["right", "left"]


def test_right_then_is_an_opening() -> None:
    reading = parse("right then, park behind the van")
    assert reading.query.direction is None
    assert not reading.dropped


@pytest.mark.parametrize(
    "text", ["park anywhere but on the left", "park anywhere but the left", "park, but not on the left"]
)
def test_a_side_that_is_ruled_out_is_the_other_one(text: str) -> None:
    reading = parse(text)
    assert reading.query.goal_side == "right"
    assert not reading.dropped


@pytest.mark.parametrize(
    "text", ["nearest parking spot on the right", "the nearest space will do", "second gap on the left"]
)
def test_a_spot_without_a_verb_is_a_place_to_park(text: str) -> None:
    reading = parse(text)
    assert reading.query.action == "park"
    assert not reading.doubt


@pytest.mark.parametrize("text", ["jump the light", "jump the red", "run the red light"])
def test_red_lights_are_not_passed(text: str) -> None:
    assert Street().grounder().ground(text).plan.refused


@pytest.mark.parametrize("text", ["don't stop here", "don't pull over yet", "don't park here"])
def test_not_to_stop_is_to_drive_on(text: str) -> None:
    session = Street().grounder().session()
    answer = session.say(text)
    assert answer.status == "ok", answer.text()
    assert place(answer)[0] > 10


def test_a_bit_further_along_a_full_kerb_is_the_next_room() -> None:
    street = Street()
    for number in range(3):
        street.car(f"p{number}", 14 + 5.4 * number, -6.9, GREY)
    session = street.car("first", 2, -6.9, WHITE).grounder().session()
    first = place(session.say("pull over on the right"))
    told(session, "a bit further")
    assert session.goal is not None
    assert place(session.goal)[0] > first[0] + 5


def test_several_vehicles_that_are_not_there() -> None:
    street = Street().car("first", -20, -5, WHITE).car("second", -32, -5, WHITE)
    answer = street.grounder().ground("park between two cars on the right")
    assert "there are no cars ahead" in answer.question


@pytest.mark.parametrize("text", ["turn right at the next street", "turn right at the next road"])
def test_a_street_at_which_we_turn_is_entered(text: str) -> None:
    answer = two_way(8.0).grounder().ground(text)
    assert place(answer)[1] < -5


def test_the_truck_on_our_path_is_in_our_lane() -> None:
    referent = parse("park beside the truck on our path").query.referent
    assert referent is not None
    assert "own_lane" in referent.qualifiers


@pytest.mark.parametrize(
    "text", ["turn right and stop just round the corner", "turn right and park straight after the corner"]
)
def test_round_the_corner_is_after_the_turn(text: str) -> None:
    answer = two_way(12.0).grounder().ground(text)
    assert answer.status == "ok", answer.text()
    assert place(answer)[1] < -5


@pytest.mark.parametrize("text", ["where's the nearest place to park?", "where is the next free space?"])
def test_where_to_park_is_a_question_about_room(text: str) -> None:
    session = Street().grounder().session()
    assert told(session, text).startswith("yes")
    assert session.say("take it").target is not None
