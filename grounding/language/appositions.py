"""What is said of a vehicle after it was named: "behind the silver one, the hatchback", "that car, the blue one"."""

from __future__ import annotations

from typing import TYPE_CHECKING

from grounding.language.noun_phrases import Phrase
from grounding.language.tokenizer import Token
from grounding.language.word_categories import Kind

if TYPE_CHECKING:
    from grounding.language.attachment import Telling

_VEHICLES = ("vehicle", "traffic")


def tells_more(told: Telling, phrase: Phrase) -> bool:
    """Whether a noun phrase without a verb or relation before it tells more of what was named just before."""
    finished = not any(isinstance(part, Token) and part.kind in (Kind.VERB, Kind.BE, Kind.AUX) for part in told.rest)
    if phrase.kind == "vehicle":
        return finished and _names(told, phrase)
    if phrase.kind != "one" or told.clause.new:
        return False
    before = told.before
    if before is None:
        last = told.story.mentions[-1][0] if told.story.mentions else None
        if not finished or told.third is not None or last is None or last.kind not in _VEHICLES:
            return False
        told.refine(last, phrase)  # "that is my car, the blue one"
        return True
    if before.target is not None and finished:
        told.refine(before.target, phrase)
        return True
    if before.target is None and before.object is not None and told.next_kind == "relation":
        told.noun = before.object  # "take the exit, the one behind the bus"
        return True
    return False


def _names(told: Telling, phrase: Phrase) -> bool:
    """Whether the "one" that was said just before gets its noun."""
    named = [other for other, _ in told.story.mentions]
    first = phrase.start == told.clause.tokens[0].start
    if not first or not named or named[-1].kind != "one" or any(other.kind in _VEHICLES for other in named):
        return False
    phrase.refine_into(named[-1])
    told.noun = named[-1]
    return True


def is_the_other(told: Telling, phrase: Phrase) -> bool:
    """Whether "one" takes the noun of what was ruled out: "it is not the red car, it is the blue one"."""
    said = [(other, role) for other, role in told.story.mentions if other.kind in _VEHICLES]
    if not said or said[-1][1] not in ("excluded", "denied"):
        return False
    phrase.become(said[-1][0])
    return True
