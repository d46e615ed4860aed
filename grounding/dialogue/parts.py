"""Turns of several sentences or clauses: each part is answered by itself if its act is certain."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from grounding.answer import Answer
from grounding.dialogue.choices import name_followed
from grounding.dialogue.commands import answer_command
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.listed import answer_listed
from grounding.dialogue.outcomes import is_misunderstood
from grounding.dialogue.places.exclusions import answer_exclusion
from grounding.dialogue.places.gaps import answer_gap
from grounding.dialogue.places.road_position import answer_road_position
from grounding.dialogue.places.somewhere import answer_somewhere
from grounding.dialogue.places.whereabouts import answer_between_told, answer_whereabouts
from grounding.dialogue.plans.giving_up import answer_giving_up
from grounding.dialogue.plans.steps import edit_steps
from grounding.dialogue.plans.waits import answer_wait
from grounding.dialogue.sentences import answer_sentence
from grounding.dialogue.telling.reports import aside, inform, notice
from grounding.dialogue.turns import ASIDES, DOING, names_command, predict_turn
from grounding.language.alternatives import as_condition, lone_fallback
from grounding.language.cabin import NOT_CONTROLLED, without_cabin
from grounding.language.questions import asks_car
from grounding.language.reader.fields import NONE
from grounding.language.reader.network import Prediction
from grounding.language.replies import named_distance, read_reply
from grounding.language.syntax.tokenizer import normalise

# Events after which something is done: "after it has passed".
_AFTER_EVENT = re.compile(
    r"\bafter ((?:(?:that|this) (?:one|car|van|truck|lorry|bus|bike|motorbike|vehicle|guy))|he|she|it|they)"
    r" ((?:has|have|is|are) (?:passed|gone|left|past|by|through|over|across|clear))\b",
    re.IGNORECASE,
)
# Words that lead in a fallback.
_LEAD = re.compile(r"^(?:(?:well|ok|okay|then|and|but|so|hmm)[, ]+)+", re.IGNORECASE)
# The reason of a goal that is a fallback already.
_NO_ROOM = "there is no room"
# Ends of sentences, and of clauses too.
_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=\S)")
_CLAUSE = re.compile(
    rf"{_SENTENCE.pattern}|\s*[,;:]\s+|\s*\.\.+\s*|\s+-+\s+|\s+(?=(?:and|but|so|because|cause|cos|cuz)\s)",
    re.IGNORECASE,
)
# Least probability of an act that is certain, and of any act with an effect.
_SURE, _MAY_DO = 0.7, 0.5
# Least probability of acts with an effect in words that are no mere lead-in of a question.
_MAY_MATTER = 0.15
# Acts without an effect: chat, and a mere yes or no before another part ("no, no. The other one").
_CHAT, _REPLIES = ("remark", "pause"), ("yes", "no")
# Acts whose probabilities are added, since the grammar tells them apart as well.
_KINDS = (ASIDES, ("describe", "place", "shift", "command", "then", "number"))
# Acts that name a vehicle or a place, and the least probability of a qualifier that does.
_NAMING, _NAMED = ("describe", "place"), 0.3
# Acts that give something up, after which another one often follows.
_GIVING_UP = ("cancel", "drop", "neither")
# Acts that change the command in force: "never mind. A little before the bike" gives up its place alone.
_CHANGING = ("describe", "place", "shift")
# Acts that ask for something new.
_COMMANDS = ("command", "then")


@dataclass(frozen=True)
class Part:
    """A part of a turn.

    Attributes:
        text: its words.
        act: likeliest act.
        sure: probability of acts of its kind.
        does: probability of any act with an effect.
    """

    text: str
    act: str
    sure: float
    does: float

    @property
    def is_sure(self) -> bool:
        """Whether the act is certain."""
        return self.sure >= _SURE

    @property
    def is_aside(self) -> bool:
        """Whether it is chat or a question."""
        return self.act in ASIDES

    @property
    def asks(self) -> bool:
        """Whether it asks for something, and gives nothing up."""
        return not (self.is_aside or self.is_reply or self.act in _GIVING_UP)

    @property
    def is_command(self) -> bool:
        """Whether it asks for something new."""
        return self.act in _COMMANDS

    @property
    def is_reply(self) -> bool:
        """Whether it only says yes or no."""
        return self.act in _REPLIES

    @property
    def may_do(self) -> bool:
        """Whether its act is uncertain but may have an effect."""
        return not self.is_sure and self.does >= _MAY_DO

    @property
    def is_chat(self) -> bool:
        """Whether it has no effect."""
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
    found, lexicon = list[Part](), talk.grounder.lexicon
    for text in texts:
        _, prediction = predict_turn(talk, text, read_reply(text, lexicon))
        if prediction is not None:
            act, shares = prediction.best("act"), prediction.choices["act"]
            if asks_car(text, lexicon):
                found.append(Part(text, "about", 1.0, 0.0))
                continue
            if act in _NAMING and _names_nothing(prediction, text):
                found.append(Part(text, "remark", 1.0, 0.0))  # "there's a cello in the back"
                continue
            kind = next((kind for kind in _KINDS if act in kind), (act,))
            part = Part(text, act, sum(map(shares.__getitem__, kind)), sum(map(shares.__getitem__, DOING)))
            # What is done instead of the only step: "stop following it, just drive normally".
            instead = bool(found) and found[-1].act in _GIVING_UP and act not in _CHANGING
            instead = instead and len(talk.state.steps) == 1
            if instead and not part.is_sure and names_command(talk.read(read_reply(text, lexicon).rest)):
                part = Part(text, "command", 1.0, 1.0)
            found.append(part)
    return found


def _leads_in(talk: Conversation, parts: Sequence[Part]) -> bool:
    """Return whether the last part asks the car, and the others only lead in: "that's better. What's behind us?"."""
    *others, last = parts
    if not others or last.act != "about" or last.does > 0:
        return False
    open_ = talk.state.question is not None
    return all(one.does < _MAY_MATTER and not (open_ and (one.is_reply or one.asks)) for one in others)


def _names_nothing(prediction: Prediction, text: str) -> bool:
    """Return whether a part names neither a vehicle nor a place, nor a distance."""
    values = (prediction.best(field) for field in ("noun", "colour", "relation", "goal_side", "direction"))
    named = any(value != NONE for value in values) or max(prediction.qualifiers.values()) > _NAMED
    return not named and named_distance(text) is None


def answer_turn(talk: Conversation, text: str) -> Answer:
    """Answer a turn: sentence by sentence if each has a certain act of its own, else as a whole."""
    if (cabin := without_cabin(text)) is not None:
        return _answer_beside_cabin(talk, text, cabin[0])
    if as_condition(normalise(text)):  # "is there a gap behind the van? if so park there"
        return answer_command(talk, text, text)
    text = _AFTER_EVENT.sub(r"once \1 \2", text)
    if not talk.is_opening and (fallback := lone_fallback(_LEAD.sub("", text), talk.grounder.lexicon)):
        short = talk.state.goal is not None and any(one.startswith(_NO_ROOM) for one in talk.state.goal.reasons)
        if talk.state.goal is not None and talk.state.question is None and not short:
            return inform(talk, text, f"it is possible, so '{fallback}' is not needed")
        return answer_turn(talk, fallback)
    if answer := answer_listed(talk, text) or _answer_phrases(talk, text, partial(answer_turn, talk)):
        return answer
    if answer := edit_steps(talk, text) or answer_wait(talk, text) or answer_exclusion(talk, text):
        return answer
    before = talk.state
    parts = _sentences_of(talk, text)
    if parts and not asks_car(text, talk.grounder.lexicon):
        lead_in = next((each for each in (parts, _clauses_of(talk, text)) if _leads_in(talk, each)), None)
        if lead_in is not None:
            return answer_sentence(talk, lead_in[-1].text)
    parts = [] if talk.is_opening else parts
    if len(parts) == 1 and parts[0].act in _GIVING_UP:
        clauses = _clauses_of(talk, text)  # "never mind overtaking, just stay behind it"
        parts = clauses if any(one.asks for one in clauses) else []
    acts = [one.act for one in parts if not one.is_aside]
    plain = len(parts) > 1 and all(one.is_sure for one in parts) and len({*acts}) == len(acts)
    if plain and (answer := _answer_each(talk, parts)):
        return answer
    answer = answer_sentence(talk, text)
    if is_misunderstood(answer):
        after, talk.state = talk.state, before
        clauses = _clauses_of(talk, text)
        left_out = (one for one in clauses if one.is_chat and names_command(talk.read(one.text)))
        plain = len(clauses) > 1 and not any(one.may_do for one in clauses) and not any(left_out)
        again = _answer_each(talk, clauses, reasons=False) if plain else None
        if again is not None and not is_misunderstood(again):
            return again
        talk.state = after
    return answer


def _answer_beside_cabin(talk: Conversation, text: str, rest: str) -> Answer:
    """Answer what a turn says besides a wish about the cabin, and tell that this is not controlled here."""
    before = talk.state
    answer = answer_turn(talk, rest) if rest else None
    if answer is not None and answer.status != "not_a_command" and not is_misunderstood(answer):
        return replace(answer, reasons=(*answer.reasons, NOT_CONTROLLED))
    talk.state = before
    kept = ("the goal stays as it is",) if talk.state.goal is not None else ()
    return replace(aside(talk, text, NOT_CONTROLLED, *kept), status="not_a_command")


def _answer_phrases(talk: Conversation, text: str, answer_rest: Callable[[str], Answer]) -> Answer | None:
    """Answer a turn by its phrases, where each clause is one that is known as a whole; None for other turns."""
    if answer := name_followed(talk, text) or answer_gap(talk, text) or answer_somewhere(talk, text):
        return answer
    if answer := answer_whereabouts(talk, text) or answer_between_told(talk, text):
        return answer
    return answer_giving_up(talk, text, answer_rest) or answer_road_position(talk, text, answer_rest)


def _answer_each(talk: Conversation, parts: Sequence[Part], reasons: bool = True) -> Answer | None:
    """Answer the parts of a turn one after the other; None if all of them are chat.

    Args:
        talk: the conversation.
        parts: the parts, in order.
        reasons: whether a part that comes to nothing may be a reason; else nothing is answered then.

    Returns:
        The answer to the last part that chooses or changes something, else to the last question. A part that comes
        to nothing, and asks for nothing new, is a reason: "The second one. It's right outside my house".
    """
    asked = talk.state.question is not None
    # "No? Hm. What cars are there?" refuses nothing where nothing is asked.
    several = any(not (one.is_reply or (one.is_aside and (asked or one.is_chat))) for one in parts)
    answer = aside = None
    until = talk.state
    for i, one in enumerate(parts):
        before = talk.state
        later = parts[i + 1 :]
        replaced = one.act == "cancel" and any(other.act in _CHANGING for other in later)
        replaced = replaced or (one.act == "neither" and any(other.asks for other in later))
        if one.is_chat or (one.is_reply and several) or replaced:
            notice(talk, one.text)
        elif one.is_aside:
            aside = answer_sentence(talk, one.text)
        else:
            told = edit_steps(talk, one.text) or answer_wait(talk, one.text) or answer_sentence(talk, one.text)
            if answer is None or one.is_command or told.status == "ok":
                answer, until = told, before
            elif not reasons:
                return None
            else:
                talk.state = before
    if answer is None or aside is None or not _came_to_nothing(answer, parts):
        return answer or aside
    talk.state = until
    question = until.question.question if until.question else ""
    return replace(aside, question=question)  # "Ours is grey. Is there a grey trailer anywhere?"


def _came_to_nothing(answer: Answer, parts: Sequence[Part]) -> bool:
    """Return whether an answer is neither a goal nor the question which vehicle is meant, and no command failed."""
    asks = answer.status == "ambiguous" and len(answer.candidates) > 1
    return not (answer.status == "ok" or asks or any(one.is_command for one in parts))
