"""Commands as strangers say them: nothing that they say is lost, and nothing happens that nobody asks for."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLUE, EGO, RED, WHITE, WORLD_FROM_EGO, Street, area

from appocc.nuscenes.maps import VectorMap
from grounding import Answer, Grounder

STREET = Street().car("w", 24, -5, WHITE).car("b", 30, -5, BLUE).car("r", -9, -5, RED)


def crossing(near_m: float, far_m: float) -> VectorMap:
    """A map with one crossing and one junction of the ego frame."""
    junction = area(near_m + 8, far_m + 12)
    return VectorMap((), (), {"crossing": (area(near_m, far_m),), "junction": (junction,)})


def ask(text: str) -> Answer:
    grounder = Grounder()
    grounder.set_street_map(crossing(10, 13))
    grounder.set_scene(STREET.bev(), STREET.boxes(), WORLD_FROM_EGO)
    return grounder.ground(text)


def steps_of(answer: Answer) -> list[str]:
    return [step.query.action or "" for step in answer.steps]


def place(answer: Answer) -> tuple[float, float]:
    """Place ahead, metres, and heading, degrees."""
    assert answer.target is not None, answer.text()
    return float(answer.target.ego_m[0]), float(np.degrees(answer.target.heading_ego_rad))


@pytest.mark.parametrize("text", ["turn around and go back", "make a U-turn and head back"])
def test_a_u_turn_of_two_words_is_one(text: str) -> None:
    answer = ask(text)
    assert steps_of(answer) == ["turn"]
    assert abs(place(answer)[1]) > 150


def test_a_u_turn_at_a_junction_turns_there() -> None:
    ahead_m, heading_deg = place(ask("make a U-turn at the next junction"))
    assert 14 < ahead_m < 30
    assert abs(heading_deg) > 150


def test_a_turn_at_a_landmark_is_not_moved_to_the_next_vehicle() -> None:
    answer = ask("turn around at the junction and then stop by the blue car")
    assert [part.noun for part in answer.steps[0].query.secondary] == ["junction"]
    assert answer.steps[0].query.referent is None


def test_backwards_leads_to_what_is_behind() -> None:
    assert place(ask("reverse until you're next to the red car"))[0] < 0
    answer = ask("reverse until you're next to the blue car")
    assert answer.target is None
    assert "driving backwards does not lead there" in answer.text()


def test_a_step_that_is_no_command_of_its_own_leaves_its_place() -> None:
    answer = ask("drive past the crossing and stop")
    assert place(answer)[0] - EGO.length_m / 2 > 13


def test_through_a_crossing_is_past_it() -> None:
    assert place(ask("go through the crossing"))[0] - EGO.length_m / 2 > 13


@pytest.mark.parametrize(("text", "metres"), [("go 15 metres and stop", 15), ("drive 12 metres", 12)])
def test_a_distance_to_go(text: str, metres: float) -> None:
    answer = ask(text)
    assert len(answer.steps) == 1
    assert place(answer)[0] - EGO.centre_m == pytest.approx(metres, abs=2.5)


@pytest.mark.parametrize("text", ["move up a bit", "pull forward a little"])
def test_a_bit_is_a_bit(text: str) -> None:
    assert 0 < place(ask(text))[0] - EGO.centre_m < 7


@pytest.mark.parametrize("text", ["he'll turn left", "it'll stop", "she'll wait"])
def test_what_others_are_going_to_do_is_no_command(text: str) -> None:
    assert ask(text).status == "not_a_command"


def test_a_reason_to_slow_down_need_not_be_seen() -> None:
    answer = ask("slow down, there's a bus")
    assert (answer.status, answer.pace) == ("ok", "slower")
    assert "nothing here fits 'bus'" in answer.text()


def test_a_turn_needs_a_side() -> None:
    assert "does not say which way to turn" in ask("turn off before the blue car").text()


def test_what_is_to_be_waited_for_before_a_turn_leaves_the_turn() -> None:
    assert steps_of(ask("let the blue car through before you turn left")) == ["give_way", "turn"]
    assert steps_of(ask("before you turn left, park behind the blue car")) == ["park"]


def test_a_reaction_is_for_when_the_condition_comes() -> None:
    answer = ask("if the blue car moves, stop")
    assert (answer.status, answer.target, answer.steps) == ("ok", None, ())


def test_a_person_is_where_the_sentence_says() -> None:
    answer = ask("pick up my mum, she is by the blue car")
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "b"


def test_right_before_a_place_is_no_side() -> None:
    assert ask("stop right up behind the blue car").query.goal_side is None


def test_numbers_as_they_are_written() -> None:
    assert ask("stop 3,5 m behind the blue car").query.distance_m == 3.5
    for text in ("stop in -5 metres", "stop minus 5 metres ahead"):
        answer = ask(text)
        assert (answer.status, answer.target) == ("ambiguous", None)


def test_anywhere_but_not_beside() -> None:
    answer = ask("park anywhere but not next to the blue car")
    assert answer.status == "ok"
    assert [(one.relation, one.noun) for one in answer.query.excluded] == [("next_to", "car")]


@pytest.mark.parametrize("reply", ["ok carry on", "you can go now", "okay go", "go on then"])
def test_a_wait_ends(reply: str) -> None:
    session = STREET.grounder().session()
    assert session.say("wait here").pace == "standing"
    answer = session.say(reply)
    assert answer.pace is None
    assert place(answer)[0] > 5


@pytest.mark.parametrize("reply", ["not now", "not yet"])
def test_not_yet_moves_no_goal(reply: str) -> None:
    session = STREET.grounder().session()
    before = place(session.say("stop in 10 metres"))
    assert place(session.say(reply)) == before


def test_a_u_turn_instead_of_a_goal() -> None:
    session = STREET.grounder().session()
    session.say("stop in 10 metres")
    assert abs(place(session.say("turn around"))[1]) > 150


def test_the_other_side_of_the_road_without_a_vehicle() -> None:
    session = STREET.grounder().session()
    session.say("pull over")
    answer = session.say("on the other side of the road")
    assert answer.query.road_side == "opposite"
    assert answer.target is not None
    assert answer.target.ego_m[1] > 0


def test_a_nearer_one_that_fits_less_is_told() -> None:
    street = Street().car("n", 8, -5, (124, 124, 124)).car("w", 24, -5, WHITE)
    answer = street.grounder().ground("stop behind the nearest white car")
    assert answer.referent is not None
    assert answer.referent.item.id == "w"
    assert "one 8 m away is nearer, but fits the other words less well" in answer.text()
