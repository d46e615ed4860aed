"""Conditions on a state: "if it moves, follow it, otherwise pass it", "wait, but if it leaves, follow it".

Each half is a command of its own; what the case is decides between them, not whether there is a place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

from grounding.language.alternatives import MAX_JOINTS, Words, tells_room
from grounding.language.reading import Reading
from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.tagging.tagger import tag
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, Token, normalise, tokenise
from grounding.language.syntax.word_categories import WordCategory
from grounding.query import Query

# Actions with which one reacts to what others do.
_REACTIONS = ("stop", "slow_down", "wait", "give_way")
# Actions that hold where we stand.
_STANDING = ("wait", "stop", "park", "pull_over")
# Whether the vehicle of a condition has to move or to stand; '' for another event.
MotionState = Literal["moving", "standing", ""]
_STATES: dict[str, MotionState] = {"moving": "moving", "parked": "standing", "stopped": "standing"}
_COPULAS = (WordCategory.BE, WordCategory.QUESTION)
_OPPOSITE: dict[MotionState, MotionState] = {"moving": "standing", "standing": "moving", "": ""}


class Condition(NamedTuple):
    """A condition with a command for either case.

    Attributes:
        clause: what may be the case: "the bus leaves".
        then: the command if it is.
        other: the command if it is not.
    """

    clause: str
    then: str
    other: str


def split_condition(text: str, tokens: Sequence[Token]) -> Condition | None:
    """Return a condition with both of its commands; None for other texts.

    Args:
        text: the normalised text.
        tokens: its tagged tokens.
    """
    words = Words.of(text)
    if words.count_joints() > MAX_JOINTS or tells_room(words, tokens):
        return None  # "if there is a gap": the scene tells whether there is a place
    begin = next((i for i, _ in enumerate(words.words) if words.end_of("if", i)), None)
    if begin is None:
        return None
    start, before = words.end_of("if", begin), words.part(0, begin)
    end = words.clause_end(tokens, start)
    clause = words.part(start, end)
    if before and (after := _otherwise(words, end)) and _tells_event(words.tokens_of(tokens, start, end)):
        return Condition(clause, before, words.rest(after))  # "overtake it if nobody comes, otherwise stay behind"
    if before:  # "wait behind it unless it leaves, in which case follow it"
        then = words.rest(end)
        return Condition(clause, then, before) if clause and then and words.is_case(begin, end) else None
    joints = ((i, words.end_of("otherwise", i) or words.end_of("between", i)) for i in range(end, len(words.words)))
    otherwise, after = next(((i, after) for i, after in joints if after), (0, 0))
    if not after:
        return None
    then, other = words.part(end, otherwise), words.rest(after)
    if words.words[begin] == "unless":
        then, other = other, then
    return Condition(clause, then, other) if clause and then and other else None


def _otherwise(words: Words, start: int) -> int:
    """Return the word at which the other case of a clause that ends at a word begins; 0 without one."""
    after = words.after_marks(start)
    return words.end_of("otherwise", after) or words.end_of("between", after)


def with_reaction(reading: Reading, text: str, tokens: Sequence[Token], read: Callable[[str], Reading]) -> Reading:
    """Return a reading with its condition, if it only tells how to react to an event: "stop if a child runs out".

    Args:
        reading: the reading of the whole text.
        text: the normalised text.
        tokens: its tagged tokens.
        read: reads a part of the text.
    """
    if reading.query.action not in _REACTIONS:
        return reading
    words = Words.of(text)
    begin = next((i for i, word in enumerate(words.words) if word != "unless" and words.end_of("if", i)), None)
    if begin is None:
        return reading
    start, before = words.end_of("if", begin), words.part(0, begin)
    end = words.clause_end(tokens, start)
    after = words.part(end)
    if bool(before) == bool(after) or not _tells_event(words.tokens_of(tokens, start, end)):
        return reading
    reaction = read(before or after)
    placed = reaction.query.referent or reaction.query.relation != "none" or reaction.query.secondary
    if placed or not reaction.is_plain or reaction.query.action != reading.query.action or len(reaction.steps) > 1:
        return reading
    return replace(reading, condition=words.part(start, end), dropped=(), doubt="", doubtful=(), notes=())


def _tells_event(tokens: Sequence[Token]) -> bool:
    """Return whether a clause tells what others may do: "a child runs out"; not what is now, nor what we do."""
    if not tokens or tokens[0].category is WordCategory.EGO or any(one.category in _COPULAS for one in tokens):
        return False
    return any(token.category is WordCategory.VERB and token.event for token in tokens)


def until_then(awaited: Query, then: Reading, other: Reading) -> Reading | None:
    """Return the plan of a command that holds until an event, and another one after it; None where it does not hold.

    "Wait behind the bus unless it leaves, in which case follow it", "follow it, but if it turns off go straight on".

    Args:
        awaited: the wait for the event.
        then: the command for the case that it comes.
        other: the command until then.
    """
    held = other.query
    if awaited.trigger is None or len(other.steps) > 1 or then.query.action == held.action:
        return None
    if held.action == "follow":
        held = replace(held, trigger=awaited.trigger)
        return replace(other, query=held, steps=(held, *then.steps))
    if held.action in _STANDING:
        wait = replace(awaited, referent=awaited.referent or held.referent, unresolved="")
        return replace(other, steps=(held, wait, *then.steps))
    return None


def tells_cases(text: str, lexicon: Lexicon | None = None) -> bool:
    """Return whether a text has a condition with a command for either case."""
    normalised = normalise(text[:MAX_CHARACTERS])
    return split_condition(normalised, tag(tokenise(normalised, lexicon))) is not None


def motion_of(tokens: Sequence[Token]) -> MotionState:
    """Return whether a clause says that a vehicle moves or stands now; '' if not: "it stops" is what it may do."""
    found: MotionState = next((_STATES[one.state] for one in tokens if one.state in _STATES), "")
    stated = found == "moving" or any(one.category in _COPULAS for one in tokens)
    negated = any(token.category is WordCategory.NOT for token in tokens)
    return "" if not stated else _OPPOSITE[found] if negated else found
