"""Side clauses of a command, which ask for no place: warnings ("mind the lady") and reasons.

The command is read from the other words alone, so that nothing takes its place from a side clause.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from grounding.language.reading import Reading
from grounding.language.semantics.accounting import PLACING
from grounding.language.syntax.clauses import Clause, split_clauses
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import DETERMINERS, POLARITY, WordCategory
from grounding.query import Query

# Words of verbs of care that only warn of something; "avoid" and "keep away from" say more.
_WARNING = frozenset(
    (
        *("mind", "watch", "look", "lookout", "beware", "caution", "care", "careful", "cautious", "attention"),
        *("eye", "eyes", "aware", "alert", "wary", "mindful", "attentive"),
    )
)
# Actions that ask for care and no place, and so are at one with a warning.
_CAREFUL = ("slow_down", "wait", "give_way", "avoid")
_REFERRING = (WordCategory.PRONOUN, WordCategory.ONE, WordCategory.THERE)
# Connectives after which a clause is a condition or tells when.
_CONDITIONS = ("if", "unless", "when", "after", "before", "until", "while")
# First words of a statement, and words one of which is in its predicate.
_SUBJECTS = DETERMINERS | {WordCategory.THAT, WordCategory.PERSON, WordCategory.PRONOUN, WordCategory.EXISTS}
_PREDICATES = (WordCategory.BE, WordCategory.AUX, WordCategory.EXISTS, WordCategory.NONDRIVE, WordCategory.UNKNOWN)
# Words that a mere reason does not have: those that may command, place, choose or negate.
_TELLING = (
    PLACING
    | POLARITY
    | {WordCategory.VERB, WordCategory.MEANWHILE, WordCategory.WHERE, WordCategory.HERE, WordCategory.THERE}
    | {WordCategory.RELATION, WordCategory.ONE, WordCategory.STATE, WordCategory.QUESTION}
)
# What is told of the children who ride with us, and not of others at a place.
_OF_PASSENGERS = re.compile(
    r"(?:,| because| while| as| since|\.) ((?:the|my|our) (?:kids?|children|baby|little ones|boys|girls|family)"
    r" (?:are|is|were|was|need|needs|get|gets|have|has|want|wants|feel|feels|buckle|buckles|put|puts|finish|fell)\b"
    r"(?! (?:crossing|walking|standing|running|going|coming|playing|on|at|in|near|by|over|out)\b)[^,.;]*)"
)
# What somebody is to be able to do then, which no verb of it commands: "so I can turn the car round".
_SO_THEY_CAN = re.compile(
    r",? so (?:that )?(?:i|he|she|they|people|others|everyone|everybody|cars|traffic|my \w+)"
    r" (?:can|could|may|might)\b[^.;]*$"
)
# A place and what it is for, which is not planned.
_PLACE_FOR = re.compile(
    r"\b(somewhere|anywhere|a place|a spot)(?: that| where)?"
    r" (?:(?:the|my|our) \w+|we|i|you|they|nobody|no one|he|she)"
    r" (?:can|can't|cannot|could|won't|will|don't|doesn't|wouldn't)\b"
)
# Words before what a place is for, and categories of what we do there.
_WHERE_WE_CAN = ("where i can", "where we can", "where you can", "where they can", "where she can", "where he can")
_DOING = (WordCategory.NONDRIVE, WordCategory.UNKNOWN)
# First words of what is not to happen, where it is no command.
_WHO = frozenset(("i", "we", "you", "it", "he", "she", "they", "nobody", "noone", "none"))
# A noun for vehicles of any class.
_ANY_VEHICLE = ("vehicle", WordCategory.NOUN)


class Split(NamedTuple):
    """The text of a command without a side clause, and the side clause."""

    command: str
    beside: str


def split_warning(text: str, tokens: Sequence[Token]) -> Split | None:
    """Return a text without its first warning; None if it has none, or nothing else, or refers to what it warns of.

    Args:
        text: the normalised text.
        tokens: its tagged tokens.
    """
    clauses = split_clauses(tokens)
    at = next((i for i, clause in enumerate(clauses) if _warns(clause)), None)
    others = [token for i, clause in enumerate(clauses) for token in clause.tokens if i != at]
    moves = any(token.category is WordCategory.VERB for token in others)
    if at is None or not moves or any(token.category in _REFERRING for token in others):
        return None
    return _split(text, clauses, at)


def split_purpose(text: str, tokens: Sequence[Token]) -> Split | None:
    """Return a text without what is not to happen ("so we don't block it"), or what a place is for ("where I can").

    Arguments as in `split_warning`.
    """
    clauses = split_clauses(tokens)
    at = next((i for i, one in enumerate(clauses) if i and one.connective == "so" and _begins_purpose(one)), None)
    if at is not None:
        return _split(text, clauses, at)
    if (riding := _OF_PASSENGERS.search(text)) is not None:
        return Split(f"{text[: riding.start()]} {text[riding.end() :]}".strip(), riding[1])
    if (purpose := _SO_THEY_CAN.search(text)) is not None and purpose.start():
        return Split(text[: purpose.start()], text[purpose.start() :].strip(" ,"))
    if (place := _PLACE_FOR.search(text)) is not None:
        return Split(text[: place.end(1)], text[place.end(1) :].strip())
    where = next(
        (one for one, after in pairwise(tokens) if one.text in _WHERE_WE_CAN and after.category in _DOING), None
    )
    return None if where is None or not where.start else Split(text[: where.start], text[where.start :])


def split_reasons(text: str, tokens: Sequence[Token]) -> Iterator[Split]:
    """Yield a text without each of its statements that can only be reasons; arguments as in `split_warning`."""
    clauses = [part for clause in split_clauses(tokens) for part in _sentences(clause)]
    for i, clause in enumerate(clauses):
        refers = any(token.category in _REFERRING for other in clauses[i + 1 :] for token in other.tokens)
        if len(clauses) > 1 and _is_reason(clause if refers else _without_any_vehicle(clause)):
            yield _split(text, clauses, i)


def asks_for_place(query: Query) -> bool:
    """Return whether a command asks for a place, and not only for care."""
    return query.action is not None and (query.action not in _CAREFUL or query.distance_m is not None)


def said_whole(reading: Reading, text: str) -> Reading:
    """Return the reading of a part of a text as that of the whole text."""
    steps = tuple(replace(step, command=text) for step in reading.steps)
    otherwise = None if reading.otherwise is None else said_whole(reading.otherwise, text)
    return replace(reading, query=replace(reading.query, command=text), steps=steps, otherwise=otherwise)


def _warns(clause: Clause) -> bool:
    """Return whether a clause only warns of something."""
    verbs = [token for token in clause.tokens if token.category is WordCategory.VERB and not token.form]
    if len(verbs) != 1 or verbs[0].value != "avoid" or clause.connective in _CONDITIONS:
        return False
    return clause.tokens[0] is verbs[0] and not _WARNING.isdisjoint(verbs[0].text.split())


def _sentences(clause: Clause) -> list[Clause]:
    """Return a clause in two where we begin a statement in it: "don't stop by the van I owe him money"."""
    tokens = clause.tokens
    starts = [i for i, token in enumerate(tokens) if i and token.category is WordCategory.EGO]
    if not starts or not any(token.category in PLACING for token in tokens[: starts[-1]]):
        return [clause]
    i = starts[-1]
    return [replace(clause, tokens=tokens[:i]), Clause("", tokens[i:])]


def _without_any_vehicle(clause: Clause) -> Clause:
    """Return the clause "there's a queue" without the vehicles of no class that it states, if it does."""
    if clause.tokens[0].category is not WordCategory.EXISTS:
        return clause
    return replace(clause, tokens=tuple(one for one in clause.tokens if (one.value, one.category) != _ANY_VEHICLE))


def _is_reason(clause: Clause) -> bool:
    """Return whether a clause is a statement of which nothing can be meant as a command."""
    first, *rest = clause.tokens
    if clause.connective in _CONDITIONS or any(token.category in _TELLING for token in clause.tokens):
        return False
    if first.category is WordCategory.EGO:
        return bool(rest)
    named = first.category in (*DETERMINERS, WordCategory.THAT)  # "the florist" is no statement
    states = any(token.category in _PREDICATES for token in (first, *rest))
    return first.category in _SUBJECTS and states and len(rest) > named


def _begins_purpose(clause: Clause) -> bool:
    """Return whether a clause after "so" has a subject before its negation, and so is no command."""
    first, *rest = clause.tokens
    subject = first.category in (WordCategory.PRONOUN, WordCategory.EGO) or first.text.split()[0] in _WHO
    negated = any(one.category is WordCategory.NOT for one in (first, *rest[:1]))
    named = any(one.category is WordCategory.NOUN for one in rest)  # "so that we do not hit the car in front"
    return bool(rest) and subject and negated and not named


def _split(text: str, clauses: Sequence[Clause], at: int) -> Split:
    """Return a text without one of its clauses and the connective beside it."""
    left_out = clauses[at].tokens
    beside = text[left_out[0].start : left_out[-1].end]
    before = text[: clauses[at - 1].tokens[-1].end] if at else ""
    if at + 1 == len(clauses):
        return Split(before, beside)
    following = clauses[at + 1]
    begins = following.tokens[0]
    if following.connective in _CONDITIONS:  # "mind him when you pull in"
        begins = next((one for one in following.tokens if one.category is WordCategory.VERB), begins)
    return Split(", ".join(part for part in (before, text[begins.start :]) if part), beside)
