"""Clauses of a turn as words, and the kinds of phrase that they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from grounding.dialogue.conversation import Conversation
from grounding.language import WordCategory
from grounding.language.replies import words_after_opening, words_end
from grounding.language.syntax.lexicon import default_lexicon
from grounding.language.syntax.phrase_patterns import WORD
from grounding.language.syntax.tokenizer import normalise

Words = tuple[str, ...]
MARKS = (",", ".", ";", "!", "?")
# What joins two clauses.
JOINING = (*MARKS, "and", "but", "then")
_JOINTS, _AND_A_HALF = (*MARKS, "and", "but"), ("and", "a", "half")


def clauses_of(talk: Conversation, text: str) -> list[Words]:
    """Return the clauses of a turn without what only opens or closes them: "ok, but on our side, please"."""
    lexicon = talk.grounder.lexicon
    found = (words_after_opening(" ".join(part), lexicon) for part in _parts(WORD.findall(normalise(text))))
    return [tuple(word for word in part if word not in MARKS) for part in found if part]


def is_phrase(kind: str, words: Words) -> bool:
    """Return whether some words are a phrase of a kind as a whole."""
    return bool(words) and words_end(kind, words, 0) == len(words)


def says(kind: str, text: str) -> bool:
    """Return whether a phrase of a kind is anywhere in a turn."""
    words = tuple(WORD.findall(normalise(text)))
    return any(words_end(kind, words, i) > i for i in range(len(words)))


def _parts(words: Sequence[str]) -> Iterator[Sequence[str]]:
    """Yield the words between marks and conjunctions."""
    start = 0
    joints = (i for i, word in enumerate(words) if word in _JOINTS and tuple(words[i : i + 3]) != _AND_A_HALF)
    for end in (*joints, len(words)):
        if end > start:
            yield words[start:end]
        start = end + 1


def whole_number(word: str) -> int | None:
    """Return the whole number that a word is; None for other words."""
    _, entry = default_lexicon().longest_match((word,), 0) or (0, None)
    if word.isdigit():
        return int(word)
    return int(float(entry.value)) if entry is not None and entry.category is WordCategory.NUMBER else None
