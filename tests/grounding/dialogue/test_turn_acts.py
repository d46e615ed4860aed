"""Turns that the network and the grammar read together."""

from collections.abc import Callable

import numpy as np
import pytest
from street import BLUE, RED, WHITE, Street

from grounding import Grounder
from grounding.dialogue.session import Session
from grounding.dialogue.turns import own_act, vote_on_act
from grounding.language import parse
from grounding.language.replies import read_reply


def two_whites() -> Session:
    street = Street().car("right", 14, -5, WHITE).car("left", 15, 5, WHITE, yaw_rad=np.pi).car("red", 26, -5, RED)
    session: Session = street.grounder().session()
    assert session.say("stop next to the white car").status == "ambiguous"
    return session


def row() -> Session:
    session: Session = Street().car("near", 12, -5, RED).car("blue", 28, -5, BLUE).grounder().session()
    assert session.say("park behind the red car").status == "ok"
    return session


def test_an_act_is_voted_on() -> None:
    shares = {"yes": 0.6, "cancel": 0.4}
    assert vote_on_act(shares, ("", 1), np.array([1.0, 2.0, 0.0]))["yes"] == pytest.approx(0.6, abs=0.01)
    assert vote_on_act(shares, ("cancel", 1), np.array([1.0, 2.0, 0.0]))["cancel"] > 0.8
    assert vote_on_act(shares, ("cancel", 2), np.array([1.0, 2.0, 0.0]))["cancel"] == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize(
    ("text", "act"), [("2", "number"), ("a bit closer", "shift"), ("thanks", "remark"), ("the red one", "")]
)
def test_the_grammar_knows_the_act_of_a_pattern(text: str, act: str) -> None:
    assert own_act(read_reply(text), parse(text, revised=False))[0] == act


def test_a_description_among_reasons_is_another_vehicle() -> None:
    session = row()
    answer = session.say("sorry love, wrong one, it's the blue one my daughter is sitting in")
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id == "blue"


def test_a_reply_holds_before_a_reason_that_is_not_understood() -> None:
    session = row()
    assert session.say("Cancel. I'm taking a call first.").status == "ok"
    assert session.goal is None


def test_a_question_stays_open_if_what_is_described_is_not_there() -> None:
    session = two_whites()
    asked = session.question
    assert session.say("the one with the flowery curtains that my aunt would have loved").status != "ok"
    assert session.question == asked
    assert session.say("the one on the left").status == "ok"


def test_what_was_refused_is_not_asked_for_again() -> None:
    session: Session = Street().car("near", 12, -5, RED).car("blue", 28, -5, BLUE).grounder().session()
    assert session.say("ram the red car").plan.refused
    assert not session.say("behind the blue car").plan.refused


@pytest.mark.parametrize("make", [two_whites, row])
@pytest.mark.parametrize(
    "question",
    ["is there any red car around?", "are there any cars here", "any trucks about?", "what colour is the car?"],
)
def test_a_question_sets_no_goal(make: Callable[[], Session], question: str) -> None:
    session = make()
    before = session.goal
    assert session.say(question).status in ("ok", "ambiguous")
    assert session.goal is before


def test_a_pronoun_and_a_named_vehicle_are_the_two_of_a_gap() -> None:
    street = Street().car("near", 12, -5, RED).car("blue", 26, -5, BLUE).car("far", 40, -5, WHITE)
    session: Session = street.grounder().session()
    session.say("stop next to the red car")
    answer = session.say("now park between it and the blue car")
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert 12 < answer.target.ego_m[0] < 26
    moved = session.say("half a metre closer to the blue car")
    assert moved.target is not None
    assert 0.0 < moved.target.ego_m[0] - answer.target.ego_m[0] < 1.0


def test_a_vehicle_and_a_place_after_a_comma_are_both_taken() -> None:
    session = row()
    answer = session.say("the blue one, just in front of it")
    assert answer.status == "ok", answer.text()
    assert (answer.referent and answer.referent.item.id, answer.query.relation) == ("blue", "in_front_of")


@pytest.mark.parametrize("turn", ["Can you move up a metre or so?", "move up a metre", "scoot up one metre please"])
def test_moving_up_moves_the_goal_ahead(turn: str) -> None:
    session = Street().car("far", 30, -5, RED).grounder().session()
    goal = session.say("stop 8 metres behind the red car").target
    moved = session.say(turn)
    assert goal is not None
    assert moved.target is not None
    assert 0.5 < moved.target.ego_m[0] - goal.ego_m[0] < 1.5
    assert moved.referent is not None


def test_a_vehicle_and_a_place_answer_a_question() -> None:
    answer = two_whites().say("the one on the right, behind it")
    assert (answer.referent and answer.referent.item.id, answer.query.relation) == ("right", "behind")


def test_the_same_words_are_read_once_a_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    session, read = two_whites(), list[tuple[object, ...]]()
    original = Grounder.read

    def counted(grounder: Grounder, *words: object, alone: bool = True) -> object:
        read.append((*words, alone))
        return original(grounder, *words, alone=alone)  # type: ignore[arg-type]

    monkeypatch.setattr(Grounder, "read", counted)
    session.say("the one my nan used to drive, on the left")
    assert len(read) == len(set(read)) > 0


def test_sentences_that_are_asides_are_left_out() -> None:
    session = row()
    answer = session.say("I'm in no rush today. Stop behind the blue one.")
    assert (answer.status, answer.query.relation) == ("ok", "behind"), answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id == "blue"
    assert not answer.reading.dropped


def test_chat_with_a_verb_is_no_command() -> None:
    session = row()
    goal = session.goal
    for text in ("she's screaming her head off, the poor thing", "he should learn to park, that one"):
        answer = session.say(text)
        assert (answer.status, session.goal) == ("not_a_command", goal), answer.text()


def test_a_cancelled_plan_can_be_gone_back_to() -> None:
    session = row()
    session.say("forget it")
    assert session.goal is None
    answer = session.say("go back to what we had before")
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert (answer.referent.item.id, answer.query.relation) == ("near", "behind")


def test_more_repeats_the_last_shift() -> None:
    session = Street().car("red", 33, -5, RED).grounder().session()
    places = [session.say(text).target for text in ("stop behind the red car", "a bit further back", "a bit more")]
    along = [place.ego_m[0] for place in places if place is not None]
    assert len(along) == 3
    assert along[0] > along[1] > along[2]


@pytest.mark.parametrize("yaw_rad", [0.0, np.pi / 2, np.pi])
def test_who_is_collected_stands_at_the_kerb(yaw_rad: float) -> None:
    person = Street().car("van", 34, -5, BLUE)
    person.car("man", 26, -8.8, None, yaw_rad, size_wlh_m=(0.6, 0.6, 1.8), category="human.pedestrian.adult")
    answer = person.grounder().session().say("stop next to the man on the pavement by the blue car")
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id == "man"
    assert answer.target is not None
    assert abs(answer.target.ego_m[0] - 26) < 3
    assert answer.target.ego_m[1] < -4


def test_a_person_is_where_the_vehicle_is_if_no_people_are_known() -> None:
    answer = (
        Street()
        .car("near", 12, -5, RED)
        .car("blue", 28, -5, BLUE)
        .grounder()
        .ground("stop next to the guy by the blue car")
    )
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id == "blue"
    assert any("no people are known here" in reason for reason in answer.reasons)


def test_at_the_kerb_there_is_no_more_room_and_the_goal_stays() -> None:
    session = row()
    for _ in range(3):
        answer = session.say("a bit more to the right")
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert any("no room 2 m to the right" in reason for reason in answer.reasons)


def test_we_wait_for_people_who_are_not_known() -> None:
    session = row()
    assert session.say("and then wait for my mother").status == "ok"


def test_an_action_that_needs_a_vehicle_is_about_the_one_spoken_of() -> None:
    session = row()
    answer = session.say("just drive past instead")
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert (answer.referent.item.id, answer.query.action) == ("near", "drive_past")


@pytest.mark.parametrize(
    "turn",
    [
        *("clear the goal", "you can forget the plan", "please withdraw the target", "call it off", "oh, I give up"),
        *("delete that destination", "bin the whole thing", "call the whole thing off"),
    ],
)
def test_a_goal_is_dropped_in_other_words(turn: str) -> None:
    session = row()
    assert session.say(turn).status == "ok"
    assert session.goal is None


@pytest.mark.parametrize(
    "turn",
    ["print current goal", "confirm the target", "describe the plan in your own words", "which car have you chosen?"],
)
def test_the_goal_is_told_in_other_words(turn: str) -> None:
    session = row()
    assert "park behind the red car" in " ".join(session.say(turn).reasons)
    assert session.goal is not None


@pytest.mark.parametrize(
    "turn",
    [
        *("it's got a red car in front of it", "the one with a red car in front", "it has a red car ahead of it"),
        *("there's a red car in front of it", "the one which has a red car next to it"),
    ],
)
def test_a_candidate_is_told_by_its_neighbour(turn: str) -> None:
    street = Street().car("right", 14, -5, WHITE).car("left", 15, 5, WHITE, yaw_rad=np.pi).car("red", 21, -5, RED)
    session = street.grounder().session()
    assert session.say("stop next to the white car").status == "ambiguous"
    answer = session.say(turn)
    assert answer.referent is not None
    assert answer.referent.item.id == "right"
