"""Readings of the grammar as the reader network revises them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import pairwise
from typing import Any

from grounding.language.problems import ParseProblem
from grounding.language.reader.reader import default_reader
from grounding.language.reader.revision import Evidence, Revision
from grounding.language.reading import Reading
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import POLARITY, WordCategory
from grounding.query import Exclusion, Query, Referent
from grounding.vocabulary import REFUSED, verb_of

# Least probability of a reading that is acted upon unasked: a wrong goal costs as much as two needless questions.
_SURE = 0.5
# The same where the grammar finds no command (a mere statement asks for nothing), and where an unknown word may be
# the verb or the vehicle, or a negation may be read as its opposite.
_SURE_ALONE, _SURE_GUESSED = 0.75, 0.8
# Actions after which the ego stands.
_STANDING = ("stop", "park", "pull_over", "wait")
# Sides of the road that are named by its traffic, in words.
_ROAD_SIDES = {"kerb": "on our side of the road", "opposite": "on the other side of the road"}
# Sides of words, as slots of a query.
_SIDES: dict[str, dict[str, Any]] = {
    "left_side": {"goal_side": "left"},
    "right_side": {"goal_side": "right"},
    "own_side": {"road_side": "kerb"},
    "opposite_side": {"road_side": "opposite"},
}
_FORETELLING = [WordCategory.PRONOUN, WordCategory.AUX]
_MARKS = (WordCategory.COMMA, WordCategory.BREAK)
_NEGATIVE = ("no", "not", "never")


def evidence_of(reading: Reading) -> Evidence:
    """Return how well the grammar understood a sentence."""
    doubtful = bool(reading.doubt or reading.query.unresolved)
    words = [token for token in reading.tokens if token.category not in _MARKS]
    unknown = sum(token.category is WordCategory.UNKNOWN for token in words)
    contrary = any(map(_negates, words)) or any(map(_stops_doing, words, words[1:]))
    beside = [one for one in reading.steps if one.referent and not _is_main(one, reading.query)]
    others = tuple(one.referent for one in beside if one.referent)
    places = tuple({"overtake": "past"}.get(one.action or "", one.relation) for one in beside)
    turns = tuple(one.direction for one in reading.steps if one.direction not in (None, reading.query.direction))
    dropped, corrected = len(reading.dropped), len(reading.corrections)
    return Evidence(dropped, corrected, doubtful, unknown, len(words), contrary, others, places, turns)


def _negates(token: Token) -> bool:
    """Return whether a word negates, excepts or corrects something: "not", "not far from", "no further than"."""
    return token.category in POLARITY or any(word in _NEGATIVE or word.endswith("n't") for word in token.text.split())


def _stops_doing(token: Token, following: Token) -> bool:
    """Return whether two words forbid something: "stop overtaking", "avoid parking"."""
    verbs = token.category is following.category is WordCategory.VERB
    return verbs and token.value in ("stop", "none", "avoid") and following.form == "ing"


def _foretells(tokens: Sequence[Token]) -> bool:
    """Return whether words tell what others are going to do: "it'll stop"."""
    words = [token for token in tokens if token.category not in (*_MARKS, WordCategory.FILLER)][:2]
    return [one.category for one in words] == _FORETELLING and words[1].text == "will"


def revise_readings(readings: Sequence[Reading], tokens: Sequence[Token]) -> tuple[Reading, ...]:
    """Return the readings, best first, as revised by the network.

    Args:
        readings: the grammar's readings, best first; one without an action if the sentence is no command.
        tokens: tokens of the sentence as it is most likely written, not yet tagged.

    Raises:
        DataError: if the weights of the network are missing or damaged.
    """
    first = readings[0]
    if first.problem and first.problem.unreadable:
        return tuple(readings)
    evidence = evidence_of(first)
    revision = default_reader().revise(first.query, evidence, tokens)
    if revision is None or (first.problem and revision.query.referent is None and _foretells(first.tokens)):
        return tuple(readings)
    if revision.changed and revision.query.action is None:
        return (_rejected(first, revision),)
    # Another attachment is kept if it has the same main action, and the same values of all changed fields.
    changes = _differences(first.query, revision.query)
    before = {name: getattr(first.query, name) for name in ("action", *changes)}
    alike = [one for one in readings if all(getattr(one.query, name) == value for name, value in before.items())]
    if first.problem:
        revised = [_accepted(first, revision)] if revision.changed else []
    else:
        revised = [_changed(one, changes, revision) for one in alike] if revision.changed else list(readings)
    new = bool(first.problem) or (first.query.referent is None and revision.query.referent is not None)
    doubtful = evidence.unknown if new else evidence.contrary and "action" in changes
    needed = _SURE_GUESSED if doubtful else _SURE_ALONE if first.problem else _SURE
    return tuple(_asked(one, evidence, revision, needed) for one in revised) or tuple(readings)


def _asked(reading: Reading, evidence: Evidence, revision: Revision, needed: float) -> Reading:
    """Return a reading with the question whether it is meant, if its probability is less than is needed.

    What the grammar understands whole is not doubted. Its own doubts are given up about words that it does not know,
    unless they may be negated.
    """
    query = reading.query
    guessed = query.action == "other" or any(field == "action" for field, _, _ in revision.changed)
    if query.road_side == "opposite" and guessed:
        return replace(reading, doubt=_question(query))  # "go to the other side": to stop there?
    if query.action == "other" and query.referent is None:
        return replace(reading, doubt="")  # "put the hazards on" is answered, not asked about
    if revision.sure >= needed:
        settled = reading.doubts_strange and not evidence.contrary
        return replace(reading, doubt="") if settled else reading
    understood = query.manoeuvre in REFUSED or (evidence.whole and not revision.changed)
    return reading if understood or reading.doubt else replace(reading, doubt=_question(query))


def _rejected(reading: Reading, revision: Revision) -> Reading:
    problem = ParseProblem("as a whole it is no driving command")
    return Reading(
        revision.query,
        tokens=reading.tokens,
        notes=reading.notes,
        problem=problem,
        corrections=reading.corrections,
        revised=revision.changed,
    )


def _accepted(reading: Reading, revision: Revision) -> Reading:
    """Return the network's reading of a sentence that the grammar takes for no command; its words name the side."""
    query = _on_named_side(revision.query, reading.tokens)
    return Reading(
        query,
        tokens=reading.tokens,
        notes=(*reading.notes, f"read as '{_phrase(query)}'"),
        doubt=_question(query),
        doubts_strange=True,
        corrections=reading.corrections,
        revised=revision.changed,
    )


def _on_named_side(query: Query, tokens: Sequence[Token]) -> Query:
    """Return a query to stand somewhere with the side of the road that the words name, unread by the network."""
    sides = [_SIDES[one.value] for one in tokens if one.category is WordCategory.SIDE and one.value in _SIDES]
    if query.action not in _STANDING or query.referent is not None or len(sides) != 1:
        return query
    across = query.relation == "opposite" and query.landmark is None
    return replace(query, **sides[0], direction=None, relation="none" if across else query.relation)


def _changed(reading: Reading, changes: dict[str, Any], revision: Revision) -> Reading:
    query = replace(reading.query, **changes)
    whole = evidence_of(reading).whole
    ordered = whole and _is_ordered(reading)
    steps = tuple(
        query if step == reading.query else replace(step, **changes) if _is_main(step, reading.query) else step
        for step in reading.steps
        if ordered
        or _is_main(step, reading.query)
        or _is_commanded(step, reading.query, query)
        or (whole and _is_about_another(step, query))
    )
    left = [i for i, step in enumerate(steps) if step.action in reading.query.actions]
    if len(steps) < len(reading.steps) and len(left) == 1:  # it takes over the place of the removed step
        i = left[0]
        steps = (*steps[:i], replace(query, trigger=steps[i].trigger), *steps[i + 1 :])
    revised = replace(reading, query=query, steps=steps, revised=revision.changed)
    return revised.without_dropped(_used_words(reading, changes))


def _used_words(reading: Reading, changes: dict[str, Any]) -> set[str]:
    """Return the dropped words whose meaning the changed fields of a query hold: "stop alongside him"."""
    referent = changes.get("referent")
    named = (referent.noun, referent.colour, *referent.qualifiers) if referent else ()
    meanings = {changes.get("relation"), changes.get("action"), *named}
    pairs = zip(reading.tokens, [*reading.tokens[1:], None], strict=True)
    negated = {one.text for one, following in pairs if following is not None and _negates(following)}
    dropped = (one for one in reading.tokens if one.text in reading.dropped and one.text not in negated)
    return {one.text for one in dropped if meanings & {one.value, one.state or one.value}}


def _is_ordered(reading: Reading) -> bool:
    """Return whether "then" and a verb begin each step but the first: "let it go by and then pull out"."""
    begun = (
        one.category is WordCategory.THEN and after.category is WordCategory.VERB and not after.form
        for one, after in pairwise(reading.tokens)
    )
    return 1 < len(reading.steps) <= 1 + sum(begun)


def _is_commanded(step: Query, before: Query, after: Query) -> bool:
    """Return whether a step is still one of a command's actions; one that only awaits an event never was."""
    return step.action not in before.actions or step.action in after.actions


def _is_about_another(step: Query, query: Query) -> bool:
    """Return whether a step passes another vehicle than a command names, which would be lost with it."""
    passes = step.action in ("drive_past", "overtake")
    other, own = step.referent, query.referent
    return passes and other is not None and own is not None and other.noun != own.noun


def _is_main(step: Query, query: Query) -> bool:
    """Return whether a step is the one that the query tells."""
    return (step.action, step.relation, step.referent) == (query.action, query.relation, query.referent)


def _differences(before: Query, after: Query) -> dict[str, Any]:
    names = (one.name for one in fields(Query))
    return {name: getattr(after, name) for name in names if getattr(after, name) != getattr(before, name)}


def _question(query: Query) -> str:
    return f"do you mean '{_phrase(query)}'?"


def _phrase(query: Query) -> str:
    """Return a query in short words: "park behind the red van"."""
    if query.action == "other" and query.road_side is None:
        return "carry on as before"
    action = verb_of(query.action, query.relation).replace("_", " ")
    told = query.relation == "none" or action.endswith(query.relation)  # "drive past"
    relation = "" if told else query.relation.replace("_", " ")
    vehicle = f"the {query.referent.phrase()}" if query.referent else ""
    action = "stop" if query.action == "other" else action
    part = query.secondary[0].noun.replace("_", " ") if query.landmark == "secondary" and query.secondary else ""
    thing = f"the {part}" if part else ""
    side = f"on the {query.goal_side}" if query.goal_side else _ROAD_SIDES.get(query.road_side or "", "")
    words = " ".join(word for word in (action, query.direction or "", relation, vehicle, thing, side) if word)
    excluded = [one for one in query.excluded if one.relation is not None]
    return f"{words}, not {' or '.join(map(_place_excluded, excluded))}" if excluded else words


def _place_excluded(one: Exclusion) -> str:
    """Return an excluded place in words: "next to the blue car"."""
    named = Referent(one.noun, one.noun, one.colour, one.qualifiers)
    return f"{one.relation} the {named.phrase()}".replace("_", " ")
