"""Patterns of phrases and the lexical entries that they stand for: the contents of a lexicon."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

from grounding.language.syntax.word_categories import WordCategory

WORD = re.compile(
    r"\d+x\d+|\d+(?:st|nd|rd|th)\b|\d+(?:\.\d+)?|[a-z]{1,3}\d{1,3}\b|[^\W\d_]+(?:'[^\W\d_]+)*|'s\b|(?<!\w)'[aeiou][^\W\d_]+"
    r"|[.;!?,&]"
)
_WORD = r"[^\W\d_]+(?:'[^\W\d_]+)*|\d+x\d+|\d+(?:st|nd|rd|th)?|[a-z]{1,3}\d{1,3}"
_CHOICE = rf"(?:{_WORD})(?:_(?:{_WORD}))*"
_PART = re.compile(rf"\[{_CHOICE}(?:\|{_CHOICE})*\]|{_CHOICE}(?:\|{_CHOICE})*|&")
_MAX_PARTS = 12
# The choices of a part by their first word, and whether the part is optional.
PatternPart = tuple[dict[str, list[tuple[str, ...]]], bool]


@dataclass(frozen=True)
class LexicalEntry:
    """Category and meaning of a phrase.

    Attributes:
        category: grammatical category.
        value: meaning; for a verb the commanded action, then the direction or relation that it implies.
        state: for a verb, the state that it ascribes to another vehicle; '' if none.
        event: for a verb, the trigger when a command waits for another vehicle to do it; '' if none.
    """

    category: WordCategory
    value: str = ""
    state: str = ""
    event: str = ""


class PhrasePattern:
    """A set of phrases in one line: a|b is a choice, [a|b] is optional, _ joins the words of a choice."""

    def __init__(
        self, text: str, entry: LexicalEntry, inflect: Callable[[str, WordCategory], tuple[str, ...]]
    ) -> None:
        """Keep the pattern's text, the entry of its phrases, and the function that inflects verbs and nouns."""
        self.text = text
        self.entry = entry
        self._inflect = inflect
        self._parts: tuple[PatternPart, ...] = ()
        # Fewest words that match.
        self._least = sum(part[0] != "[" for part in text.split())

    def parts(self) -> tuple[PatternPart, ...]:
        """Return the parts in order; the text is parsed on the first call.

        Raises:
            ValueError: if the text is not a valid pattern.
        """
        if self._parts:
            return self._parts
        texts = self.text.split()
        if not all(_PART.fullmatch(part) for part in texts):
            raise ValueError(f"expected words, a|b or [a|b], got '{self.text}'")
        if len(texts) > _MAX_PARTS or all(part[0] == "[" for part in texts):
            raise ValueError(f"expected 1 to {_MAX_PARTS} words, one at least not in brackets, got '{self.text}'")
        first, *_ = required = [i for i, part in enumerate(texts) if part[0] != "["]
        parts = []
        for i, part in enumerate(texts):
            by_word: dict[str, list[tuple[str, ...]]] = {}
            for choice in part.strip("[]").split("|"):
                # A verb phrase inflects in its first words, a noun phrase in its last.
                inflects = i <= first if self.entry.category is WordCategory.VERB else i >= required[-1]
                for phrase in self._forms(tuple(choice.split("_")), inflects):
                    by_word.setdefault(phrase[0], []).append(phrase)
            parts.append((by_word, part[0] == "["))
        self._parts = tuple(parts)
        return self._parts

    def _forms(self, words: tuple[str, ...], inflects: bool) -> list[tuple[str, ...]]:
        """Return all inflected forms of a choice."""
        if not inflects:
            return [words]
        if self.entry.category is WordCategory.VERB:
            return [(form, *words[1:]) for form in self._inflect(words[0], WordCategory.VERB)]
        return [(*words[:-1], form) for form in self._inflect(words[-1], self.entry.category)]

    def match_end(self, words: tuple[str, ...], start: int) -> int:
        """Return the end (exclusive) of the longest match from `start`; `start` if nothing matches."""
        if len(words) - start < self._least:
            return start  # without parsing the text, which most patterns never need
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
        """Yield every phrase of the pattern as a tuple of words."""
        choices = [
            [*(choice for by_word in part.values() for choice in by_word), *([()] if optional else [])]
            for part, optional in self.parts()
        ]
        for chosen in product(*choices):
            if phrase := tuple(word for choice in chosen for word in choice):
                yield phrase
