"""The vehicles and people that a question to the car is about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import only_named, read_description
from grounding.dialogue.telling.measures import describe_one
from grounding.language import Reading, WordCategory
from grounding.language.questions import Question
from grounding.query import Query, Referent
from grounding.referent.resolver import Candidate, Resolution, find_all, resolve
from grounding.referent.spatial_relations import fit_relation
from grounding.scene_object import SceneObject

# Least membership in a place at another vehicle.
_LEAST_FIT = 0.2
# The same of the next one along our way, however far it is.
_LEAST_IN_LINE = 0.05
# Most vehicles that are told of where the words fit several.
_MOST_TOLD = 3
# Words for vehicles and people, and all words that describe a thing, besides its place.
NAMING = (WordCategory.NOUN, WordCategory.MAKE, WordCategory.MODEL, WordCategory.PERSON, WordCategory.COLOUR)
_EMPTY = (WordCategory.ONE, WordCategory.THE)
POINTING = (WordCategory.PRONOUN, WordCategory.THAT)
# Words for what is neither a vehicle nor a person, and words after which another thing is named.
_UNMAPPED, _BEFORE_OTHERS = (WordCategory.THING, WordCategory.PART), (WordCategory.RELATION, WordCategory.WHERE)
DESCRIBING = (*NAMING, WordCategory.ONE, WordCategory.SUPERLATIVE, WordCategory.ORDINAL)


@dataclass(frozen=True, eq=False)
class Things:
    """The vehicles and people that a question is about.

    Attributes:
        found: they, best first.
        reasons: why there is none.
    """

    found: tuple[Candidate, ...] = ()
    reasons: tuple[str, ...] = ()

    @property
    def items(self) -> list[SceneObject]:
        """The objects."""
        return [one.item for one in self.found]


def names_thing(talk: Conversation, words: str) -> bool:
    """Return whether some words describe a thing by more than a pronoun or a place."""
    return bool(words) and any(one.category in DESCRIBING for one in talk.read(words).tokens)


def name_unmapped(talk: Conversation, words: str) -> str:
    """Return the thing that some words are about and no map shows, such as a shop; '' if they are about others."""
    named = ""
    for one in talk.read(words).tokens if words else ():
        if one.category in _BEFORE_OTHERS:
            break
        if one.category in DESCRIBING and one.category is not WordCategory.COLOUR:
            return ""
        named = one.text if one.category in _UNMAPPED else named
    return named


def describe_thing(talk: Conversation, words: str) -> Reading | None:
    """Return the description of a thing in some words; None if they describe none: a pronoun, or a place alone."""
    if not names_thing(talk, words):
        return None
    # "What vans are there?" after "the yellow van": a noun is not like what was spoken of, "the red one" is.
    tokens = talk.read(words).tokens
    nouns = any(one.category in (WordCategory.NOUN, WordCategory.PERSON) for one in tokens)
    points = any(one.category in POINTING for one in tokens)  # "vehicles behind it"
    if reading := read_description(words, None if nouns and not points else talk.antecedent, talk.readings):
        return reading
    named = only_named(talk.read(words).tokens)  # "it the blue car"
    return None if named is None else Reading(Query("", referent=named))


def describe_place(talk: Conversation, words: str) -> Reading | None:
    """Return the description of vehicles at a place: "in front of us"; None for other words."""
    reading = describe_thing(talk, f"vehicles {words}")
    named = reading.query.referent if reading is not None else None
    if reading is None or named is None or not (reading.query.secondary or named.qualifiers):
        return None
    if named.colour in [one.colour for one in reading.query.secondary]:  # that of "the red car" alone
        reading = reading.with_query(replace(reading.query, referent=replace(named, colour=None)))
    return reading


def _describe_one_at(talk: Conversation, words: str) -> Reading | None:
    """Return the description of a vehicle by its place alone, whatever was spoken of: "the one behind us"."""
    tokens = talk.read(words).tokens if words else ()
    at = next((i for i, one in enumerate(tokens) if one.category is WordCategory.ONE), None)
    if at is None:
        return None
    if at > 1:  # "the grey one behind us"
        return describe_thing(talk, " ".join("vehicle" if i == at else one.text for i, one in enumerate(tokens)))
    return describe_place(talk, " ".join(one.text for one in tokens if one.category not in _EMPTY))


def describe_any(talk: Conversation, words: str) -> Reading | None:
    """Return the description of a thing, or of vehicles at a place: "in front of the bus" is no bus."""
    tokens = talk.read(words).tokens if words else ()
    placed = any(one.category in (WordCategory.RELATION, WordCategory.WHERE) for one in tokens[:1])
    first = describe_place(talk, words) if placed else describe_thing(talk, words)
    return first or (describe_thing(talk, words) if placed else describe_place(talk, words))


def find_by_it(talk: Conversation, words: str, reading: Reading) -> Resolution | None:
    """Find what is described by its place at the vehicle in talk: "the one in front of it"; None for other words."""
    named, by = reading.query.referent, [one for one in reading.query.secondary if one.of == "referent"]
    points = any(one.category in POINTING for one in talk.read(words).tokens)
    if talk.meant is None or named is None or len(by) != 1 or not points:
        return None
    table = talk.scene.table
    rows = {item.id: row for row, item in enumerate(table.items)}
    if talk.meant.item.id not in rows:
        return None
    fit = fit_relation(by[0].relation, table, np.array([rows[talk.meant.item.id]]))[:, 0]
    every = resolve(Query("", referent=replace(named, definite=False)), talk.scene, len(rows)).candidates
    least = _LEAST_IN_LINE if by[0].relation in ("past", "before") else _LEAST_FIT
    there = sorted((one for one in every if fit[rows[one.item.id]] >= least), key=lambda one: -fit[rows[one.item.id]])
    if not there:
        beyond = _find_beyond(talk, rows[talk.meant.item.id]) if by[0].relation == "behind" else None
        farther = (f"beyond it, as we drive: {describe_one(beyond, talk.scene)}",) if beyond is not None else ()
        return Resolution("not_found", (), (f"nothing is seen {by[0].relation.replace('_', ' ')} it", *farther))
    return Resolution("ok", tuple(there), ())


def find_told(talk: Conversation) -> list[Candidate]:
    """Return what the answer told that this turn may follow up, nearest first."""
    ids, most = talk.told_ids(), len(talk.scene.table.items)
    if not ids:
        return []
    queries = (Query("", referent=Referent(noun, noun, definite=False)) for noun in ("vehicle", "person"))
    found = (one for query in queries for one in resolve(query, talk.scene, most).candidates)
    return sorted((one for one in found if one.item.id in ids), key=lambda one: one.item.distance_m(talk.scene.ego))


def _find_beyond(talk: Conversation, row: int) -> SceneObject | None:
    """Return the object that comes after one on our way, in its line; None without one."""
    table = talk.scene.table
    fit = fit_relation("past", table, np.array([row]))[:, 0]
    best = int(np.argmax(fit))
    return table.items[best] if fit[best] >= _LEAST_IN_LINE else None


def _is_called(found: Sequence[Candidate], reading: Reading) -> bool:
    """Return whether the best of what is found is called as a description calls it."""
    noun = reading.query.referent.noun if reading.query.referent is not None else "vehicle"
    return noun == "vehicle" or any(one.item.common_name == noun for one in found)


def _find_sure(talk: Conversation, reading: Reading) -> tuple[Candidate, ...]:
    """Return what a description fits without doubt, wherever it is; first what is called so: "where is the van?"."""
    named = reading.query.referent
    ids = {one.id for one in find_all(named, talk.scene)} if named is not None and not reading.query.secondary else ()
    if named is None or not ids:
        return ()
    query = replace(reading.query, referent=replace(named, definite=False))
    every = resolve(query, talk.scene, len(talk.scene.table.items)).candidates
    fitting = tuple(one for one in every if one.item.id in ids)
    return tuple(one for one in fitting if one.item.common_name == named.noun) or fitting


def find_things(talk: Conversation, question: Question) -> Things:
    """Find what a question is about: a vehicle that it describes, each that it offers, else the one in talk."""
    if question.options and not names_thing(talk, question.words):
        each = [find_things(talk, replace(question, words=one, options=())) for one in question.options]
        return Things(tuple(one for things in each for one in things.found), sum((one.reasons for one in each), ()))
    reading = describe_thing(talk, question.words) or _describe_one_at(talk, question.words)
    if reading is None:
        tokens = talk.read(question.words).tokens if question.words else ()
        points = any(one.category in POINTING for one in tokens)
        of_us = question.of_us and not points
        return Things() if of_us or talk.meant is None else Things((talk.meant,))
    spoken_of = None if reading.query.secondary else talk.in_focus(reading.query)
    if spoken_of is not None:
        return Things((spoken_of,))
    found = find_by_it(talk, question.words, reading) or resolve(reading.query, talk.scene)
    if found.status == "not_found" and (at_place := _describe_one_at(talk, question.words)) is not None:
        found = resolve(at_place.query, talk.scene)  # the one behind us is no bus
    loose = found.status == "ok" and not _is_called(found.candidates[:1], reading)  # "a van" is no tall car
    if (found.status == "ambiguous" or loose) and (sure := _find_sure(talk, reading)):
        found = replace(found, status="ok" if len(sure) == 1 else "ambiguous", candidates=sure)
    if found.status == "not_found" or not found.candidates:
        return Things(reasons=found.reasons)
    if found.status == "ambiguous" and len(found.candidates) == 1:
        sought = reading.query.referent
        unsure = f"nothing here is certainly '{sought.phrase() if sought else question.words}'"
        return Things(reasons=(unsure, describe_one(found.candidates[0].item, talk.scene)))
    several = found.status == "ambiguous"
    things = found.candidates[: _MOST_TOLD if several else 1]
    if not several and reading.query.referent is not None:
        talk.state = replace(talk.state, focus=(things[0], reading.query.referent))
    return Things(tuple(things))
