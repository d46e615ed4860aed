"""Answers about other places and other vehicles than those of the plan; the goal in force stays."""

from __future__ import annotations

from dataclasses import replace

from grounding.answer import Answer
from grounding.describe import describe_step
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import complete, has_verb
from grounding.dialogue.merging import merge_request
from grounding.dialogue.telling.measures import describe_one
from grounding.dialogue.telling.phrases import ask
from grounding.dialogue.telling.reports import aside
from grounding.dialogue.telling.things import describe_thing, find_things, names_thing
from grounding.language import WordCategory
from grounding.language.questions import Question, read_further_words
from grounding.query import Query
from grounding.referent.resolver import Candidate
from grounding.requests import Request

_STAYS = "the goal stays as it is"
_PLACING = (WordCategory.RELATION, WordCategory.WHERE, WordCategory.SIDE, WordCategory.BETWEEN)


def tell_choice(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell of each of several places whether there is room: "is it better behind or in front?"."""
    if not question.options or any(names_thing(talk, one) for one in question.options):
        return None
    told = [_tell_option(talk, one) for one in question.options]
    return aside(talk, text, *told) if all(told) else None


def _tell_option(talk: Conversation, words: str) -> str:
    """Tell whether there is room at a place of the vehicle in talk; '' for words that name no place."""
    base = talk.state.request.query if talk.state.request else Query("", "park")
    reading = complete(words, base, talk.antecedent, talk.readings)
    if reading is None or talk.meant is None:
        return ""
    placed = merge_request(talk.state.request, reading.query) if talk.state.request else Request(reading=reading)
    answer = talk.answer_steps([replace(placed, chosen=talk.meant)])
    place = next((one for one in answer.reasons if one.startswith("the place is")), "there is room")
    if answer.status == "ok" and answer.plan.target is not None:
        return f"{words}: {place}"
    return f"{words}: no room"


def tell_other(talk: Conversation, text: str) -> Answer | None:
    """Tell of another vehicle, and ask whether the plan is to be about it: "what about the red car?"."""
    state, further = talk.state, read_further_words(text, talk.grounder.lexicon)
    if further is None or not further.proposes or state.goal is None or state.question or state.request is None:
        return None
    first = next((one.category for one in talk.read(further.words).tokens), None)
    if first in _PLACING or not names_thing(talk, further.words) or has_verb(talk.read(further.words)):
        return None
    things = find_things(talk, Question(("what",), further.words))
    told = [describe_one(one, talk.scene) for one in things.items] or list(things.reasons)
    (last, other) = (state.plan[-1:], things.found)
    if len(other) == len(last) == 1 and last[0].chosen is not None and last[0].chosen.item.id != other[0].item.id:
        return _offer_other(talk, text, further.words, other[0])
    return aside(talk, text, *told, *([_STAYS] if told else []))


def _offer_other(talk: Conversation, text: str, words: str, other: Candidate) -> Answer:
    """Tell of another vehicle, and ask whether the last step of the plan is to be about it."""
    last = talk.state.plan[-1]
    described = describe_thing(talk, words)
    named = described.query.referent if described is not None else last.query.referent
    query = replace(last.query, referent=named, command=text)
    request = replace(last, reading=last.reading.with_query(query), chosen=other, shifts=(), held=None)
    steps = (*talk.state.plan[:-1], request)
    answer = talk.answer_steps(steps)
    told = describe_one(other.item, talk.scene)
    if answer.status != "ok":
        return aside(talk, text, told, f"there is no place for us at it: {_STAYS}")
    question = f"shall we {describe_step(query, other, talk.scene)} instead?"
    offered = replace(ask((other,), request.reading, talk.scene), question=question)
    talk.offer = offered
    talk.state = replace(talk.state, question=offered, asked=steps, at=len(steps) - 1, offered=(other,))
    return aside(talk, text, told, _STAYS)
