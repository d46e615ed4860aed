"""Turns of several parts, of questions, and of what the grammar alone does not understand."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLUE, GREEN, RED, WHITE, Street

from grounding.dialogue.session import Session


def two_whites() -> Session:
    street = Street().car("ours", 16, -5, WHITE).car("across", 15, 5, WHITE, yaw_rad=np.pi).car("red", 34, -5, RED)
    session: Session = street.grounder().session()
    assert session.say("stop next to the white car").status == "ambiguous"
    return session


def row() -> Session:
    street = Street().car("near", 8, -5, WHITE).car("blue", 20, -5, BLUE).car("far", 31, -5, WHITE)
    session: Session = street.grounder().session()
    assert session.say("park in front of the nearest white car").status == "ok"
    return session


@pytest.mark.parametrize(
    ("reply", "referent"),
    [
        ("the one on our side of the road", "ours"),
        ("this side", "ours"),
        ("on the same side as us", "ours"),
        ("the one facing the same way as us", "ours"),
        ("the one on the other side", "across"),
        ("whichever is easier", "ours"),
    ],
)
def test_sides_and_headings_by_our_own(reply: str, referent: str) -> None:
    answer = two_whites().say(reply)
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id == referent


@pytest.mark.parametrize(
    ("reply", "referent", "relation"),
    [
        ("Actually no, the other one. In front of it, same as before.", "far", "in_front_of"),
        ("I don't trust that. The blue one, in front of it, it's nearer.", "blue", "in_front_of"),
        ("behind the blue one will do", "blue", "behind"),
        ("behind the blue one is fine", "blue", "behind"),
        ("Not in front. Past it.", "near", "past"),
        ("all right, then behind the blue one", "blue", "behind"),
        ("wait, I meant the blue one", "blue", "in_front_of"),
    ],
)
def test_a_correction_of_several_parts(reply: str, referent: str, relation: str) -> None:
    answer = row().say(reply)
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert (answer.referent.item.id, answer.query.relation, len(answer.steps)) == (referent, relation, 1)


def test_a_question_about_the_place_in_force() -> None:
    session = row()
    goal = session.goal
    answer = session.say("is there enough room there?")
    assert (answer.status, answer.reasons[0]) == ("ok", "yes: there is room for us at the goal")
    assert session.goal is goal


def test_a_step_that_is_no_longer_wanted_is_dropped() -> None:
    session: Session = Street().car("bus", 25, 0, GREEN, speed_mps=6).grounder().session()
    assert session.say("follow the green car").status == "ok"
    assert session.say("you can stop following it now").status == "ok"
    assert session.goal is None


def test_a_first_sentence_without_a_verb_asks() -> None:
    session: Session = Street().car("red", 20, -5, RED).grounder().session()
    answer = session.say("red one")
    assert (answer.status, answer.question) == ("ambiguous", "do you mean 'stop near red one'?")
    answer = session.say("behind it")
    assert (answer.status, answer.query.relation) == ("ok", "behind")


def test_a_person_is_named_by_the_colour_of_the_clothes() -> None:
    session: Session = Street().car("red", 20, -5, RED).grounder().session()
    query = session.say("wait for the woman in blue").query
    assert query.referent is not None
    assert (query.referent.noun, query.referent.colour) == ("person", "blue")


def test_a_shift_goes_as_far_as_there_is_room() -> None:
    session: Session = Street().car("a", 24, -5, RED).car("b", 12, -5, BLUE).grounder().session()
    before = session.say("park behind the red car").target
    answer = session.say("back 5 metres")
    assert before is not None
    assert answer.target is not None, answer.text()
    moved_m = before.ego_m[0] - answer.target.ego_m[0]
    assert 0.1 <= moved_m < 5.0
    assert any("there is room for no more" in reason for reason in answer.reasons)


def test_what_was_said_before_a_command_is_no_pronoun_of_it() -> None:
    session: Session = Street().car("red", 20, -5, RED).grounder().session()
    assert session.say("stop behind the yellow car").status == "not_found"
    answer = session.say("she must have left already. Then just park behind the red one.")
    assert (answer.status, answer.referent and answer.referent.item.id) == ("ok", "red")
