"""Turns that name a distance and nothing else: it is the gap in force ("a metre would be enough")."""

from __future__ import annotations

from dataclasses import dataclass

from grounding.answer import Answer
from grounding.dialogue.clauses import Words, clauses_of, is_phrase, whole_number
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import is_understood, names_pronoun
from grounding.dialogue.places.shifts import change_distance, shift_last
from grounding.dialogue.turns import Turn
from grounding.goal.shift import Shift
from grounding.language.reader.fields import NONE
from grounding.language.replies import split_distance, words_end
from grounding.language.syntax.lexicon import default_lexicon
from grounding.query import Query
from grounding.referent.resolver import find_all
from grounding.requests import Request
from grounding.vocabulary import PASSING_ACTIONS

# Actions without a gap that is held, and words before the vehicle to which one is left.
_TO_NAMED = ("to", "from", "between", "behind", "of")


def answer_gap(talk: Conversation, text: str) -> Answer | None:
    """Change the gap to the vehicle of the last command, if a turn names nothing but a distance; None for others."""
    state, request = talk.state, talk.state.request
    if request is None or state.lists or not _keeps_gap(request.query):
        return None
    gaps = [_gap_in(talk, words, request) for words in clauses_of(talk, text)]
    named = [gap for gap in gaps if gap is not None and gap.metres > 0]
    if len(named) != 1 or None in gaps:
        return None
    (gap,) = named
    return shift_last(talk, text, Shift("away", gap.metres)) if gap.more else change_distance(talk, text, gap.metres)


def take_gap(talk: Conversation, text: str, turn: Turn) -> Answer | None:
    """Change the gap where the reader of turns finds a distance as the place and nothing else; None for other turns.

    "Can you leave three metres, the tailgate has to come down".
    """
    request = talk.state.request
    alone = turn.relation == turn.best("goal_side") == NONE and turn.described(None) is None
    if (
        request is None
        or turn.act != "place"
        or turn.distance_m is None
        or not alone
        or not _keeps_gap(request.query)
    ):
        return None
    return change_distance(talk, text, turn.distance_m)


def _keeps_gap(query: Query) -> bool:
    """Return whether a command keeps a gap to a vehicle: after passing it, "another ten metres" is how far to go."""
    placed = query.relation != "none" or query.action == "follow"
    return query.landmark == "referent" and placed and query.action not in PASSING_ACTIONS


@dataclass(frozen=True)
class _Gap:
    """A gap in metres, 0 if a clause only says that we are too close, and whether it is added to the one in force."""

    metres: float
    more: bool = False


def _gap_in(talk: Conversation, words: Words, request: Request) -> _Gap | None:
    """Return the gap that a clause names; None for other clauses."""
    end = words_end("tooclose", words, 0)
    if end and (not words[end:] or _is_meant(talk, words[end:], request)):
        return _Gap(0.0)
    if any(is_phrase("tooclose", words[i:]) for i in range(1, len(words))):
        return _Gap(0.0)  # "one metre is a bit tight"
    metres, others = split_distance(words, talk.grounder.lexicon or default_lexicon())
    if metres is None:  # "two would be nicer"
        number = whole_number(words[0])
        alone = not words[1:] and request.query.distance_m is not None and talk.state.question is None
        return _Gap(float(number)) if number and (alone or is_phrase("sufficing", words[1:])) else None
    more = any(words_end("leavingmore", one, 0) for one in (words, others))  # "leave another metre", "a metre more"
    start = max(words_end(kind, others, 0) for kind in ("leavingmore", "leaving"))
    named = others[start:]
    sole = not named or is_phrase("sufficing", named) or (start > 0 and is_phrase("apart", named))
    return _Gap(metres, more) if sole or _is_meant(talk, named, request) else None


def _is_meant(talk: Conversation, words: Words, request: Request) -> bool:
    """Return whether words name the vehicle of the last command after a preposition: "to the van", "from it"."""
    if words[0] not in _TO_NAMED or not words[1:]:
        return False
    reading = talk.read(f"stop behind {' '.join(words[1:])}")
    named, chosen = reading.query.referent, request.chosen
    if names_pronoun(reading):
        return named is None or not named.qualifiers  # "one metre to the left" is measured from nothing
    if named is None or chosen is None or not is_understood(reading):
        return False
    return any(one.id == chosen.item.id for one in find_all(named, talk.scene))
