"""A conversation: questions and answers, corrections, further steps."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLUE, RED, WHITE, Street

from appocc.errors import AppoccError
from grounding import Grounder
from grounding.dialogue.session import Session


def two_whites() -> Session:
    street = Street().car("right", 14, -5, WHITE).car("left", 15, 5, WHITE, yaw_rad=np.pi).car("red", 26, -5, RED)
    return street.grounder().session()


def row() -> Session:
    return Street().car("near", 12, -5, RED).car("blue", 28, -5, BLUE).grounder().session()


@pytest.mark.parametrize(
    ("reply", "referent"),
    [("the one on the left", "left"), ("the closer one", "right"), ("2", "left"), ("the first", "right")],
)
def test_an_answer_chooses_one_of_the_candidates(reply: str, referent: str) -> None:
    session = two_whites()
    asked = session.say("stop next to the white car")
    assert (asked.status, len(asked.candidates)) == ("ambiguous", 2)
    assert session.question == asked.question
    answer = session.say(reply)
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert (answer.referent.item.id, answer.query.relation) == (referent, "next_to")
    assert session.question == ""


def test_an_answer_that_is_not_understood_is_asked_again() -> None:
    session = two_whites()
    question = session.say("stop next to the white car").question
    again = session.say("banana")
    assert (again.status, again.question) == ("ambiguous", question)
    assert session.say("7").question == question
    music = session.say("do you like music?")
    assert music.status in ("not_a_command", "ambiguous")
    assert music.question == question


def test_another_speed_keeps_the_goal() -> None:
    session = row()
    goal = session.say("stop behind the blue car").target
    assert goal is not None
    assert [session.say(text).pace for text in ("a bit faster", "slow down")] == ["faster", "slower"]
    assert session.goal is not None
    assert session.goal.target is goal
    assert session.say("wait").pace == "standing"
    assert session.goal.pace == "standing"


def test_the_other_one() -> None:
    session = two_whites()
    session.say("stop next to the white car")
    session.say("1")
    answer = session.say("no, the other one")
    assert answer.referent is not None
    assert answer.referent.item.id == "left"
    again = session.say("not that one")
    assert again.referent is not None
    assert again.referent.item.id == "right"


def test_a_mere_no_keeps_the_goal_where_no_other_vehicle_was_offered() -> None:
    session = row()
    goal = session.say("stop behind the blue car").target
    answer = session.say("no")
    assert answer.status == "ok"
    assert session.goal is not None
    assert session.goal.target is goal


def test_a_place_at_one_of_the_candidates() -> None:
    session = two_whites()
    session.say("stop next to the white car")
    answer = session.say("behind the right one")
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert (answer.referent.item.id, answer.query.relation) == ("right", "behind")


def test_whether_there_is_room_at_the_goal() -> None:
    session = row()
    assert session.say("stop behind the blue car").status == "ok"
    assert session.say("will we fit?").status == "ok"


def test_a_choice_by_number_from_the_answer_itself() -> None:
    session = two_whites()
    asked = session.say("stop next to the white car")
    chosen = asked.choose(2)
    assert chosen.referent is not None
    assert chosen.referent.item.id == asked.candidates[1].item.id
    assert session.goal is not None
    with pytest.raises(AppoccError, match="expected the number of a candidate, 1 to"):
        session.choose(9)


def test_a_choice_without_a_session() -> None:
    grounder = Street().car("right", 14, -5, WHITE).car("left", 15, 5, WHITE, yaw_rad=np.pi).grounder()
    answer = grounder.ground("stop next to the white car").choose(1)
    assert answer.status == "ok"
    with pytest.raises(AppoccError, match="1 to 2, got 3"):
        grounder.ground("stop next to the white car").choose(3)
    with pytest.raises(AppoccError, match="expected an answer with candidates"):
        grounder.ground("tell me a joke").choose(1)


def test_relation_vehicle_and_place_are_changed() -> None:
    session = row()
    first = session.say("stop behind the blue car")
    assert first.target is not None
    back = session.say("two metres further back")
    assert back.target is not None
    assert back.target.ego_m[0] - first.target.ego_m[0] == pytest.approx(-2.0, abs=0.9)
    front = session.say("in front of it instead")
    assert front.query.relation == "in_front_of"
    assert front.referent is not None
    assert front.referent.item.id == "blue"
    other = session.say("no, behind the red one")
    assert other.referent is not None
    assert (other.referent.item.id, other.query.relation) == ("near", "behind")


def test_a_further_step_is_planned_from_where_the_first_ends() -> None:
    session = row()
    session.say("stop next to the red car")
    answer = session.say("and then stop in 8 metres")
    assert answer.status == "ok", answer.text()
    first, second = answer.steps
    assert first.target is not None
    assert second.target is not None
    assert second.target.ego_m[0] - first.target.ego_m[0] == pytest.approx(8, abs=1)
    assert [step["relation"] for step in answer.to_dict()["steps"]] == ["next_to", "none"]


def test_questions_leave_the_goal_and_a_cancellation_drops_it() -> None:
    session = row()
    goal = session.say("stop behind the blue car").target
    told = session.say("where are you heading?")
    assert told.status == "ok"
    assert told.target is goal
    assert "blue" in told.text()
    assert session.say("why?").target is goal
    assert session.say("thanks, that's great").status == "not_a_command"
    assert session.goal is not None
    dropped = session.say("never mind")
    assert dropped.status == "ok"
    assert dropped.target is None
    assert session.goal is None
    assert session.say("in front of it").referent is not None


def test_a_pronoun_without_antecedent_is_asked_and_answered() -> None:
    session = row()
    assert session.say("stop next to it").status == "ambiguous"
    answer = session.say("the blue car")
    assert answer.referent is not None
    assert (answer.referent.item.id, answer.query.relation) == ("blue", "next_to")


def test_a_session_without_a_scene() -> None:
    with pytest.raises(AppoccError, match="expected a scene to be set"):
        Grounder().session().say("stop")


def test_any_of_the_candidates_is_the_best_one() -> None:
    session = two_whites()
    first = session.say("stop next to the white car").candidates[0]
    answer = session.say("whichever is easier")
    assert answer.status == "ok"
    assert answer.referent is not None
    assert answer.referent.item.id == first.item.id


def test_back_to_the_plan_before() -> None:
    session = row()
    session.say("park behind the red car")
    session.say("in front of it instead")
    answer = session.say("go back to the first idea")
    assert (answer.status, answer.query.relation) == ("ok", "behind")


def test_a_question_about_a_vehicle_sets_what_it_refers_to() -> None:
    session = row()
    assert "blue car" in session.say("is there a blue car?").text()
    answer = session.say("park behind it")
    assert answer.referent is not None
    assert (answer.status, answer.referent.item.id) == ("ok", "blue")


def test_a_named_vehicle_is_remembered() -> None:
    session = row()
    assert session.say("the blue car").question == "do you mean 'stop near the blue car'?"
    answer = session.say("park behind it")
    assert answer.referent is not None
    assert answer.referent.item.id == "blue"


def test_what_the_ego_is_called_changes_nothing() -> None:
    session = two_whites()
    session.say("stop next to the white car")
    session.say("1")
    answer = session.say("not that one you silly sausage, the other one")
    assert answer.referent is not None
    assert answer.referent.item.id == "left"


def test_a_prohibition_ends_the_step_that_it_forbids() -> None:
    session = row()
    session.say("overtake the red car")
    assert session.goal is not None
    session.say("don't overtake it")
    assert session.goal is None


def test_a_described_one_is_asked_about_among_those_that_fit() -> None:
    asked = two_whites().say("stop next to the white one")
    assert {one.item.id for one in asked.candidates} == {"right", "left"}


def test_one_may_be_of_another_class_than_the_last_vehicle() -> None:
    street = Street().car("white", 14, -5, WHITE).car("blue", 28, -5, BLUE)
    session = street.grounder().session()
    session.say("stop next to the white car")
    answer = session.say("no wait, behind the blue one")
    assert answer.referent is not None
    assert (answer.referent.item.id, answer.query.relation) == ("blue", "behind")


def test_another_relation_without_a_noun() -> None:
    session = row()
    session.say("stop behind the red car")
    answer = session.say("not behind, in front")
    assert (answer.status, answer.query.relation) == ("ok", "in_front_of")


def four_in_a_row() -> Session:
    """Parked so closely that nobody fits between them."""
    street = Street().car("a", 11, -5, RED).car("b", 19, -5, BLUE).car("c", 27, -5, WHITE)
    return street.grounder().session()


def test_without_room_to_park_the_nearest_place_is_offered_and_taken() -> None:
    session = four_in_a_row()
    asked = session.say("park behind the white car")
    assert asked.status == "ambiguous"
    assert asked.plan.nearest is not None
    assert asked.question.startswith("there is no room there: shall we park")
    taken = session.say("ok do that")
    assert taken.target is not None
    assert np.hypot(*(taken.target.ego_m - asked.plan.nearest.ego_m)) < 1.5
    assert taken.target.ego_m[1] < -4  # at the edge of the road


def test_without_room_to_stop_our_lane_will_do() -> None:
    answer = four_in_a_row().say("stop behind the white car")
    assert answer.target is not None
    assert answer.referent is not None
    assert answer.referent.item.id == "c"
    x, y = answer.target.ego_m
    assert 18 < x < 27 - 4.4
    assert y > -3


def test_one_further_and_one_back() -> None:
    session = four_in_a_row()
    session.say("stop next to the red car")
    for said, car in (("one further", "b"), ("the next one", "c"), ("the one before that", "b")):
        answer = session.say(said)
        assert answer.referent is not None, answer.text()
        assert answer.referent.item.id == car
    session.say("one further")
    assert "no other car is further on" in session.say("one further").reasons


@pytest.mark.parametrize(
    ("said", "shift_m"),
    [
        ("make it 5", 5.0),
        ("half that", 5.0),
        ("no, 7", 3.0),
        ("three metres more", -3.0),
        ("not here, a bit later", 2.0),
    ],
)
def test_another_distance(said: str, shift_m: float) -> None:
    session = Street().car("car", 30, -5, RED).grounder().session()
    before, after = session.say("stop 10 metres behind the red car").target, session.say(said).target
    assert before is not None
    assert after is not None
    assert after.ego_m[0] - before.ego_m[0] == pytest.approx(shift_m, abs=1.0)


def test_a_vehicle_described_by_its_neighbour() -> None:
    street = Street().car("beside", 14, -5, WHITE).car("alone", 15, 5, WHITE, yaw_rad=np.pi).car("red", 20, -5, RED)
    session = street.grounder().session()
    assert session.say("stop next to the white car").status == "ambiguous"
    answer = session.say("the one with the red car in front of it")
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "beside"


def test_questions_about_the_scene_change_nothing() -> None:
    session = two_whites()
    goal = session.say("stop behind the red car").target
    assert session.say("how many white cars are there?").reasons[0] == "2 fit 'white cars'"
    assert "red" in session.say("what colour is it?").reasons[0]
    assert session.say("is there room in front of it?").reasons[0] == "yes"
    assert session.goal is not None
    assert session.goal.target is goal
    assert session.say("do it").query.relation == "in_front_of"


@pytest.mark.parametrize(
    "said", ["which cars do you see?", "what cars can you see", "what do you see?", "list the cars"]
)
def test_what_is_seen_is_listed_nearest_first(said: str) -> None:
    session = row()
    goal = session.say("stop behind the red car").target
    answer = session.say(said)
    assert (answer.status, answer.target) == ("ok", None), "no plan is repeated"
    told = [float(reason.split(" m ")[0].split()[-1]) for reason in answer.reasons[1:]]
    assert answer.reasons[0].startswith(f"{len(told)} fit ")
    assert told == sorted(told)
    assert session.goal is not None
    assert session.goal.target is goal


def test_an_open_question_is_asked_again() -> None:
    session = two_whites()
    asked = session.say("stop behind the white car").question
    assert session.say("which cars do you see?").question == asked


def test_undo_goes_back_step_by_step() -> None:
    session = row()
    for said in ("stop behind the red car", "in front of it", "next to it"):
        session.say(said)
    assert session.say("undo").query.relation == "in_front_of"
    assert session.say("undo").query.relation == "behind"


def test_turning_around_comes_beyond_the_vehicle_across_the_road() -> None:
    street = Street().car("blue", 24, 5, BLUE, yaw_rad=np.pi)
    answer = street.grounder().session().say("turn around and park behind the blue car")
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert answer.target.ego_m[0] > 26
    assert len(answer.steps) == 2


def test_one_that_only_one_vehicle_fits_needs_no_antecedent() -> None:
    answer = row().say("stop behind the blue one")
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "blue"
    assert two_whites().say("stop behind the white one").status == "ambiguous"


def test_a_refused_candidate_and_the_middle_one() -> None:
    session = two_whites()
    session.say("stop next to the white car")
    answer = session.say("not the near one")
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "left"
    street = Street().car("a", 12, -5, WHITE).car("b", 20, 5, WHITE, yaw_rad=np.pi).car("c", 28, -5, WHITE)
    session = street.grounder().session()
    assert len(session.say("stop next to the white car").candidates) == 3
    answer = session.say("the middle one")
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "b"
