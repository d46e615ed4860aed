"""Answers to a question that lists vehicles: all descriptions of a turn together tell which one is meant."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from grounding.answer import Answer
from grounding.dialogue.choices import take_best
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import (
    any_of,
    find_counted,
    find_fitting,
    find_others,
    reading_of,
    without_positions,
)
from grounding.dialogue.fragments import begins_with_place, has_verb, read_description
from grounding.dialogue.merging import merge_request
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.turns import predict_turn
from grounding.language import Reading, WordCategory
from grounding.language.questions import read_question
from grounding.language.replies import Reply, read_reply
from grounding.language.syntax.tokenizer import normalise
from grounding.query import Query, Referent
from grounding.referent.resolver import Candidate, resolve
from grounding.referent.scene import SceneModel
from grounding.referent.scoring import note_invisible, note_unmapped
from grounding.vocabulary import POSITIONS

# Between the parts of an answer, and before what is not meant: "the white one not on the left".
_PART = re.compile(r"\s*[,.;!?]+\s*|\s+-+\s+|\s+but\s+(?!one\b)|(?<! is)(?<! are)\s+(?=not\s)")
_MOST_PARTS = 5
# "That one on the left" is described as "the one" is.
_POINTING = re.compile(r"^(?:that|this) (?=one\b)")
# Questions that ask how much: their words describe no vehicle.
_MEASURING = ("distance", "size", "measured", "gap", "tight", "duration")
# Replies that open a description, and those that leave the choice among the candidates of the other parts.
_OPENING, _OPEN = frozenset(("yes", "no", "meant", "pause", "thanks", "aside")), ("other", "any")
# Chat beside a description, and its least probability.
_CHAT, _SURE_CHAT = ("remark", "pause"), 0.7


@dataclass(frozen=True)
class Description:
    """Description of the intended candidate by a part of an answer; empty without a reading and a number.

    Attributes:
        reading: partial reading of the description.
        number: number in the list.
        negated: whether it describes what is not meant.
        takes_any: whether any candidate will do that the other parts describe.
        words: its words.
    """

    reading: Reading | None = None
    number: int | None = None
    negated: bool = False
    takes_any: bool = False
    words: str = ""

    @property
    def tells(self) -> bool:
        """Whether it says anything."""
        return self.reading is not None or self.number is not None

    @property
    def query(self) -> Query:
        """What it says, as a partial query."""
        return self.reading.query if self.reading is not None else Query("")

    @property
    def by_neighbour(self) -> bool:
        """Whether it tells where another vehicle or thing is."""
        return bool(self.query.secondary) and not self.negated

    @property
    def referent(self) -> Referent | None:
        """The vehicle that is meant, as described; None without a description of it."""
        return None if self.negated else self.query.referent

    def fitting(
        self, candidates: Sequence[Candidate], listed: Sequence[Candidate], scene: SceneModel
    ) -> list[Candidate]:
        """Return the candidates that it fits, by their numbers in the list where it names one."""
        if self.number is not None:
            return [one for one in listed[self.number - 1 : self.number] if one in candidates]
        return find_fitting(self.reading, candidates, scene) if self.reading is not None else list(candidates)

    def refusing(
        self, candidates: Sequence[Candidate], listed: Sequence[Candidate], scene: SceneModel
    ) -> list[Candidate]:
        """Return the candidates that it does not describe."""
        if self.reading is not None:
            return find_others(self.reading, candidates, scene)
        refused = self.fitting(candidates, listed, scene)
        return [one for one in candidates if one not in refused]


def answer_listed(talk: Conversation, text: str) -> Answer | None:
    """Answer the open question by the descriptions of which a turn consists; None if it says anything else."""
    question, request = talk.state.question, talk.state.request
    lists = question is not None and len(question.candidates) > 1 and not question.alternatives
    if not lists or question is None or request is None or any(one.partner for one in question.candidates):
        return None
    asked = read_question(text, talk.grounder.lexicon)
    if asked is not None and asked.kind in _MEASURING:
        return None  # "how far is that?" is not "the far one"
    described, left_out = _without_unseen(_read_parts(talk, text), talk.scene)
    left = pick_described(described, question.candidates, talk.scene) if described else []
    if not left and any(one.by_neighbour for one in described):
        left = pick_described(described, _all_like(request.query, talk.scene), talk.scene)
    if not left or len(left) == len(question.candidates):
        return None
    referent = _join([one.referent for one in described if one.referent is not None], request.query.referent)
    queries = [one.query for one in described if not one.negated]
    said_of_it = Query(text, referent=referent, secondary=tuple(part for one in queries for part in one.secondary))
    changed = merge_request(request, said_of_it)
    invisible = [note for one in queries if one.referent is not None for note in note_invisible(one.referent)]
    notes = (*changed.reading.notes, *invisible, *note_unmapped(said_of_it, talk.scene), *left_out)
    changed = replace(changed, reading=said(replace(changed.reading, notes=notes), text))
    takes_any = any(one.takes_any or (one.referent is not None and not one.referent.definite) for one in described)
    return take_best(talk, left, changed) if takes_any else talk.narrow(left, changed)


def pick_described(
    described: Sequence[Description], listed: Sequence[Candidate], scene: SceneModel
) -> list[Candidate]:
    """Return the listed candidates that all descriptions fit; positions count among those that fit the other words.

    Where two positions contradict each other, the candidates of both are returned.
    """
    left = list(listed)
    for one in described:
        if one.reading is not None and not one.negated:
            left = find_fitting(without_positions(one.reading), left, scene)
    narrowed = len(left) < len(listed)
    for one in described:
        if one.negated:
            left = one.refusing(left, listed, scene)
    positive = [one for one in described if one.tells and not one.negated]
    named = [_along(one, left, listed, scene) if narrowed else one.fitting(left, listed, scene) for one in positive]
    common = [one for one in left if all(one in each for each in named)]
    return common or [one for one in left if any(one in each for each in named if len(each) < len(left))]


def _without_unseen(described: Sequence[Description], scene: SceneModel) -> tuple[list[Description], list[str]]:
    """Return descriptions without those by a neighbour that no vehicle has, if others remain, and what is told."""
    unseen = [one for one in described if one.by_neighbour and not _all_like(one.query, scene)]
    if all(one in unseen or not one.tells for one in described):
        return [*described], []
    told = [f"none is '{one.words}': it was left out" for one in unseen]
    return [one for one in described if one not in unseen], told


def _all_like(query: Query, scene: SceneModel) -> tuple[Candidate, ...]:
    """Return all vehicles or people of the scene that fit a query, whatever place in a row it names."""
    plain = without_positions(reading_of(query.referent)).query.referent if query.referent is not None else None
    found = resolve(any_of(replace(query, referent=plain)), scene)
    return found.candidates if found.status != "not_found" else ()


def _along(
    one: Description, left: Sequence[Candidate], listed: Sequence[Candidate], scene: SceneModel
) -> list[Candidate]:
    """Return the candidates that a description fits; a number counts in the list, or those left along the road."""
    word = next((name for name, number in POSITIONS.items() if number == one.number), None)
    return [*one.fitting(left, listed, scene), *(find_counted((word,), left, scene) if word else ())]


def _read_parts(talk: Conversation, text: str) -> list[Description]:
    """Return what the parts of a turn say; empty if one is no description, or none describes."""
    parts = [one for one in _PART.split(normalise(text)) if one]
    if len(parts) > _MOST_PARTS:
        return []
    read = [_read_part(talk, part) for part in parts]
    told = [one for one in read if one is not None and one.tells]
    if any(one is None for one in read) or not told:
        return []
    if len(told) == 1 and any(begins_with_place(part, talk.readings) for part in parts):
        return []  # "behind the beige one" is also another place
    return [one for one in read if one is not None]


def _read_part(talk: Conversation, part: str) -> Description | None:
    """Return the description in a part of a turn, empty for chat; None if the part is anything else."""
    lexicon = talk.grounder.lexicon
    reply = read_reply(part, lexicon)
    opens = {*reply.kinds} <= {*_OPENING, "other"}
    words = reply.rest if opens else part
    if reply.number is not None and opens:
        return Description(number=reply.number)
    negated, words = words.startswith("not "), words.removeprefix("not ")
    if negated and (number := read_reply(words, lexicon).number) is not None:
        return Description(number=number, negated=True)
    asked = talk.antecedent
    like = Referent(asked.noun, asked.head) if asked is not None else Referent("vehicle", "one")
    described = _POINTING.sub("the ", words)
    reading = read_description(described, like, talk.readings, whole=True) if words else None
    points = reading is not None and any(one.category is WordCategory.PRONOUN for one in reading.tokens)
    if reading is not None and not points and not _commands(talk, part, reply):
        return Description(reading, negated=negated, words=words)
    if not reply.rest and reply.kinds and {*reply.kinds} <= {*_OPENING, *_OPEN}:
        return Description(takes_any="any" in reply.kinds)
    return Description() if _says_nothing(talk, part, reply) else None


def _commands(talk: Conversation, part: str, reply: Reply) -> bool:
    """Return whether a part of a turn is a command: "park in front of the red car"; "take the near one" is none."""
    prediction = predict_turn(talk, part, reply)[1]
    return prediction is not None and prediction.best("act") == "command" and has_verb(talk.read(part))


def _says_nothing(talk: Conversation, part: str, reply: Reply) -> bool:
    """Return whether a part of a turn describes nothing: a bare "the one", or chat: "my flat is there"."""
    tokens, prediction = predict_turn(talk, part, reply)
    if all(one.category in (WordCategory.THE, WordCategory.ONE) for one in tokens):
        return True
    return prediction is not None and sum(prediction.choices["act"][act] for act in _CHAT) >= _SURE_CHAT


def _join(described: Sequence[Referent], asked: Referent | None) -> Referent | None:
    """Return the vehicle that several descriptions name together, like the one that was asked about."""
    named = next((one for one in described if not one.anaphora), asked) or next(iter(described), None)
    if named is None:
        return None
    colour = next((one.colour for one in described if one.colour), named.colour)
    before = asked.qualifiers if named is asked and asked is not None else ()
    qualifiers = dict.fromkeys((*before, *(word for one in described for word in one.qualifiers)))
    return replace(named, colour=colour, qualifiers=tuple(qualifiers))
