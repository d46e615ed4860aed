"""Sentence -> typed tokens: normalise, split into words, longest match in the lexicon, repair of small slips."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from grounding.lexicon import WEAK_VERBS, Kind, phrases

MAX_CHARACTERS = 500
_WORD = re.compile(r"\d+x\d+|\d+(?:st|nd|rd|th)\b|\d+(?:\.\d+)?|[^\W\d_]+(?:['-][^\W\d_]+)*|[.;!?]")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
# Only longer words are repaired: among short ones every slip is another word (car, cat; van, can).
_REPAIRED_FROM = 5


@dataclass(frozen=True)
class Token:
    """One word or phrase of a sentence.

    Attributes:
        kind: what it is to the grammar.
        value: its meaning in the lexicon's words; the number of a NUMBER; metres of a UNIT.
        text: as written (normalised).
        meant: the same with slips of spelling mended.
        start: first character in the normalised sentence.
        end: one past the last.
    """

    kind: Kind
    value: str
    text: str
    meant: str
    start: int
    end: int


def normalise(text: str) -> str:
    """Lower case, plain quotes and blanks; characters keep their meaning, not their number."""
    folded = unicodedata.normalize("NFKC", text).casefold().replace("’", "'").replace("‘", "'")
    return " ".join("".join(c if c.isprintable() else " " for c in folded).split())


def tokenise(normalised: str) -> list[Token]:
    """Typed tokens of a normalised sentence in order; marks of punctuation that end a clause are BREAK."""
    words = list(_WORD.finditer(normalised))
    spelling = [_repaired(word.group()) for word in words]
    tokens, i = [], 0
    while i < len(words):
        length, kind, value = _longest(spelling[i:])
        span = words[i : i + length]
        start, end = span[0].start(), span[-1].end()
        tokens.append(Token(kind, value, normalised[start:end], " ".join(spelling[i : i + length]), start, end))
        i += length
    return tokens


def _longest(words: list[str]) -> tuple[int, Kind, str]:
    """Number of words, kind and value of the longest phrase at the beginning of `words`."""
    book = phrases()
    for length in range(min(_longest_phrase(), len(words)), 0, -1):
        entry = book.get(tuple(words[:length]))
        if entry is not None:
            return length, *entry
    if words[0] in ".;!?":
        return 1, Kind.BREAK, ""
    if _NUMBER.fullmatch(words[0]):
        return 1, Kind.NUMBER, words[0]
    return 1, Kind.UNKNOWN, ""


@cache
def _longest_phrase() -> int:
    return max(len(phrase) for phrase in phrases())


@cache
def _vocabulary() -> dict[str, bool]:
    """Every word of the lexicon; True where it bears meaning, so that a slip may be mended to it."""
    known: dict[str, bool] = {}
    for phrase, (kind, _) in phrases().items():
        for word in phrase:
            meant = kind not in (Kind.FILLER, Kind.BEYOND) and len(phrase) == 1 and word not in WEAK_VERBS
            known[word] = known.get(word, False) or meant
    return known


def _repaired(word: str) -> str:
    """The word itself, or the only meaning word one slip away from a longer word that is not known."""
    vocabulary = _vocabulary()
    if word in vocabulary or len(word) < _REPAIRED_FROM or not word.isascii():
        return word
    found = {slip for slip in _slips(word) if vocabulary.get(slip, False) and len(slip) >= _REPAIRED_FROM - 1}
    return found.pop() if len(found) == 1 else word


def _slips(word: str) -> Iterator[str]:
    """All strings one deletion, swap of neighbours, replacement or insertion away."""
    letters = "abcdefghijklmnopqrstuvwxyz"
    for i in range(len(word) + 1):
        head, tail = word[:i], word[i:]
        if tail:
            yield head + tail[1:]
            yield from (head + letter + tail[1:] for letter in letters)
        if len(tail) > 1:
            yield head + tail[1] + tail[0] + tail[2:]
        yield from (head + letter + tail for letter in letters)


def did_you_mean(word: str, kinds: tuple[Kind, ...]) -> str | None:
    """The nearest single word of some kinds, None where nothing resembles it."""
    choices = [phrase[0] for phrase, (kind, _) in phrases().items() if kind in kinds and len(phrase) == 1]
    found = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return found[0] if found else None
