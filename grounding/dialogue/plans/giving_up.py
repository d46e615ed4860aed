"""Turns that give up a vehicle that is followed, or another pace: "let him go", "back to normal"."""

from __future__ import annotations

from collections.abc import Callable

from grounding.answer import Answer
from grounding.dialogue.clauses import JOINING, Words, clauses_of, is_phrase
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import is_understood, names_pronoun
from grounding.dialogue.telling.reports import cancel, inform
from grounding.language.replies import words_after_opening, words_end
from grounding.query import Query
from grounding.referent.resolver import find_all
from grounding.requests import Request


def answer_giving_up(talk: Conversation, text: str, answer_rest: Callable[[str], Answer]) -> Answer | None:
    """Answer a turn that lets a followed vehicle go, or asks for the usual pace; None for other turns.

    Args:
        talk: the conversation.
        text: the turn.
        answer_rest: answers what is to be done instead.
    """
    words = words_after_opening(text, talk.grounder.lexicon)
    at = next((i for i, word in enumerate(words) if word in JOINING), len(words))
    clause, rest = words[:at], words_after_opening(" ".join(words[at + 1 :]), talk.grounder.lexicon)
    while rest and rest[0] in JOINING:
        rest = rest[1:]
    if _lets_go(talk, clause):
        told = _drop_following(talk, text)
        goes_on = talk.read(" ".join(rest)).query.manoeuvre == "onward" or is_phrase("usualway", rest)
        if not rest or (goes_on and talk.state.goal is None):
            return _drive_as_usual(talk, text) if rest else told
        return answer_rest(" ".join(rest))
    clauses = clauses_of(talk, text)
    if any(map(_asks_usual_pace, clauses)) and all(_is_about_pace(talk, one) for one in clauses):
        return _drive_as_usual(talk, text)
    return None


def _followed(talk: Conversation) -> list[int]:
    """Return the steps in force that follow a vehicle."""
    return [i for i, step in enumerate(talk.state.plan) if step.query.action == "follow"]


def _lets_go(talk: Conversation, clause: Words) -> bool:
    """Return whether a clause lets the vehicle go that is followed: "let him go", "stop following the van"."""
    followed, named = _followed(talk), _let_go(clause)
    if not followed or named is None:
        return False
    reading = talk.read(f"follow {' '.join(named)}")
    if not named or names_pronoun(reading):
        return True
    chosen, described = talk.state.plan[followed[-1]].chosen, reading.query.referent
    if chosen is None or described is None or not is_understood(reading):
        return False
    return any(one.id == chosen.item.id for one in find_all(described, talk.scene))


def _let_go(clause: Words) -> Words | None:
    """Return the words for who is followed no more: "let him go", "stop following the van"; None for others."""
    if start := words_end("unfollowing", clause, 0):
        end = next((i for i in range(start, len(clause)) if is_phrase("longer", clause[i:])), len(clause))
        return clause[start:end]
    start = words_end("letting", clause, 0)
    end = next((i for i in range(start + 1, len(clause)) if start and is_phrase("going", clause[i:])), 0)
    return clause[start:end] if end else None


def _drop_following(talk: Conversation, text: str) -> Answer:
    followed = _followed(talk)
    left = tuple(step for i, step in enumerate(talk.state.plan) if i not in followed)
    return talk.take_steps(text, left) if left else cancel(talk, text)


def _asks_usual_pace(clause: Words) -> bool:
    return is_phrase("usualpace", clause)


def _is_about_pace(talk: Conversation, clause: Words) -> bool:
    """Return whether a clause is about the speed: "that's slow enough", "back to normal"."""
    if _asks_usual_pace(clause) or is_phrase("enoughpace", clause):
        return True
    return talk.read(" ".join(clause)).query.pace is not None


def _drive_as_usual(talk: Conversation, text: str) -> Answer:
    """Drive to the goal in force, or on in our lane, at the usual speed."""
    goal = talk.state.goal
    if goal is not None and goal.pace is None and talk.state.question is None:
        return inform(talk, text, "the goal stays as it is: we drive there at the usual speed")
    onward = talk.read("carry on").with_query(Query(text, "other", ("other",), manoeuvre="onward"))
    return talk.take((Request(reading=onward),))
