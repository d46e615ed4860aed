"""The language model is asked where the grammar left words out, and its reading is compared."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import pytest
from street import BLUE, RED, Street

from appocc.errors import DataError
from grounding import Answer, Grounder
from grounding.language import Reading, parse
from grounding.language.llm import ChatEndpoint

PARTLY = "park behind the red car and flibber"


@dataclass
class Model:
    """A language model that reads every sentence as another one."""

    reads: str
    asked: list[str] = field(default_factory=list)

    def read(self, text: str) -> Reading:
        self.asked.append(text)
        if not self.reads:
            raise DataError("the language model was not used: no answer")
        return parse(self.reads)


def ground(text: str, model: Model) -> tuple[Answer, Grounder]:
    street = Street().car("red", 14, -5, RED).car("blue", 28, -5, BLUE)
    grounder = Grounder(llm=cast(ChatEndpoint, model))
    grounder.set_scene(street.bev(), street.boxes())
    return grounder.ground(text), grounder


def test_it_is_not_asked_if_the_grammar_used_every_word() -> None:
    model = Model("park behind the blue car")
    assert ground("park behind the red car", model)[0].status == "ok"
    assert model.asked == []


def test_the_same_reading_confirms_the_answer() -> None:
    model = Model("park behind the red car")
    answer, _ = ground(PARTLY, model)
    assert model.asked == [PARTLY]
    assert answer.status == "ok"
    assert "the language model reads the same" in answer.reasons


@pytest.mark.parametrize(("number", "referent"), [(1, "red"), (2, "blue")])
def test_another_reading_is_asked_about(number: int, referent: str) -> None:
    answer, _ = ground(PARTLY, Model("park behind the blue car"))
    assert (answer.status, answer.target) == ("ambiguous", None)
    assert "red car" in answer.question
    assert "blue car" in answer.question
    chosen = answer.choose(number)
    assert chosen.referent is not None
    assert chosen.referent.item.id == referent


def test_a_conversation_takes_the_reading_that_is_chosen() -> None:
    _, grounder = ground(PARTLY, Model("park behind the blue car"))
    session = grounder.session()
    assert session.say(PARTLY).status == "ambiguous"
    answer = session.say("2")
    assert answer.referent is not None
    assert answer.referent.item.id == "blue"
    assert session.goal is not None


def test_a_command_that_only_the_model_reads_is_asked_about() -> None:
    answer, _ = ground("glorp gleep", Model("park behind the red car"))
    assert answer.status == "ambiguous"
    assert answer.choose(1).status == "ok"


def test_a_model_that_fails_is_told_and_not_needed() -> None:
    answer, _ = ground(PARTLY, Model(""))
    assert any("was not used" in reason for reason in answer.reasons)
