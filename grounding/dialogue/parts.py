"""A turn of several sentences or clauses: each is answered in turn, where it is plain what it does."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.reports import notice
from grounding.dialogue.sentences import answer_sentence, is_misunderstood
from grounding.dialogue.turns import ASIDES, predict_turn
from grounding.language.replies import read_reply

_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=\S)")
_CLAUSE = re.compile(
    r"(?<=[.!?])\s+(?=\S)|\s*[,;:]\s+|\s*\.\.+\s*|\s+-+\s+|\s+(?=(?:and|but|so|because|cause|cos|cuz)\s)",
    re.IGNORECASE,
)
# Least probability of the act of a part that is answered by itself.
_SURE = 0.7
# Acts of parts that nothing follows from, alone or before others: "no, no. The other one".
_CHAT, _REPLIES = ("remark", "pause"), ("yes", "no")
# Acts that are told apart by the grammar too: which of them it is needs not be certain.
_KINDS = (ASIDES, ("describe", "place", "shift", "command", "then", "number"))
# Acts that ask for something new.
_COMMANDS = ("command", "then")


@dataclass(frozen=True)
class Part:
    """A part of a turn, its likeliest act, and the probability that it does something of that kind, or nothing."""

    text: str
    act: str
    sure: float

    @property
    def is_sure(self) -> bool:
        """Whether the act is plain enough to answer the part by itself."""
        return self.sure >= _SURE

    @property
    def is_aside(self) -> bool:
        """Whether it neither chooses nor changes anything: chat, or a question."""
        return self.act in ASIDES

    @property
    def is_command(self) -> bool:
        """Whether it asks for something new."""
        return self.act in _COMMANDS

    @property
    def is_reply(self) -> bool:
        """Whether it only says yes or no."""
        return self.act in _REPLIES

    @property
    def is_chat(self) -> bool:
        """Whether nothing follows from it."""
        return self.act in _CHAT or not self.is_sure


def _sentences_of(talk: Conversation, text: str) -> list[Part]:
    """Return the sentences of a turn."""
    return _parts(talk, _SENTENCE.split(text))


def _clauses_of(talk: Conversation, text: str) -> list[Part]:
    """Return the clauses of a turn."""
    clauses: list[str] = []
    for one in filter(None, _CLAUSE.split(text)):
        if clauses and re.search(r"\bbetween\b", clauses[-1]) and one.startswith("and "):
            clauses[-1] += f" {one}"  # "between the van and the bus"
        else:
            clauses.append(one)
    return _parts(talk, clauses)


def _parts(talk: Conversation, texts: Sequence[str]) -> list[Part]:
    if len(texts) < 2:
        return []
    found = []
    for text in texts:
        _, prediction = predict_turn(talk, text, read_reply(text, talk.grounder.lexicon))
        if prediction is not None:
            act, shares = prediction.best("act"), prediction.choices["act"]
            kind = next((kind for kind in _KINDS if act in kind), (act,))
            found.append(Part(text, act, sum(shares[one] for one in kind)))
    return found


def answer_turn(talk: Conversation, text: str) -> Answer:
    """Answer a sentence, or several: each one in turn, if each is plain by itself and does something else."""
    before = talk.state
    sentences = [] if talk.is_opening else _sentences_of(talk, text)
    acts = [one.act for one in sentences if not one.is_aside]
    plain = all(one.is_sure for one in sentences) and len({*acts}) == len(acts)
    if plain and (answer := _answer_each(talk, sentences)):
        return answer
    answer = answer_sentence(talk, text)
    if is_misunderstood(answer):
        after, talk.state = talk.state, before
        again = _answer_each(talk, _clauses_of(talk, text))
        if again is not None and not is_misunderstood(again):
            return again
        talk.state = after
    return answer


def _answer_each(talk: Conversation, parts: Sequence[Part]) -> Answer | None:
    """Answer the parts of a turn one after the other; None if all of them are chat.

    Returns:
        The answer to the last part that chooses or changes something, else to the last question. A part that comes
        to nothing, and asks for nothing new, is a reason: "The second one. It's right outside my house".
    """
    several = any(not (one.is_aside or one.is_reply) for one in parts)
    answer = aside = None
    for one in parts:
        before = talk.state
        if one.is_chat or (one.is_reply and several):
            notice(talk, one.text)
        elif one.is_aside:
            aside = answer_sentence(talk, one.text)
        else:
            told = answer_sentence(talk, one.text)
            if answer is None or one.is_command or told.status == "ok":
                answer = told
            else:
                talk.state = before
    return answer or aside
