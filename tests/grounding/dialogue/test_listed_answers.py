"""Answers to a question that lists vehicles or people: every description in them counts."""

import numpy as np
import pytest
from street import BLACK, RED, WHITE, Street

from grounding.answer import Answer
from grounding.dialogue.descriptions import find_others, reading_of
from grounding.dialogue.session import Session
from grounding.query import Query, Referent
from grounding.referent.resolver import resolve

VAN = {"size_wlh_m": (2.0, 5.4, 2.3)}


def whites() -> Session:
    """Ask which of the white cars is meant: two on the right, with a black van between them, and two on the left."""
    street = Street().car("near", 8, -5, WHITE).car("van", 14, -5, BLACK, **VAN)  # type: ignore[arg-type]
    street.car("far", 20, -5, WHITE).car("left", 11, 5, WHITE, yaw_rad=np.pi).car("end", 23, 5, WHITE, yaw_rad=np.pi)
    session: Session = street.grounder().session()
    asked = session.say("stop next to the white car")
    assert asked.status == "ambiguous"
    assert len(asked.candidates) == 4, asked.text()
    return session


def referent(answer: Answer) -> str | None:
    return answer.referent.item.id if answer.referent is not None else None


def left(answer: Answer) -> set[str]:
    return {one.item.id for one in answer.candidates} if answer.status == "ambiguous" else set()


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("the furthest one, on the other side of the road", "end"),
        ("on our side, the closest", "near"),
        ("yes, the nearest one beyond the van", "far"),
        ("the one on the left that's closest to us", "left"),
        ("Across the road. The further one, I think.", "end"),
        ("not the ones on the left, the last of them", "far"),
        ("past the black van, but not on the left", "far"),
        ("further along on the right", "far"),
        ("one of the white ones, whichever is nearest", "near"),
        ("the nearest one, I'm so tired today", "near"),
        ("a white one not on the left, the nearer one", "near"),
        ("the one at the very end, on the left", "end"),
        ("that one there on the left, the nearer", "left"),
    ],
)
def test_all_descriptions_of_an_answer_count(said: str, meant: str) -> None:
    answer = whites().say(said)
    assert referent(answer) == meant, answer.text()


@pytest.mark.parametrize(
    ("said", "those"),
    [
        ("not the closest", {"far", "left", "end"}),
        ("not across the road", {"near", "far"}),
        ("the one that isn't on the right", {"left", "end"}),
    ],
)
def test_what_is_left_is_asked_about(said: str, those: set[str]) -> None:
    answer = whites().say(said)
    assert left(answer) == those, answer.text()


def test_a_neighbour_that_none_has_is_told_and_left_out() -> None:
    answer = whites().say("the closest one, past the bus")
    assert referent(answer) == "near", answer.text()
    assert "none is 'past the bus': it was left out" in answer.reasons


def test_a_neighbour_that_only_another_one_has_tells_that_one() -> None:
    street = Street().car("a", 8, -5, WHITE).car("b", 15, -5, WHITE).car("red", 22, -5, RED).car("c", 29, -5, WHITE)
    session = street.grounder().session()
    asked = session.say("stop next to the white car")
    assert "c" not in left(asked), asked.text()
    assert referent(session.say("the nearest one, just past the red car")) == "c"


def test_positions_that_contradict_each_other_are_asked_about() -> None:
    session = whites()
    numbered = session.candidates[1].item.id
    answer = session.say("the second one, the farthest")
    assert left(answer) == {numbered, "end"}, answer.text()


def test_a_number_beside_what_is_not_meant_counts_in_the_list() -> None:
    session = whites()
    third = session.candidates[2].item.id
    assert referent(session.say("not the second, the third")) == third


def test_any_of_a_description_is_one_with_a_place() -> None:
    answer = whites().say("either of those on our side, whichever is quicker to get to")
    assert (answer.status, referent(answer)) == ("ok", "near"), answer.text()


def test_a_command_is_no_description() -> None:
    session = whites()
    answer = session.say("Park in front of the black van.")
    assert (referent(answer), answer.query.relation) == ("van", "in_front_of"), answer.text()


def test_a_vehicle_that_is_not_listed_is_found_in_the_scene() -> None:
    assert referent(whites().say("neither, the black van")) == "van"
    assert referent(whites().say("none of those, stop by the van")) == "van"


@pytest.mark.parametrize("said", ["none of them, carry on", "neither, stop on the left instead"])
def test_none_of_them_before_another_wish(said: str) -> None:
    answer = whites().say(said)
    assert answer.status == "ok", answer.text()
    assert answer.referent is None


def test_none_of_them_asks_about_the_others() -> None:
    street = Street().car("a", 12, -5, RED).car("b", 14, 5, RED, yaw_rad=np.pi).car("behind", -12, -5, RED)
    session = street.grounder().session()
    assert left(session.say("stop next to the red car")) == {"a", "b"}
    assert left(session.say("neither of those")) == {"behind"}
    assert referent(session.say("yes")) == "behind"


def test_none_where_nothing_is_asked_drops_the_goal() -> None:
    session = Street().car("a", 20, -5, RED).grounder().session()
    assert session.say("stop behind the red car").status == "ok"
    assert session.say("none of these").status == "ok"
    assert session.goal is None


@pytest.mark.parametrize("said", ["whichever has the most space", "the one with more room behind it", "any will do"])
def test_the_one_with_room_is_taken(said: str) -> None:
    """Behind the first car stands another one."""
    street = Street().car("tight", 14, -5, WHITE).car("black", 8, -5, BLACK).car("free", 30, -5, WHITE)
    session = street.grounder().session()
    assert session.say("park behind the white car").status == "ambiguous"
    answer = session.say(said)
    assert (answer.status, referent(answer)) == ("ok", "free"), answer.text()


def test_all_people_behind_us_are_refused_at_once() -> None:
    person = {"size_wlh_m": (0.6, 0.6, 1.7), "category": "human.pedestrian.adult"}
    street = Street().car("ahead", 20, -7, RED, **person)  # type: ignore[arg-type]
    street.car("behind", -10, -5, RED, **person).car("other", -14, 7, RED, **person)  # type: ignore[arg-type]
    scene = street.scene()
    every = resolve(Query("", referent=Referent("person", "one", definite=False)), scene).candidates
    behind = reading_of(Referent("person", "one", qualifiers=("behind_ego",), in_line=True))
    assert [one.item.id for one in find_others(behind, every, scene)] == ["ahead"]
