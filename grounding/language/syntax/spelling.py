"""Spelling correction: words one edit away from a word of the lexicon, and suggestions for unknown words."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

from grounding.language.syntax.lexicon import Lexicon, default_lexicon
from grounding.language.syntax.word_categories import WordCategory

# Shorter words are not corrected: one edit turns car into cat and van into can. Longer words are not tried: the work
# grows with the square of the length, and no word of the lexicon is as long.
_MIN_LENGTH, _MAX_LENGTH = 5, 30
_LETTERS = "abcdefghijklmnopqrstuvwxyz"


def correct_spelling(word: str, lexicon: Lexicon) -> str:
    """Return the word of the lexicon that a misspelt word stands for; the word itself if it is known or ambiguous."""
    checked = word.isascii() and word.isalpha() and _MIN_LENGTH <= len(word) <= _MAX_LENGTH
    if word in lexicon.words or not checked:
        return word
    found = {edit for edit in _single_edits(word) if len(edit) >= _MIN_LENGTH - 1 and _is_likely(word, edit, lexicon)}
    stems = {edit.removesuffix("s") for edit in found}
    return min(found, key=lambda edit: (abs(len(edit) - len(word)), edit)) if len(stems) == 1 else word


def suggest_word(word: str, categories: tuple[WordCategory, ...], lexicon: Lexicon | None = None) -> str | None:
    """Return the most similar single word of some categories, None if no word is similar."""
    patterns = (lexicon or default_lexicon()).patterns
    choices = [one.text for one in patterns if one.entry.category in categories and one.text.isalpha()]
    found = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return found[0] if found else None


def _is_likely(word: str, edit: str, lexicon: Lexicon) -> bool:
    """Return whether an edited word is a plausible correction.

    The first letter is rarely wrong, and short words have many neighbours.
    """
    priority = lexicon.words.get(edit, 0)
    swapped = sorted(word) == sorted(edit)
    replaced = len(word) == len(edit) and not swapped
    return (
        priority > 0
        and (swapped or word[0] == edit[0])
        and (priority == 2 or not replaced or len(word) > _MIN_LENGTH)
    )


def _single_edits(word: str) -> Iterator[str]:
    """Yield all strings one deletion, replacement, swap of neighbours or insertion away."""
    for i in range(len(word) + 1):
        head, tail = word[:i], word[i:]
        if tail:
            yield head + tail[1:]
            yield from (head + letter + tail[1:] for letter in _LETTERS)
        if len(tail) > 1:
            yield head + tail[1] + tail[0] + tail[2:]
        yield from (head + letter + tail for letter in _LETTERS)
