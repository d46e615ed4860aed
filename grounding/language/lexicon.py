"""The words of driving commands: phrases read from text files, what each is to the grammar and what it stands for."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from os import PathLike
from pathlib import Path
from typing import get_args

from appocc.errors import DataError
from appocc.files import read_text
from grounding.language.word_categories import (
    INFLECTED,
    LIGHT_VERBS,
    MENDED,
    NOUNS,
    VALUES,
    WORD,
    Entry,
    Kind,
    Pattern,
    State,
)

__all__ = ["Kind", "Lexicon", "default_lexicon", "phrases", "read_lexicon"]

DEFAULT = Path(__file__).parent / "data" / "lexicon.txt"
STATES: tuple[str, ...] = (*get_args(State), "own_lane")
EVENTS = ("pass", "leave", "turn", "stop", "merge", "clear", "other")
_WRITTEN = {kind.value: kind for kind in Kind if kind not in (Kind.COMMA, Kind.BREAK, Kind.DISTANCE, Kind.UNKNOWN)}
_MOST_BYTES = 1_000_000
_HEAD = re.compile(r"\[([a-z]+)([^\]\[|]*)((?:\|[^\]\[]*)?)\]")


@dataclass
class Lexicon:
    """Phrases by their first word, and all their words.

    Attributes:
        patterns: in the order in which they were read; the last wins where two are as long.
        by_word: the same by the words they may begin with.
        forms: of inflected words: s, ing, past, plural.
        words: every word; 0 where no slip is mended to it, 1 where one is, 2 for what is named most.
        irregular: forms of verbs and plurals that no rule makes.
    """

    patterns: list[Pattern] = field(default_factory=list)
    by_word: dict[str, list[Pattern]] = field(default_factory=dict)
    forms: dict[str, str] = field(default_factory=dict)
    words: dict[str, int] = field(default_factory=dict)
    irregular: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def longest(self, words: tuple[str, ...], start: int) -> tuple[int, Entry] | None:
        """One past the longest phrase that begins at `start`, and what it is; None where none does."""
        best: tuple[int, Entry] | None = None
        for pattern in self.by_word.get(words[start], ()):
            end = pattern.end(words, start)
            if end > start and (best is None or end >= best[0]):
                best = end, _both(best[1], pattern.entry) if best and best[0] == end else pattern.entry
        return best

    def add(self, line: str, entry: Entry) -> None:
        """Add the phrases of a line; they are indexed here, and taken apart when they are first tried."""
        for text in filter(None, map(str.strip, line.split(";"))):
            pattern = Pattern(text, entry, self.inflected)
            self.patterns.append(pattern)
            for word in re.split(r"[\[\]|_ ]+", text):
                self.words.setdefault(word, 0)
            first, *rest = text.split()
            for word in re.split(r"[\[\]|_]+", rest[-1]) if rest and entry.kind in NOUNS else ():
                self.words.setdefault(self.inflected(word, entry.kind)[1], 0)
            alone = first.isalnum() and all(part[0] == "[" for part in rest)
            mended = alone and entry.kind in MENDED and entry.value not in LIGHT_VERBS
            often = mended * (2 if entry.kind in (Kind.NOUN, Kind.COLOUR) else 1)
            for word in self._beginnings(text, entry.kind):
                self.by_word.setdefault(word, []).append(pattern)
                self.words[word] = max(self.words.get(word, 0), often)

    def _beginnings(self, text: str, kind: Kind) -> set[str]:
        """All words that the phrases of a pattern begin with."""
        words: set[str] = set()
        for part in text.split():
            for choice in part.strip("[]").split("|"):
                first, *more = choice.split("_")
                words.update(self.inflected(first, kind) if kind is Kind.VERB or not more else (first,))
            if part[0] != "[":
                break
        return words

    def inflected(self, word: str, kind: Kind) -> tuple[str, ...]:
        """The word itself, and its other forms if it is a verb or a noun; they are remembered in `forms`."""
        if kind not in INFLECTED:
            return (word,)
        forms = self.irregular.get(word) or _regular(word)
        if kind is not Kind.VERB:
            self.forms.setdefault(forms[1], "plural")
            return forms[:2]
        for form, name in zip(forms[1:], ("s", "ing", "past", "past"), strict=False):
            if form != word:
                self.forms.setdefault(form, name)
        return forms


def _both(before: Entry, entry: Entry) -> Entry:
    """One entry of two of the same phrase: the later, but a verb keeps what it commands ("get out")."""
    if before.kind is entry.kind is Kind.VERB and "none" in (before.value, entry.value):
        value = before.value if entry.value == "none" else entry.value
        return Entry(Kind.VERB, value, entry.state or before.state, entry.event or before.event)
    return entry


@cache
def _regular(word: str) -> tuple[str, ...]:
    """A verb with -s, -ing, -ed; the second is a noun's plural, too."""
    before, last = word[-2:-1], word[-1:]
    if last == "y" and before not in "aeiou":
        return word, word[:-1] + "ies", word + "ing", word[:-1] + "ied"
    plural = word + ("es" if last in "sxz" or word[-2:] in ("ch", "sh") else "s")
    if last == "e":
        return word, plural, word[:-1] + "ing", word + "d"
    # One short syllable doubles its last letter: stop, stopping.
    stem = word + last if re.fullmatch(r"[^aeiou]*[aeiou][^aeiouwxy]", word) else word
    return word, plural, stem + "ing", stem + "ed"


def read_lexicon(path: str | PathLike[str], base: Lexicon | None = None) -> Lexicon:
    """The phrases of a file, added to those of the package (or of `base`), which stays as it is.

    Raises:
        DataError: if the file or a line of it cannot be read, with its number.
    """
    lexicon = _copy(base or default_lexicon())
    _read_into(lexicon, Path(path), careful=True)
    return lexicon


@cache
def default_lexicon() -> Lexicon:
    """The phrases of the package."""
    lexicon = Lexicon()
    _read_into(lexicon, DEFAULT)
    return lexicon


def phrases() -> dict[tuple[str, ...], tuple[Kind, str]]:
    """Every phrase of the package, word by word, with its kind and value."""
    return {
        phrase: (pattern.entry.kind, pattern.entry.value)
        for pattern in default_lexicon().patterns
        for phrase in pattern.phrases()
    }


def _copy(base: Lexicon) -> Lexicon:
    by_word = {word: list(patterns) for word, patterns in base.by_word.items()}
    return Lexicon(list(base.patterns), by_word, dict(base.forms), dict(base.words), dict(base.irregular))


def _read_into(lexicon: Lexicon, path: Path, careful: bool = False) -> None:
    """Add the phrases of a file; `careful`: each is taken apart at once, so that mistakes are told."""
    lines = read_text(path, _MOST_BYTES).splitlines()
    section: Entry | None = None
    in_forms = False
    for number, line in enumerate(lines, start=1):
        text = line.strip().casefold().replace("-", " ")
        if not text or text.startswith("#"):
            continue
        try:
            if head := _HEAD.fullmatch(text):
                in_forms = head[0] == "[forms]"
                section = None if in_forms else _entry(head)
            elif in_forms:
                lexicon.irregular[text.split()[0]] = _forms(text)
            elif section is None:
                raise ValueError(f"expected a section such as [noun car] first, got '{text[:60]}'")
            else:
                before = len(lexicon.patterns)
                lexicon.add(text, section)
                for pattern in lexicon.patterns[before:] if careful else ():
                    pattern.parts()
        except ValueError as error:
            raise DataError(f"{path}: line {number}: {error}") from error


def _forms(text: str) -> tuple[str, ...]:
    forms = tuple(text.split())
    if not 2 <= len(forms) <= 6 or not all(WORD.fullmatch(word) for word in forms):
        raise ValueError(f"expected a word and its forms (-s, -ing, -ed), got '{text[:60]}'")
    return forms


def _entry(head: re.Match[str]) -> Entry:
    """What the head of a section says of its phrases."""
    if head[1] not in _WRITTEN:
        raise ValueError(f"expected a section of one of {', '.join(_WRITTEN)}, got '{head[0]}'")
    kind, value = _WRITTEN[head[1]], head[2].strip()
    allowed = VALUES.get(kind)
    if allowed and value.split(" ")[0] not in allowed:
        raise ValueError(f"expected [{kind.value}] to be one of {', '.join(allowed)}, got '{value}'")
    if kind in (Kind.NUMBER, Kind.UNIT) and not re.fullmatch(r"\d{1,6}(\.\d{1,6})?", value):
        raise ValueError(f"expected a plain number, got '{head[0]}'")
    more = {}
    for item in filter(None, (part.strip() for part in head[3].split("|"))):
        key, _, what = item.partition("=")
        if what not in {"is": STATES, "event": EVENTS}.get(key, ()):
            raise ValueError(
                f"expected is=STATE ({', '.join(STATES)}) or event=EVENT ({', '.join(EVENTS)}), got '{item}'"
            )
        more[key] = what
    return Entry(kind, value, more.get("is", ""), more.get("event", ""))
