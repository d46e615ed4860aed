"""Remarks around questions and commands: passengers, purposes, which ways there are, and vehicles that have left."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREY, RED, WHITE, YELLOW, Street, told

from appocc.bevmap import ROAD
from grounding.language.parser import parse

PERSON = ((0.6, 0.6, 1.4), "human.pedestrian.adult")


@pytest.mark.parametrize(
    ("text", "action"),
    [
        ("slow down a little, the kids are scared", "slow_down"),
        ("wait here a moment while the kids buckle up", "wait"),
        ("pull over, my children are hungry", "pull_over"),
        ("let me out on the right, somewhere the children can't run into the traffic", "stop"),
        ("just pull in somewhere on the right where I can shut my eyes for ten minutes", "park"),
    ],
)
def test_passengers_and_purposes_are_told_and_not_planned(text: str, action: str) -> None:
    reading = parse(text)
    assert reading.query.action == action
    assert reading.query.referent is None
    assert reading.dropped
    assert not reading.doubt


def test_children_on_the_road_are_no_passengers() -> None:
    query = parse("stop, the kids are crossing").query
    assert query.referent is not None
    assert query.referent.noun == "person"


def test_a_place_up_the_road_is_so_far_ahead() -> None:
    query = parse("just drop me 20 metres up the road").query
    assert (query.distance_m, query.distance_of) == (20.0, "ego")


def test_a_place_past_what_is_ruled_out() -> None:
    query = parse("don't stop here mate it's a junction, go through it and stop after").query
    assert (query.relation, query.landmark) == ("past", "secondary")
    assert query.secondary[0].noun == "junction"


def test_who_drives_slowly_is_a_vehicle() -> None:
    street = Street().car("slow", 18, 0, WHITE, speed_mps=3).car("walker", 12, -7, GREY, 0, 1.0, *PERSON)
    answer = street.grounder().ground("get past this slow guy, I want to go home")
    assert answer.referent is not None
    assert answer.referent.item.id == "slow"


def test_more_distance_does_not_close_up() -> None:
    street = Street().car("ahead", 24, 0, WHITE, speed_mps=3)
    answer = street.grounder().ground("keep a bit more distance to the white car in front")
    assert answer.target is not None
    assert answer.target.ego_m[0] < 3


def test_a_pair_has_room_between_it() -> None:
    street = Street()
    for number, x_m in enumerate((6.0, 11.0, 16.0, 30.0)):
        street.car(f"p{number}", x_m, -6.6, YELLOW)
    answer = street.grounder().ground("pull in between the two parked cars on the right")
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert 18 < answer.target.ego_m[0] < 28
    tight = Street().car("a", 8, -6.6, YELLOW).car("b", 13, -6.6, YELLOW).car("c", 18, -6.6, YELLOW)
    refused = tight.grounder().ground("pull in between the two parked cars on the right")
    assert refused.status == "not_found"
    assert any("leave room for us" in reason for reason in refused.reasons)


def test_what_has_left_is_not_in_the_way() -> None:
    session = Street().car("black", 6.6, 0, BLACK).grounder().session()
    told(session, "wait behind the black car")
    answer = session.say("when it has gone, go straight ahead")
    assert answer.status == "ok", answer.text()
    assert not any("backwards" in reason for reason in answer.reasons)
    place = Street().car("van", 14, -6.5, BLUE, size_wlh_m=(2.0, 5.4, 2.4)).grounder()
    left = place.ground("wait until the van leaves and park where it is now")
    assert left.status == "ok", left.text()
    assert left.target is not None
    assert np.linalg.norm(left.target.ego_m - [14, -6.5]) < 1


def test_no_offer_to_park_in_another_lane() -> None:
    street = Street().car("slow", 13, 0, WHITE, speed_mps=1.5).car("truck", 19, -6.5, BLACK)
    for number in range(8):
        street.car(f"p{number}", -8 + 5 * number if number < 5 else 10 + 5.2 * number, -6.6, YELLOW)
    answer = street.grounder().ground("park behind the black car")
    if answer.question and answer.plan.nearest is not None:
        assert answer.plan.nearest.ego_m[1] < 1.8


def test_to_follow_is_to_stop_behind_it() -> None:
    session = Street().car("white", 20, 0, WHITE, speed_mps=4).grounder().session()
    told(session, "follow the white car")
    answer = session.say("and if it stops, stop too")
    assert "to follow it is to stop behind it when it stops" in answer.reasons
    assert [step.query.action for step in (session.goal.steps if session.goal else ())] in ([], ["follow"])


def test_who_passes_first_is_let_by() -> None:
    street = Street().car("near", -8, -3.4, WHITE, speed_mps=2).car("passes", -11, 3.5, GREY, speed_mps=9)
    session = street.car("ours", 30, 3.5, BLUE, speed_mps=9).grounder().session()
    session.say("change to the left lane")
    told(session, "is anyone coming from behind?")
    answer = session.say("then let him pass first")
    assert answer.steps[0].referent is not None
    assert answer.steps[0].referent.item.id == "passes"


def test_is_there_really_no_gap() -> None:
    street = Street()
    for number in range(12):
        street.car(f"p{number}", -8 + 5.4 * number, -6.9, YELLOW)
    session = street.grounder().session()
    session.say("stop in our lane 10 metres ahead")
    assert told(session, "is there really no gap?").startswith("no; no place at the right edge")
    answer = session.say("then the first gap you can find")
    assert any("until there is" in reason for reason in answer.reasons)


def test_as_near_as_you_can_is_near_the_vehicle_in_talk() -> None:
    session = Street().car("red", 20, -6.5, RED).grounder().session()
    told(session, "where is the red car?")
    answer = session.say("then stop as near as you can")
    assert answer.referent is not None
    assert answer.referent.item.id == "red"


def crossroads() -> Street:
    street = Street()
    street.occupancy[ROAD][np.abs(street.grid.centres()[:, :, 0] - 24) < 4] = 1
    street.occupancy[ROAD][(street.grid.centres()[:, :, 1] > 8) & (street.grid.centres()[:, :, 0] < 40)] *= 0
    return street


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("which ways can we go here?", "the road to the right branches off"),
        ("is there even a road left??", "no: the map shows no road that branches off to the left"),
        ("is there a turning on the right?", "yes: the road to the right branches off"),
    ],
)
def test_which_roads_branch_off(question: str, answer: str) -> None:
    assert answer in told(crossroads().grounder().session(), question)


@pytest.mark.parametrize(
    "question",
    [
        "I'd like to get a shot of the red car, where is it?",
        "I need a photo of the red car, can you see it?",
        "what about that red car, is it parked??",
    ],
)
def test_a_remark_names_what_the_question_is_about(question: str) -> None:
    assert "the red car" in told(Street().car("red", 20, -6, RED).grounder().session(), question)


def test_is_that_a_child() -> None:
    street = Street().car("someone", 14, -7.2, GREY, 0.0, 1.0, *PERSON).car("blue", 20, -6, BLUE)
    answer = told(street.grounder().session(), "is that a child on the right?")
    assert "the person" in answer
    assert "how old" in answer


def test_an_unmapped_destination_is_told() -> None:
    answer = Street().grounder().session().say("Please take me to the airport, but avoid the motorway.")
    assert answer.status == "not_found"
    assert any("airport" in reason for reason in answer.reasons)
