"""Kinds of words and phrases, and patterns of phrases: what a lexicon is made of."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from typing import Literal, get_args

WORD = re.compile(
    r"\d+x\d+|\d+(?:st|nd|rd|th)\b|\d+(?:\.\d+)?|[a-z]{1,3}\d{1,3}\b|[^\W\d_]+(?:'[^\W\d_]+)*|'s\b|[.;!?,&]"
)
_WORD = r"[^\W\d_]+(?:'[^\W\d_]+)*|\d+x\d+|\d+(?:st|nd|rd|th)?|[a-z]{1,3}\d{1,3}"
_CHOICE = rf"(?:{_WORD})(?:_(?:{_WORD}))*"
_PART = re.compile(rf"\[{_CHOICE}(?:\|{_CHOICE})*\]|{_CHOICE}(?:\|{_CHOICE})*|&")
_MOST_PARTS = 12
# The choices of a part by their first word, and whether it may be left out.
Part = tuple[dict[str, list[tuple[str, ...]]], bool]


class Kind(StrEnum):
    """What a word is to the grammar."""

    VERB = "verb"
    MEANWHILE = "meanwhile"
    NONDRIVE = "nondrive"
    RELATION = "relation"
    BETWEEN = "between"
    WHERE = "where"
    HERE = "here"
    THERE = "there"
    SIDE = "side"
    LANE = "lane"
    DIRECTION = "direction"
    NOUN = "noun"
    MAKE = "make"
    MODEL = "model"
    PERSON = "person"
    THING = "thing"
    REGION = "region"
    SPOT = "spot"
    PART = "part"
    COLOUR = "colour"
    SHADE = "shade"
    ORDINAL = "ordinal"
    SUPERLATIVE = "superlative"
    STATE = "state"
    SIZE = "size"
    EXTRA = "extra"
    THE = "the"
    THAT = "that"
    ANY = "any"
    POSSESSIVE = "possessive"
    WHICH = "which"
    PRONOUN = "pronoun"
    ONE = "one"
    EGO = "ego"
    BE = "be"
    AUX = "aux"
    NOT = "not"
    EXCEPT = "except"
    EXISTS = "exists"
    NUMBER = "number"
    UNIT = "unit"
    TIME = "time"
    AWAY = "away"
    ABOUT = "about"
    AND = "and"
    OR = "or"
    BUT = "but"
    THEN = "then"
    SUB = "sub"
    TO = "to"
    OF = "of"
    OUT = "out"
    CORRECT = "correct"
    QUESTION = "question"
    FILLER = "filler"
    COMMA = "comma"
    BREAK = "break"
    DISTANCE = "distance"
    UNKNOWN = "unknown"


NOUNS = frozenset((Kind.NOUN, Kind.PERSON, Kind.THING, Kind.REGION, Kind.SPOT, Kind.PART))
# What a slip of the pen may be mended to; never a small word.
INFLECTED = NOUNS | {Kind.VERB}
MENDED = (NOUNS - {Kind.REGION, Kind.PART, Kind.SPOT}) | {
    Kind.VERB,
    Kind.COLOUR,
    Kind.ORDINAL,
    Kind.SUPERLATIVE,
    Kind.STATE,
    Kind.SIZE,
    Kind.DIRECTION,
}
Action = Literal[
    "park",
    "stop",
    "pull_over",
    "follow",
    "approach",
    "overtake",
    "drive_past",
    "turn",
    "change_lane",
    "wait",
    "slow_down",
    "give_way",
    "avoid",
    "other",
]
Relation = Literal[
    "none",
    "behind",
    "in_front_of",
    "next_to",
    "near",
    "left_of",
    "right_of",
    "opposite",
    "between",
    "past",
    "before",
    "at",
    "toward",
    "same_as",
]
# What a vehicle does, as far as it tells it from others.
State = Literal[
    "parked",
    "stopped",
    "moving",
    "oncoming",
    "turning",
    "turning_left",
    "turning_right",
    "leaving",
    "passing",
    "braking",
]
ACTIONS: tuple[str, ...] = get_args(Action)
RELATIONS: tuple[str, ...] = get_args(Relation)[1:]
LIGHT_VERBS = ("go", "drive", "move", "get", "pull", "stay", "take", "bring", "leave", "give")
# Colour words, each with the colour that it is a kind of.
COLOURS: dict[str, str] = {
    **{
        word: word
        for word in ("black", "grey", "silver", "white", "red", "orange", "brown", "yellow", "green", "blue")
    },
    **{word: word for word in ("purple", "pink", "beige", "tan", "maroon", "navy", "turquoise", "gold", "violet")},
    **{
        "crimson": "red",
        "scarlet": "red",
        "ruby": "red",
        "burgundy": "maroon",
        "magenta": "pink",
        "lavender": "purple",
    },
    **{"olive": "green", "lime": "green", "emerald": "green", "khaki": "tan", "mustard": "yellow", "bronze": "brown"},
    **{"copper": "brown", "chocolate": "brown", "charcoal": "grey", "cream": "beige", "champagne": "beige"},
    **{"ivory": "white", "teal": "turquoise", "cyan": "turquoise", "lilac": "violet", "indigo": "violet"},
}
# What a section's value may be, where the list is closed.
VALUES: dict[Kind, tuple[str, ...]] = {
    Kind.COLOUR: tuple(COLOURS),
    Kind.VERB: (*ACTIONS, *LIGHT_VERBS, "danger", "none"),
    Kind.NOUN: (
        *("car", "van", "truck", "bus", "trailer", "motorcycle", "bicycle", "construction_vehicle"),
        *("vehicle", "traffic"),
    ),
    Kind.RELATION: (
        *("behind", "in_front_of", "next_to", "near", "left_of", "right_of", "toward", "before", "past"),
        *("opposite", "same_as", "at", "in", "into", "on", "along", "with", "for"),
    ),
    Kind.SIDE: ("left_side", "right_side", "opposite_side", "from_left", "from_right"),
    Kind.DIRECTION: ("left", "right", "straight"),
    Kind.LANE: ("left_lane", "right_lane", "middle_lane", "other_lane"),
    Kind.WHERE: ("ahead", "behind_ego", "own_lane", "beside_ego"),
}


@dataclass(frozen=True)
class Entry:
    """What a phrase is.

    Attributes:
        kind: what it is to the grammar.
        value: what it stands for; of a verb what it commands, then the direction or relation it carries.
        state: of a verb what it says of another vehicle, '' for nothing.
        event: of a verb what it is when another vehicle is awaited to do it, '' for nothing.
    """

    kind: Kind
    value: str = ""
    state: str = ""
    event: str = ""


class Pattern:
    """Phrases written as one: a|b is a choice, [a|b] may be left out, _ joins words within a choice."""

    def __init__(self, text: str, entry: Entry, inflected: Callable[[str, Kind], tuple[str, ...]]) -> None:
        """Keep the text, what its phrases are, and what makes the other forms of verbs and nouns."""
        self.text = text
        self.entry = entry
        self._inflected = inflected
        self._parts: tuple[Part, ...] = ()

    def parts(self) -> tuple[Part, ...]:
        """The parts in order.

        Raises:
            ValueError: if the text cannot be read, with what was expected.
        """
        if self._parts:
            return self._parts
        read = self.text.split()
        if not all(_PART.fullmatch(part) for part in read):
            raise ValueError(f"expected words, a|b or [a|b], got '{self.text}'")
        if len(read) > _MOST_PARTS or all(part[0] == "[" for part in read):
            raise ValueError(f"expected 1 to {_MOST_PARTS} words, one at least not in brackets, got '{self.text}'")
        first, *_ = needed = [i for i, part in enumerate(read) if part[0] != "["]
        parts = []
        for i, part in enumerate(read):
            by_word: dict[str, list[tuple[str, ...]]] = {}
            for choice in part.strip("[]").split("|"):
                # The first words of a verb have its forms, the last ones of a noun.
                inflects = i <= first if self.entry.kind is Kind.VERB else i >= needed[-1]
                for phrase in self._forms(tuple(choice.split("_")), inflects):
                    by_word.setdefault(phrase[0], []).append(phrase)
            parts.append((by_word, part[0] == "["))
        self._parts = tuple(parts)
        return self._parts

    def _forms(self, words: tuple[str, ...], inflects: bool) -> list[tuple[str, ...]]:
        """All forms of a choice: of verbs by the first word, of nouns by the last."""
        if not inflects:
            return [words]
        if self.entry.kind is Kind.VERB:
            return [(form, *words[1:]) for form in self._inflected(words[0], Kind.VERB)]
        return [(*words[:-1], form) for form in self._inflected(words[-1], self.entry.kind)]

    def end(self, words: tuple[str, ...], start: int) -> int:
        """One past the longest match that begins at `start`, which is `start` where there is none."""
        ends = {start}
        for choices, optional in self.parts():
            after = set(ends) if optional else set()
            for at in ends:
                if at < len(words):
                    for choice in choices.get(words[at], ()):
                        if words[at : at + len(choice)] == choice:
                            after.add(at + len(choice))
            ends = after
            if not ends:
                return start
        return max(ends)

    def phrases(self) -> Iterator[tuple[str, ...]]:
        """All phrases, word by word."""
        choices = [
            [*(choice for by_word in part.values() for choice in by_word), *([()] if optional else [])]
            for part, optional in self.parts()
        ]
        for chosen in product(*choices):
            if phrase := tuple(word for choice in chosen for word in choice):
                yield phrase
