"""The vehicles and people that a question to the car is about."""

from __future__ import annotations

from dataclasses import dataclass, replace

from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import only_named, read_description
from grounding.dialogue.telling.measures import describe_one
from grounding.language import Reading, WordCategory
from grounding.language.questions import Question
from grounding.query import Query
from grounding.referent.resolver import Candidate, resolve
from grounding.scene_object import SceneObject

# Most vehicles that are told of where the words fit several.
_MOST_TOLD = 3
# Words for vehicles and people, and all words that describe a thing, besides its place.
NAMING = (WordCategory.NOUN, WordCategory.MAKE, WordCategory.MODEL, WordCategory.PERSON, WordCategory.COLOUR)
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


def describe_thing(talk: Conversation, words: str) -> Reading | None:
    """Return the description of a thing in some words; None if they describe none: a pronoun, or a place alone."""
    if not names_thing(talk, words):
        return None
    # "What vans are there?" after "the yellow van": a noun is not like what was spoken of, "the red one" is.
    nouns = any(one.category in (WordCategory.NOUN, WordCategory.PERSON) for one in talk.read(words).tokens)
    if reading := read_description(words, None if nouns else talk.antecedent, talk.readings):
        return reading
    named = only_named(talk.read(words).tokens)  # "it the blue car"
    return None if named is None else Reading(Query("", referent=named))


def describe_place(talk: Conversation, words: str) -> Reading | None:
    """Return the description of vehicles at a place: "in front of us"; None for other words."""
    reading = describe_thing(talk, f"vehicles {words}")
    named = reading.query.referent if reading is not None else None
    placed = reading is not None and (reading.query.secondary or (named is not None and named.qualifiers))
    return reading if placed else None


def describe_any(talk: Conversation, words: str) -> Reading | None:
    """Return the description of a thing, or of vehicles at a place: "in front of the bus" is no bus."""
    tokens = talk.read(words).tokens if words else ()
    placed = any(one.category in (WordCategory.RELATION, WordCategory.WHERE) for one in tokens[:1])
    first = describe_place(talk, words) if placed else describe_thing(talk, words)
    return first or (describe_thing(talk, words) if placed else describe_place(talk, words))


def find_things(talk: Conversation, question: Question) -> Things:
    """Find what a question is about: a vehicle that it describes, else the one that is spoken of."""
    reading = describe_thing(talk, question.words)
    if reading is None:
        tokens = talk.read(question.words).tokens if question.words else ()
        points = any(one.category in (WordCategory.PRONOUN, WordCategory.THAT) for one in tokens)
        of_us = question.of_us and not points
        return Things() if of_us or talk.meant is None else Things((talk.meant,))
    spoken_of = None if reading.query.secondary else talk.in_focus(reading.query)
    if spoken_of is not None:
        return Things((spoken_of,))
    found = resolve(reading.query, talk.scene)
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
