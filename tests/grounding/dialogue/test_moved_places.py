"""Places that are moved in a conversation, and those that are on offer: what is done, and what is told of it."""

from __future__ import annotations

import pytest
from street import RED, WHITE, Street

from grounding.answer import Answer
from grounding.dialogue.session import Session


def told(answer: Answer) -> str:
    return "\n".join(answer.reasons)


def one_car() -> Session:
    session: Session = Street().car("r", 30, -5, RED).grounder().session()
    return session


@pytest.mark.parametrize("reply", ["a bit further back", "leave another two metres", "two metres closer to us"])
def test_a_moved_place_is_told_as_it_is(reply: str) -> None:
    session = one_car()
    before = session.say("park behind the red car")
    moved = session.say(reply)
    assert moved.status == "ok"
    assert before.plan.of_place
    assert not {*before.plan.of_place[:1]} & {*moved.reasons}
    assert "short of it" in told(moved)


def test_the_last_move_alone_is_told() -> None:
    session = one_car()
    for reply in ("stop behind the red car", "four metres back", "one metre forward"):
        answer = session.say(reply)
    assert "1 m ahead" in told(answer)
    assert "4 m back" not in told(answer)


def offered() -> Session:
    """Returns a conversation in which a place beyond a car is on offer: there is no room behind it."""
    street = Street().car("w", 14, -5, WHITE).car("r", 19.5, -5, RED)
    session: Session = street.grounder().session()
    answer = session.say("park behind the red car")
    assert answer.plan.nearest is not None, answer.text()
    assert session.proposes
    return session


def offer_m(session: Session) -> float:
    question = session._talk.state.question
    assert question is not None
    assert question.plan.nearest is not None
    return float(question.plan.nearest.ego_m[0])


@pytest.mark.parametrize(
    ("reply", "sign"),
    [
        ("a bit further on", 1),
        ("ok but one metre further forward", 1),
        ("yes but a bit nearer to us", -1),
        ("a metre back", -1),
    ],
)
def test_a_wish_takes_the_place_on_offer(reply: str, sign: int) -> None:
    session = offered()
    before = offer_m(session)
    answer = session.say(reply)
    if answer.target is not None:
        assert answer.status == "ok"
        assert sign * (float(answer.target.ego_m[0]) - before) > 0.3
    else:
        assert "no room" in told(answer)
        assert session.proposes


@pytest.mark.parametrize("reply", ["could you leave four metres, there's a pram to unload", "yes but leave 4 metres"])
def test_a_gap_is_left_from_the_place_on_offer(reply: str) -> None:
    session = offered()
    offer = offer_m(session)
    answer = session.say(reply)
    assert answer.status == "ok", answer.text()
    assert answer.target is not None
    assert abs(float(answer.target.ego_m[0]) - 19.5) > max(abs(offer - 19.5) - 0.5, 4 + 4)


def test_what_the_place_on_offer_has_no_room_for_is_told() -> None:
    session = offered()
    answer = session.say("thirty metres to the right")
    assert "no room" in told(answer)
    assert session.proposes


@pytest.mark.parametrize(("reply", "axis", "sign"), [("one metre to the left", 1, 1), ("half a metre back", 0, -1)])
def test_a_side_is_no_vehicle_that_a_gap_is_left_to(reply: str, axis: int, sign: int) -> None:
    session = one_car()
    before = session.say("stop behind the red car").target
    after = session.say(reply).target
    assert before is not None
    assert after is not None
    assert sign * float(after.ego_m[axis] - before.ego_m[axis]) > 0.3


def test_closer_to_us_is_the_near_end() -> None:
    session = one_car()
    beyond = session.say("stop just past the red car").target
    short = session.say("closer to us").target
    assert beyond is not None
    assert short is not None
    assert float(short.ego_m[0]) < 30 < float(beyond.ego_m[0])


@pytest.mark.parametrize(
    "reply", ["nearer the red one", "a bit closer to the red car", "slightly nearer the red car"]
)
def test_a_place_between_two_moves_towards_one_of_them(reply: str) -> None:
    street = Street().car("w", 12, -5, WHITE).car("r", 28, -5, RED)
    session: Session = street.grounder().session()
    before = session.say("park between the white car and the red car").target
    answer = session.say(reply)
    assert before is not None
    assert answer.target is not None, answer.text()
    assert 0.3 < float(answer.target.ego_m[0] - before.ego_m[0]) < 5
    assert "short of the red car" in told(answer)


def test_a_place_that_is_ruled_out_is_not_offered() -> None:
    street = Street().car("a", 12, -5, RED).car("b", 17.5, -5, WHITE)
    answer = street.grounder().session().say("don't park behind the red car, park behind the white one")
    nearest = answer.plan.nearest
    assert answer.target is None, answer.text()
    assert nearest is None or float(nearest.ego_m[0]) > 12 - 4.5 / 2 or abs(float(nearest.ego_m[1]) + 5) > 2


@pytest.mark.parametrize("text", ["actually the first one after all", "on second thoughts, the first one"])
def test_the_first_one_after_all_is_the_first_plan(text: str) -> None:
    street = Street().car("w", 14, -5, WHITE).car("r", 32, -5, RED)
    session: Session = street.grounder().session()
    first = session.say("stop next to the white car")
    session.say("stop behind the red car")
    answer = session.say(text)
    assert answer.target is not None
    assert first.target is not None
    assert answer.target.cell == first.target.cell


@pytest.mark.parametrize("wait", ["wait for her", "wait for that person please"])
def test_who_was_asked_about_is_waited_for(wait: str) -> None:
    street = Street().car("r", 32, -5, RED)
    street.car("p", 14, -6, WHITE, size_wlh_m=(0.6, 0.6, 1.7), category="human.pedestrian.adult")
    session: Session = street.grounder().session()
    session.say("is the person going to cross?")
    answer = session.say(wait)
    assert answer.pace == "standing", answer.text()
    assert answer.referent is not None
    assert answer.referent.item.id == "p"


@pytest.mark.parametrize("again", ["actually do follow it after all", "no, follow it again please"])
def test_what_was_followed_before_is_followed_again(again: str) -> None:
    street = Street().car("w", 34, -5, WHITE).car("r", 20, 0, RED)
    session: Session = street.grounder().session()
    session.say("follow the red car")
    session.say("stop behind the white car")
    answer = session.say(again)
    assert answer.query.action == "follow"
    assert answer.referent is not None
    assert answer.referent.item.id == "r"
    assert "'red car'" in told(answer)


def test_a_dropped_command_is_done_after_all() -> None:
    session = one_car()
    before = session.say("stop behind the red car").target
    session.say("never mind")
    answer = session.say("actually, do it after all")
    assert before is not None
    assert answer.target is not None
    assert answer.target.cell == before.cell


@pytest.mark.parametrize("correction", ["sorry, to the right", "no my mistake, right"])
def test_a_move_to_the_wrong_side_is_turned(correction: str) -> None:
    session: Session = Street().car("r", 50, -5, RED).grounder().session()
    before = session.say("stop in 20 metres").target
    session.say("a bit to the left")
    after = session.say(correction).target
    assert before is not None
    assert after is not None
    assert float(after.ego_m[1]) < float(before.ego_m[1])


def test_a_move_by_less_than_a_cell_is_one_cell() -> None:
    session = one_car()
    before = session.say("stop behind the red car").target
    after = session.say("20 cm back").target
    assert before is not None
    assert after is not None
    assert 0 < float(before.ego_m[0] - after.ego_m[0]) < 0.6
