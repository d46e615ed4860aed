"""Turns of several sentences or clauses, and what they refer back to."""

from typing import Any

import numpy as np
import pytest
from street import BLACK, BLUE, GREEN, RED, WHITE, Street

from grounding import Grounder
from grounding.answer import Answer
from grounding.dialogue.session import Session
from grounding.language import Reading, parse

PERSON = {"size_wlh_m": (0.6, 0.6, 1.7), "category": "human.pedestrian.adult"}


def referent(answer: Answer) -> str | None:
    return answer.referent.item.id if answer.referent is not None else None


def row(*, colours: tuple[tuple[int, int, int], ...] = (RED, BLUE, GREEN)) -> Session:
    street = Street()
    for name, x_m, rgb in zip("abc", (10, 21, 32), colours, strict=False):
        street.car(name, x_m, -5, rgb)
    session: Session = street.grounder().session()
    return session


def behind_a_slow_one() -> Session:
    session: Session = (
        Street().car("slow", 18, -1.75, BLUE, speed_mps=4.0).car("red", 34, -6, RED).grounder().session()
    )
    assert session.say("overtake the blue car").status == "ok"
    return session


@pytest.mark.parametrize(
    "text",
    [
        "Don't overtake. Just stay behind it.",
        "never mind overtaking then, just stay behind it",
        "and then stay behind it",
    ],
)
def test_who_stays_behind_does_not_overtake(text: str) -> None:
    session = behind_a_slow_one()
    answer = session.say(text)
    assert (answer.status, referent(answer)) == ("ok", "slow"), answer.text()
    assert session.goal is not None
    assert [step.query.action for step in session.goal.steps or (session.goal,)] != ["overtake"]
    assert len(session.goal.steps) < 2


def test_a_sentence_that_comes_to_nothing_is_a_reason() -> None:
    session = row(colours=(WHITE, WHITE))
    session.say("park behind the white car")
    answer = session.say("The second one, please. It's right outside my house.")
    assert (answer.status, referent(answer)) == ("ok", "b"), answer.text()


def test_who_is_asked_about_is_who_is_meant_next() -> None:
    street = Street().car("red", 14, -5, RED).car("her", 28, -7, GREEN, **PERSON)  # type: ignore[arg-type]
    session = street.grounder().session()
    session.say("stop behind the red car")
    answer = session.say("See the person standing up there? Go to her.")
    assert (answer.status, referent(answer)) == ("ok", "her"), answer.text()


def test_clauses_that_ask_for_nothing_are_left_out() -> None:
    answer = row().say("Could you park behind the blue car please, my violin is in the trunk and it hates bumps")
    assert (answer.status, referent(answer), answer.query.relation) == ("ok", "b", "behind"), answer.text()


@pytest.mark.parametrize(
    "text", ["pull over on the left. or actually right", "follow the car, wait, is it the car? no, the truck"]
)
def test_clauses_that_may_correct_are_not_left_out(text: str) -> None:
    assert row().say(text).status != "ok"


@pytest.mark.parametrize("text", ["the middle one", "middle"])
def test_the_middle_one_of_all_that_fit(text: str) -> None:
    street = Street().car("a", 8, -5, WHITE).car("b", 18, -5, WHITE).car("c", 36, -5, WHITE)
    session = street.grounder().session()
    assert len(session.say("park behind the white car").candidates) == 2
    assert referent(session.say(text)) == "b"


@pytest.mark.parametrize("count", [3, 5])
def test_the_middle_one_after_another_one(count: int) -> None:
    street = Street()
    for i in range(count):
        street.car("abcde"[i], 8 + 8 * i, -5, WHITE)
    session = street.grounder().session()
    session.say("park behind the third white car")
    assert referent(session.say("it's the middle one, sorry")) == "abcde"[count // 2]


def test_the_last_one_of_all_that_were_counted() -> None:
    street = Street().car("a", 8, -5, WHITE).car("b", 18, -5, WHITE).car("c", 36, -5, WHITE)
    session = street.grounder().session()
    assert len(session.say("park behind the white car").candidates) == 2
    session.say("how many are there?")
    answer = session.say("try the last of them")
    assert (answer.status, referent(answer)) == ("ok", "c"), answer.text()


@pytest.mark.parametrize("text", ["not the first one cause hers has stickers", "number too"])
def test_the_other_one_of_two(text: str) -> None:
    session = row(colours=(WHITE, WHITE))
    session.say("park behind the white car")
    answer = session.say(text)
    assert (answer.status, referent(answer)) == ("ok", "b"), answer.text()


def test_back_to_the_first_one_after_its_distance_was_changed() -> None:
    session = row()
    session.say("park behind the red car")
    session.say("no, the blue one")
    session.say("leave three metres")
    assert referent(session.say("go back to the first one")) == "a"


def test_back_to_a_described_one() -> None:
    session = row()
    for text in ("park behind the red car", "no, the blue one", "the green one"):
        session.say(text)
    assert referent(session.say("go back to the red one")) == "a"


def test_a_description_that_names_the_wrong_colour_too() -> None:
    street = (
        Street()
        .car("a", 12, -5, BLACK)
        .car("b", 30, -6, BLUE, size_wlh_m=(2.5, 11.0, 3.2), category="vehicle.bus.rigid")
    )
    session = street.grounder().session()
    session.say("park behind the black car")
    answer = session.say("excuse me, I said black but I must go to the bus")
    assert (answer.status, referent(answer)) == ("ok", "b"), answer.text()


def test_one_that_was_offered_is_meant() -> None:
    van = {"size_wlh_m": (2.0, 5.4, 2.2)}
    street = Street().car("a", 12, -5, RED).car("b", 26, -5, RED, **van).car("c", 18, 5, GREEN, yaw_rad=np.pi)  # type: ignore[arg-type]
    session = street.grounder().session()
    assert session.say("stop behind the red one").status == "ambiguous"
    assert referent(session.say("the van, sorry")) == "b"
    assert referent(session.say("the car instead")) == "a"


def test_a_pause_keeps_the_goal_and_is_understood() -> None:
    session = row()
    goal = session.say("park behind the red car").target
    answer = session.say("hold up, wait a sec, my phone's ringing")
    assert (answer.status, answer.target) == ("ok", goal), answer.text()


def test_the_oncoming_lane_is_refused() -> None:
    session = row()
    session.say("park behind the red car")
    answer = session.say("just stop in the oncoming lane for a second")
    assert answer.plan.refused, answer.text()


def test_a_vehicle_and_its_place_named_in_a_reason() -> None:
    session = row()
    session.say("park in front of the red car")
    answer = session.say("wait, she says she's by the green car, go behind that")
    assert (referent(answer), answer.query.relation) == ("c", "behind"), answer.text()


@pytest.mark.parametrize(
    "text", ["park between the red one and the black one", "squeeze in between the red and the black"]
)
def test_between_two_that_are_named_by_colour(text: str) -> None:
    query = parse(text).query
    assert query.referent is not None
    assert (query.relation, query.referent.colour) == ("between", "red")
    assert [(part.colour, part.relation) for part in query.secondary] == [("black", "between")]


def test_a_candidate_is_told_by_its_distance_or_by_a_neighbour() -> None:
    street = Street().car("a", 14, -5, WHITE).car("blue", 20, 5, BLUE).car("b", 28, -5, WHITE)
    for text in ("the one at twenty eight metres", "the one past the blue car"):
        session = street.grounder().session()
        assert session.say("park behind the white car").status == "ambiguous"
        assert referent(session.say(text)) == "b", text


@pytest.mark.parametrize(
    "text",
    [
        *("actually skip the truck it looks mean", "leave the second part out", "forget the second stop"),
        *("no truck", "eh, without the blue one"),
    ],
)
def test_a_step_is_left_out_by_its_vehicle_or_its_number(text: str) -> None:
    street = (
        Street()
        .car("a", 14, -5, RED)
        .car("truck", 30, -5, BLUE, size_wlh_m=(2.4, 7.5, 3.2), category="vehicle.truck")
    )
    session = street.grounder().session()
    session.say("park behind the red car")
    assert len(session.say("and then when we're done there go to the big truck").steps) == 2
    answer = session.say(text)
    assert (len(answer.steps), referent(answer)) == (1, "a"), answer.text()


def test_half_understood_words_that_name_no_place_keep_the_goal() -> None:
    session = row()
    goal = session.say("park behind the red car").target
    session.say("lovely. I'll close my eyes a minute")
    assert session.goal is not None
    assert session.goal.target is goal


def test_how_many_there_are_is_told_while_the_question_is_open() -> None:
    session = Street().car("a", 18, -3, WHITE).car("b", 30, -3, WHITE).grounder().session()
    assert session.say("park behind the white car").status == "ambiguous"
    assert "2 fit 'white car'" in session.say("he didn't say which how many are there").text()


def test_of_two_vehicles_named_no_step_is_left_out_by_its_vehicle() -> None:
    session = row()
    session.say("park behind the red car")
    session.say("and then stop behind the green car")
    answer = session.say("forget the red car, just the green car")
    assert not any(step.referent and step.referent.item.id == "a" for step in answer.steps[1:]), answer.text()


@pytest.mark.parametrize(
    "again", ["if not, behind the red car ", "once it has gone, ", "if not, then the other one, "]
)
def test_what_is_read_of_a_turn_does_not_grow_with_its_repetitions(
    again: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads, read = list[str](), Grounder.read

    def count(self: Grounder, words: str, *about: Any, **how: Any) -> tuple[Reading, ...]:
        reads.append(words)
        return read(self, words, *about, **how)

    monkeypatch.setattr(Grounder, "read", count)
    session = row()
    session.say("stop behind the blue car")
    reads.clear()
    session.say("is there room? " + 40 * again)
    assert len(reads) < 120
