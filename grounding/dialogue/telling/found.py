"""Answers that tell which vehicles or people fit a description, and whether any does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import find_fitting
from grounding.dialogue.telling.measures import describe_one
from grounding.dialogue.telling.reports import NOT_KNOWN, aside, ask_again, tell_seen, unknown
from grounding.dialogue.telling.things import DESCRIBING, describe_any, find_by_it, find_told, name_unmapped
from grounding.language import Reading, WordCategory
from grounding.language.questions import Question
from grounding.language.syntax.word_categories import NOUNS
from grounding.query import Referent
from grounding.referent.resolver import MAX_CANDIDATES, Candidate, find_all, resolve
from grounding.scene_object import SceneObject
from grounding.vocabulary import PERSON_NOUNS

# Centres of vehicles next to each other are at most this far apart.
_TOGETHER_M = 8.0
BEFORE = (f"{NOT_KNOWN}: what it did before",)
# Words that name another place or another kind of thing than the last answer was about.
_PLACING = (WordCategory.RELATION, WordCategory.WHERE, WordCategory.SIDE, WordCategory.PERSON)
_COUNTING = (WordCategory.SUPERLATIVE, WordCategory.ORDINAL)


def tell_found(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell which vehicles or people fit a description, and whether any does; the best one is "it" then."""
    asked = talk.state.question
    which = "which" in question.kinds
    points_out = "who" in question.kinds or question.of_us  # "who is behind us?" is about the street
    if which and not points_out and asked is not None and asked.question and len(asked.candidates) > 1:
        return ask_again(talk, text)
    if which and not question.words:
        return tell_seen(talk, text)
    if not which and (unmapped := name_unmapped(talk, question.words)):
        return unknown(talk, text, f"'{unmapped}'")
    question = replace(question, words=_complete(talk, question))
    reading = describe_any(talk, question.words)
    sought = reading.query.referent if reading is not None else None
    if reading is None or sought is None:
        return None
    if among := _find_among_told(talk, reading):
        talk.state = replace(talk.state, focus=(among[0], sought))
        talk.listed = talk.told_ids()  # "and the second one?" is about the same
        return aside(talk, text, *(describe_one(one.item, talk.scene) for one in among[:MAX_CANDIDATES]))
    if "who" in question.kinds and sought.anaphora:
        return None  # "who's that in the red?" asks for a person
    return _tell_all(talk, text, question, reading, _as_seen(talk, sought))


def _as_seen(talk: Conversation, sought: Referent) -> Referent:
    """Return a description of bicycles for one of bikes where only these are seen."""
    if not sought.head.startswith("bike") or find_all(sought, talk.scene):
        return sought
    bicycles = replace(sought, noun="bicycle")
    return bicycles if find_all(bicycles, talk.scene) else sought


def _complete(talk: Conversation, question: Question) -> str:
    """Return the words of a question with what they leave out: us, or vehicles of any kind."""
    categories = {one.category for one in talk.read(question.words).tokens}
    if categories == {WordCategory.RELATION} and (question.of_us or talk.meant is None):
        return f"{question.words} us"  # "what do you see behind?"
    if "else" in question.kinds and WordCategory.COLOUR in categories and categories.isdisjoint(NOUNS):
        return f"{question.words} vehicles"  # "what else is red?"
    return question.words


def _tell_all(talk: Conversation, text: str, question: Question, reading: Reading, sought: Referent) -> Answer:
    """Tell what fits a description."""
    which = "which" in question.kinds
    # "White cars ahead" is also read as what is the car's own.
    plural = any(one.form in ("plural", "own") for one in reading.tokens if one.category in DESCRIBING)
    plural = plural or sought.head == "people"
    one_only = which and not plural and "else" not in question.kinds
    here = [] if reading.query.secondary else _all_like(talk, sought)
    if "together" in question.kinds:
        here = [one for one in here if any(one is not other and _are_together(one, other) for other in here)]
    by_it = find_by_it(talk, question.words, reading)
    found = by_it or resolve(replace(reading.query, referent=replace(sought, definite=one_only)), talk.scene)
    likely = [one for one in found.candidates if one.item in here or reading.query.secondary]
    note = BEFORE if question.event else ()
    if "else" in question.kinds:
        told = {*talk.told_ids(), *([talk.meant.item.id] if talk.meant else [])}
        here, likely = [one for one in here if one.id not in told], [one for one in likely if one.item.id not in told]
        if told and not (here or likely) and found.status != "not_found":
            return aside(talk, text, f"nothing else here fits '{sought.phrase()}'")
    if found.status == "not_found" or not (here or likely):
        plain = sought.noun in PERSON_NOUNS or (sought.noun == "vehicle" and not sought.colour)
        odd = found.status == "not_found" and (reading.query.secondary or plain)
        best = () if odd else found.candidates[:1]
        near = [describe_one(one.item, talk.scene) for one in best]
        if best and found.status != "not_found":
            talk.state = replace(talk.state, focus=(best[0], sought))
        unsure = found.reasons if found.status == "not_found" else (f"nothing here is certainly '{sought.phrase()}'",)
        return aside(talk, text, *unsure, *near, *note)
    if likely:
        talk.state = replace(talk.state, focus=(likely[0], sought))
    items = [*dict.fromkeys((*(one.item for one in likely[:1]), *here))]
    talk.list_items(items[:1] if one_only else items)
    told_of = [describe_one(one, talk.scene) for one in items[: 1 if one_only else MAX_CANDIDATES]]
    more = [f"and {len(items) - len(told_of)} farther away"] if len(items) > len(told_of) and not one_only else []
    if which and not one_only:
        told_of = [f"{len(items)} fit '{sought.phrase()}'", *told_of]
    elif not which and len(items) >= sought.number:
        told_of[0] = f"yes: {told_of[0]}"
    return aside(talk, text, *told_of, *more, *note)


def _find_among_told(talk: Conversation, reading: Reading) -> list[Candidate]:
    """Return those of the things told last that a description counts among them: "which one is the nearest?"."""
    last, referent = talk.last_told, reading.query.referent
    if last is None or referent is None or len(last.ids) < 2 or reading.query.secondary:
        return []
    counts = any(one.category in _COUNTING for one in reading.tokens)
    if not counts or any(one.category in _PLACING and one.text not in last.question.words for one in reading.tokens):
        return []
    sought = replace(reading.query, referent=replace(referent, anaphora=True, in_line=False))
    return find_fitting(reading.with_query(sought), find_told(talk), talk.scene)


def _all_like(talk: Conversation, sought: Referent) -> list[SceneObject]:
    """Return all objects that fit a description; if some are of its very class or colour, only these."""
    here = list(find_all(replace(sought, definite=True, number=1), talk.scene))
    here = [one for one in here if one.common_name == sought.noun] or here
    return [one for one in here if sought.colour in (talk.scene.colour_name(one) or "").split()] or here


def _are_together(one: SceneObject, other: SceneObject) -> bool:
    """Return whether two objects stand next to each other, in a row or side by side."""
    return float(np.linalg.norm(one.centre_m - other.centre_m)) < _TOGETHER_M
