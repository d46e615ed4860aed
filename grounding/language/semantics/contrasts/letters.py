"""Letters of word categories, and patterns of noun phrases and places over them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import MODIFIERS, NOUNS, WordCategory

_LETTERS = (
    dict.fromkeys((WordCategory.THE, WordCategory.ANY, WordCategory.POSSESSIVE), "d")
    | dict.fromkeys(MODIFIERS - {WordCategory.MAKE}, "m")
    | dict.fromkeys((*NOUNS, WordCategory.MAKE, WordCategory.MODEL), "h")
    | dict.fromkeys((WordCategory.RELATION, WordCategory.BETWEEN), "r")
    | {
        WordCategory.NUMBER: "n",
        WordCategory.UNKNOWN: "u",
        WordCategory.ONE: "o",
        WordCategory.PRONOUN: "p",
        WordCategory.EGO: "e",
        WordCategory.SIDE: "s",
        WordCategory.WHERE: "w",
        WordCategory.LANE: "l",
        WordCategory.DIRECTION: "t",
        WordCategory.DISTANCE: "x",
        WordCategory.VERB: "v",
        WordCategory.NOT: "N",
        WordCategory.EXCEPT: "E",
        WordCategory.CORRECT: "C",
        WordCategory.COMMA: ",",
        WordCategory.BREAK: ".",
        WordCategory.BUT: "B",
        WordCategory.AND: "A",
        WordCategory.OR: "O",
        WordCategory.WHICH: "W",
        WordCategory.BE: "b",
        WordCategory.AUX: "a",
        WordCategory.SUB: "S",
        WordCategory.TO: "T",
        WordCategory.THEN: "H",
        WordCategory.HERE: "k",
        WordCategory.OF: "f",
    }
)
# A noun phrase, with the places that follow it, and a place: a preposition with its noun phrase, or a single word.
NOUN = r"(?:d*[mnu]*[ho]+|d+[mn]+|p)"
WHOLE_NOUN = rf"(?:{NOUN}(?:(?:Wb?)?[swlt]+|(?:Wb?)r+{NOUN})*)"
PLACE = rf"(?:r+{NOUN}(?:Wb?)?[swl]*|[swlt])"
END = r"(?=[,.]|$|[AH]|v|T|(?<=[ho])d)"
SIDES = ("left", "right")

# The matched tokens -> their replacement; None if the rule does not apply after all.
Rewrite = Callable[[list[Token], "re.Match[str]"], list[Token] | None]


def letter(token: Token) -> str:
    """Return the letter of a token; "M" for a negation of the next word alone ("non"), "F" for "far from"."""
    if token.category is WordCategory.NOT and token.value:
        return {"attribute": "M", "far": "F"}[token.value]
    return _LETTERS.get(token.category, "z")


def span(tokens: Sequence[Token], match: re.Match[str], group: str) -> list[Token]:
    """Return the tokens of a group of a match."""
    return list(tokens[match.start(group) : match.end(group)])


def comma(token: Token) -> Token:
    """Return a comma in the place of a token."""
    return replace(token.with_category(WordCategory.COMMA), text=",", written=",")


def complete(chosen: Sequence[Token], model: Sequence[Token]) -> list[Token]:
    """Return a phrase with its pronoun or its "one" replaced by the words of the phrase that it stands for."""
    letters = "".join(map(letter, model))
    found = list(re.finditer(NOUN, letters))
    if not found or "p" in found[-1].group():
        return list(chosen)
    whole = list(model[found[-1].start() : found[-1].end()])
    heads = [token for token in whole if letter(token) in "h"]
    completed: list[Token] = []
    for token in chosen:
        if letter(token) == "p":
            completed += whole
        elif letter(token) == "o" and heads:
            completed += heads
        else:
            completed.append(token)
    adjective = not any(letter(token) in "hop" for token in chosen) and letter(chosen[0]) in "dm"
    return [*completed, *heads] if adjective else completed  # "the first van, or rather the second"
