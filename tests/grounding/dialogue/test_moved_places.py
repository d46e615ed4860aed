"""Places that are moved in a conversation, and those that are on offer: what is done, and what is told of it."""

from __future__ import annotations

import pytest
from street import RED, Street

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
