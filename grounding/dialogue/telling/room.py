"""Answers about room for us: at a place that is named, at the goal in force, and where we could stop."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from grounding.answer import Answer
from grounding.describe import describe_object
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import complete, has_verb, is_understood, names_pronoun, read_description
from grounding.dialogue.telling.between import describe_apart, find_pair
from grounding.dialogue.telling.measures import describe_gap
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.reports import aside, ask_again, inform, not_understood, unknown
from grounding.dialogue.telling.things import POINTING, find_told, names_thing
from grounding.goal.limits import is_in_the_road
from grounding.language import Reading, WordCategory
from grounding.language.questions import Question
from grounding.query import Query, Referent
from grounding.referent.ordinals import is_plural
from grounding.referent.resolver import Candidate
from grounding.requests import STOPS, Request, requests_of

# A place at each of several vehicles, and most of them that are told.
_AT_EACH = re.compile(r"\b(behind|in front of|ahead of|after|before|next to|beside) (?:it|them|each)\b")
_MOST_TOLD = 4
# What is too small for us where there is room, and the other way round; words of none.
_WRONG = {"yes": "nothing: there is room", "no": "there is no room"}
_YES_NO, _TURNED = re.compile(r"^(?:yes|no)(?=[:,]|$)"), {"yes": "no", "no": "yes"}
_NO_ROOM = re.compile(r"\bno (?:\w+ )?(?:gaps?|spaces?|room|places?|spots?|parking)\b")
# Words that name no place.
_EMPTY = (
    *(*POINTING, WordCategory.THERE, WordCategory.THE, WordCategory.ANY, WordCategory.EGO, WordCategory.POSSESSIVE),
    *(WordCategory.FILLER, WordCategory.GREETING, WordCategory.AUX),
)


def tell_room(talk: Conversation, text: str, words: str) -> Answer:
    """Tell whether there is a place; "do it" takes it then: "can we fit behind the red car?"."""
    if _NO_ROOM.search(text.lower()) and not names_thing(talk, words):
        return _tell_spot(talk, text)  # "is there really no gap?"
    base = talk.state.request.query if talk.state.request else Query("", "park")
    reading = _read_place(talk, words, base)
    if reading is not None and _is_between_several(reading.query):
        return _tell_spot(talk, text)  # "any gap between the parked cars?"
    if reading is None and (manoeuvre := _read_manoeuvre(talk, words)) is not None:
        return propose(talk, text, requests_of(said(manoeuvre, text)))
    if reading is None:
        return _tell_in_force(talk, text, words)
    chosen = talk.meant if names_pronoun(reading) else None
    query = replace(said(reading, text).query, action=base.action or "park")
    return propose(talk, text, [replace(one, chosen=chosen) for one in requests_of(reading.with_query(query))])


def _is_between_several(query: Query) -> bool:
    """Return whether a place is between any two of several vehicles: "between the parked cars"."""
    named = query.referent
    several = named is not None and is_plural(named.head) and not {"two", "both"} & {*query.command.split()}
    return query.relation == "between" and several and not any(one.relation == "between" for one in query.secondary)


def tell_room_at_each(talk: Conversation, text: str) -> Answer | None:
    """Tell at which of the vehicles that were told there is room: "which of them has more room behind it?"."""
    place, known = _AT_EACH.search(text.lower()), find_told(talk)
    if place is None or len(known) < 2:
        return None
    (reading,) = talk.readings(f"park {place[1]} it", Referent("vehicle", "vehicle"), alone=False)[:1]
    return _tell_at_each(talk, text, requests_of(said(reading, text)), known[:_MOST_TOLD])


def _tell_spot(talk: Conversation, text: str) -> Answer:
    """Tell where we could park, anywhere at the edge of the road."""
    return propose(talk, text, [Request(reading=Reading(Query(text, "park", ("park",))))])


def tell_gap_between(talk: Conversation, text: str, words: str) -> Answer | None:
    """Tell how long the gap between two vehicles is and whether there is room in it; None for other words."""
    found = find_pair(talk, words)
    if found is None or found[1].partner is None:
        return None
    reading, pair = found
    told = propose(talk, text, [replace(one, chosen=pair) for one in requests_of(said(reading, text))])
    apart, (answer, *why) = describe_apart(pair.item, found[1].partner, talk.scene), told.reasons
    return replace(told, reasons=(apart, f"there is {'room' if answer == 'yes' else 'no room'} for us", *why))


def _read_place(talk: Conversation, words: str, base: Query) -> Reading | None:
    """Return the reading of a place; None if the words name none: "ahead", where no vehicle was spoken of."""
    reading = complete(words, base, talk.antecedent, talk.readings)
    if reading is None or not reading.query.unresolved:
        return reading
    described = complete(words, base, Referent("vehicle", "one"), talk.readings)  # "behind the black one"
    named = described.query.referent if described is not None else None
    return described if named is not None and named.colour else None


def _read_manoeuvre(talk: Conversation, words: str) -> Reading | None:
    """Return the reading of a manoeuvre that there is room for: "to go round the van"; None for other words."""
    reading = talk.read(words) if words else None
    if reading is None or not (has_verb(reading) and is_understood(reading)):
        return None
    return reading if reading.query.referent is not None or reading.query.direction is not None else None


def propose(talk: Conversation, text: str, requests: Sequence[Request]) -> Answer:
    """Tell whether there is a place; "do it" takes it then."""
    answer = talk.answer_steps(requests)
    if answer.status == "ambiguous" and len(answer.candidates) > 1 and len(requests) == 1:
        return _tell_at_each(talk, text, requests, answer.candidates)
    if answer.status != "ok":
        if answer.plan.question and answer.plan.nearest is not None and answer.plan.instead is None:
            talk.state = replace(talk.state, question=answer, asked=tuple(requests), at=0)  # another place is offered
        return inform(talk, text, "no", *answer.reasons)
    asked = replace(answer, status="ambiguous", alternatives=(answer,))
    talk.state = replace(talk.state, question=asked, asked=tuple(requests), at=0)
    return inform(talk, text, "only in the road" if _is_in_the_road(answer) else "yes", *answer.reasons)


def _is_in_the_road(answer: Answer) -> bool:
    """Return whether a place to park would be in the way of others."""
    road, place = None if answer.scene is None else answer.scene.road, answer.target
    if road is None or place is None or answer.query.action not in ("park", "pull_over"):
        return False
    return is_in_the_road(place.cell, place.heading_ego_rad, road)


def _tell_in_force(talk: Conversation, text: str, words: str) -> Answer:
    """Tell whether there is room at the goal, or why a place is asked about; another vehicle is no goal."""
    state = talk.state
    question, goal = state.question, state.goal
    if question is not None and question.plan.question:
        return replace(ask_again(talk, text), reasons=("no", *question.reasons))
    if question is not None and question.question and question.candidates and state.request is not None:
        return _tell_at_each(talk, text, state.asked, question.candidates, state.at)
    described = read_description(words, talk.antecedent, talk.readings) if names_thing(talk, words) else None
    named = described.query.referent if described is not None else None
    if question is not None or (named is not None and not named.anaphora):
        return not_understood(talk, text, talk.read(text))
    tokens = talk.read(words).tokens if words else ()
    if goal is None and any(one.category in POINTING for one in tokens):
        return unknown(talk, text, "which place is meant")
    unused = " ".join(one.text for one in tokens if one.category not in _EMPTY)
    left_out = (f"left out: '{unused}'",) if unused else ()
    if goal is None:
        told = _tell_spot(talk, text)
        return replace(told, reasons=(*told.reasons, *left_out))
    stands = state.plan[-1].query.action in STOPS
    gap = (describe_gap(goal.target, talk.scene),) if stands and goal.target is not None else ()
    return inform(talk, text, "yes: there is room for us at the goal", *gap, *left_out)


def _tell_at_each(
    talk: Conversation, text: str, steps: Sequence[Request], candidates: Sequence[Candidate], at: int = 0
) -> Answer:
    """Tell whether there is room at each of the vehicles that one of the steps may mean; an open question stays."""
    told = list[str]()
    for one in candidates:
        chosen = (*steps[:at], replace(steps[at], chosen=one), *steps[at + 1 :])
        answer = talk.answer_steps(chosen, at)
        names = (describe_object(item, talk.scene) for item in (one.item, one.partner) if item is not None)
        meant = f"if the {' and the '.join(names)} is meant"
        why = "; ".join((answer.steps[at] if answer.steps else answer).plan.reasons)
        told.append(f"yes, {meant}" if answer.status == "ok" else f"no, {meant}: {why}")
    return aside(talk, text, *told)


def answer_spot(talk: Conversation, text: str, question: Question) -> Answer:
    """Answer where we could park: at the place that the question names, else anywhere at the edge of the road."""
    if question.words and _read_place(talk, question.words, Query("", "park")) is not None:
        return tell_room(talk, text, question.words)
    return _tell_spot(talk, text)


def answer_room(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Answer whether there is room, at a place or at each of several vehicles."""
    if "which" in question.kinds and (each := tell_room_at_each(talk, text)):
        return each
    told = tell_room(talk, text, question.words)
    if "wrong" not in question.kinds:
        return told
    return replace(told, reasons=tuple(_YES_NO.sub(lambda one: _WRONG[one[0]], one) for one in told.reasons))


def answer_tight(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether a place is too small: no, if there is room."""
    told = tell_room(talk, text, question.words)
    return replace(told, reasons=tuple(_YES_NO.sub(lambda one: _TURNED[one[0]], one) for one in told.reasons))
