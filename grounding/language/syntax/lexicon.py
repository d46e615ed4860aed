"""Lexicon of driving commands: phrases read from text files, each with its grammatical category and meaning."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from os import PathLike
from pathlib import Path

from appocc.errors import DataError
from appocc.files import read_text
from grounding.language.syntax.phrase_patterns import WORD, LexicalEntry, PhrasePattern
from grounding.language.syntax.word_categories import (
    INFLECTED,
    NOUNS,
    SECTION_VALUES,
    WordCategory,
)
from grounding.vocabulary import STATES, TRIGGERS

DEFAULT_PATH = Path(__file__).parent / "data" / "lexicon.txt"
_NO_SECTIONS = (
    WordCategory.COMMA,
    WordCategory.BREAK,
    WordCategory.BRANCH,
    WordCategory.UNKNOWN,
)
_SECTIONS = {category.value: category for category in WordCategory if category not in _NO_SECTIONS}
# Categories whose value is a number: a count, metres, and the cost (nats) of leaving a hesitation out.
_NUMERIC = (WordCategory.NUMBER, WordCategory.UNIT, WordCategory.DISTANCE, WordCategory.HESITATION)
_VERB_STATES = (*STATES, "own_lane", "facing_us", "touching")
_MAX_BYTES = 1_000_000
# Longest phrase in words, and most matches that are kept for the next text.
_MAX_PHRASE, _MAX_MATCHES = 16, 50_000
_HEADING = re.compile(r"\[([a-z]+)([^\]\[|]*)((?:\|[^\]\[]*)?)\]")


@dataclass(eq=False)
class Lexicon:
    """Phrase patterns, indexed by their first words.

    Attributes:
        patterns: in file order; of two matches of equal length the later pattern wins.
        by_word: first word -> patterns that may begin with it.
        forms: inflected word -> form: s, ing, past or plural.
        words: all words, inflected forms included.
        written: the words as the files write them: regular inflection also makes forms that nobody uses.
        irregular: word -> its irregular forms.
        respelled: way of writing -> the words that it may stand for.
        hesitations: first word -> phrases that are no part of a sentence.
    """

    patterns: list[PhrasePattern] = field(default_factory=list)
    by_word: dict[str, list[PhrasePattern]] = field(default_factory=dict)
    forms: dict[str, str] = field(default_factory=dict)
    words: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    irregular: dict[str, tuple[str, ...]] = field(default_factory=dict)
    respelled: dict[str, tuple[str, ...]] = field(default_factory=dict)
    hesitations: dict[str, list[PhrasePattern]] = field(default_factory=dict)
    _matches: dict[tuple[str, ...], tuple[int, LexicalEntry] | None] = field(default_factory=dict, repr=False)

    def longest_match(self, words: tuple[str, ...], start: int) -> tuple[int, LexicalEntry] | None:
        """Return the end (exclusive) and the entry of the longest phrase from `start`, None if none matches."""
        following = words[start : start + _MAX_PHRASE]
        if following not in self._matches:
            if len(self._matches) > _MAX_MATCHES:
                self._matches.clear()
            self._matches[following] = self._match(following)
        best = self._matches[following]
        return None if best is None else (start + best[0], best[1])

    def _match(self, words: tuple[str, ...]) -> tuple[int, LexicalEntry] | None:
        """Return the length and the entry of the longest phrase that begins the words, None if there is none."""
        best: tuple[int, LexicalEntry] | None = None
        for pattern in self.by_word.get(words[0], ()):
            end = pattern.match_end(words, 0)
            if end > 0 and (best is None or end >= best[0]):
                best = end, _merged(best[1], pattern.entry) if best and best[0] == end else pattern.entry
        return best

    def written_words(self, category: WordCategory) -> list[str]:
        """Return the words that are phrases of a category on their own, without inflected forms."""
        texts = (one.text.split() for one in self.patterns if one.entry.category is category)
        required = ([part for part in text if part[0] != "["] for text in texts)
        return [parts[0] for parts in required if len(parts) == 1 and parts[0].isalpha()]

    def hesitation(self, words: tuple[str, ...]) -> tuple[int, float]:
        """Return the end (exclusive) of the longest hesitation that begins the words, and its cost; 0, 0 if none."""
        found = [(one.match_end(words, 0), float(one.entry.value)) for one in self.hesitations.get(words[0], ())]
        return max(found, default=(0, 0.0))

    def add(self, line: str, entry: LexicalEntry) -> None:
        """Index the patterns of a line; a pattern is parsed when it is first matched."""
        self._matches.clear()
        for text in filter(None, map(str.strip, line.split(";"))):
            if entry.category is WordCategory.RESPELLING:
                self.respelled[text] = (*self.respelled.get(text, ()), entry.value)
                continue
            pattern = PhrasePattern(text, entry, self.inflect)
            if entry.category is WordCategory.HESITATION:
                for word in self._first_words(text, entry.category):
                    self.hesitations.setdefault(word, []).append(pattern)
                continue
            self.patterns.append(pattern)
            written = set(filter(None, re.split(r"[\[\]|_ ]+", text)))
            self.written |= written
            rest = text.split()[1:]
            for word in re.split(r"[\[\]|_]+", rest[-1]) if rest and entry.category in NOUNS else ():
                self.words.add(self.inflect(word, entry.category)[1])
            first_words = self._first_words(text, entry.category)
            for word in first_words:
                self.by_word.setdefault(word, []).append(pattern)
            self.words |= first_words | written

    def _first_words(self, text: str, category: WordCategory) -> set[str]:
        """Return all words that the phrases of a pattern may begin with."""
        words: set[str] = set()
        for part in text.split():
            for choice in part.strip("[]").split("|"):
                first, *more = choice.split("_")
                inflects = category is WordCategory.VERB or not more
                words.update(self.inflect(first, category) if inflects else (first,))
            if part[0] != "[":
                break
        return words

    def inflect(self, word: str, category: WordCategory) -> tuple[str, ...]:
        """Return the word and, for verbs and nouns, its other forms; new forms are added to `forms`."""
        if category not in INFLECTED:
            return (word,)
        forms = self.irregular.get(word) or _regular_forms(word)
        if category is not WordCategory.VERB:
            self.forms.setdefault(forms[1], "plural")
            return forms[:2]
        for form, name in zip(forms[1:], ("s", "ing", "past", "past"), strict=False):
            if form != word:
                self.forms.setdefault(form, name)
        return forms


def _merged(before: LexicalEntry, entry: LexicalEntry) -> LexicalEntry:
    """Return the later of two entries of a phrase; a verb keeps its action ("get out")."""
    if before.category is entry.category is WordCategory.VERB and "none" in (before.value, entry.value):
        value = before.value if entry.value == "none" else entry.value
        return LexicalEntry(WordCategory.VERB, value, entry.state or before.state, entry.event or before.event)
    return entry


@cache
def _regular_forms(word: str) -> tuple[str, ...]:
    """Return a word with -s, -ing and -ed; the second is also the plural of a noun."""
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
    """Return a copy of `base` (default: the package's lexicon) with the phrases of a file added.

    Raises:
        DataError: if the file cannot be read or a line is invalid; the message holds the line number.
    """
    lexicon = _copy(base or default_lexicon())
    _add_file(lexicon, Path(path), validate=True)
    return lexicon


@cache
def default_lexicon() -> Lexicon:
    """Return the package's lexicon, read once per process."""
    lexicon = Lexicon()
    _add_file(lexicon, DEFAULT_PATH)
    return lexicon


def default_phrases() -> dict[tuple[str, ...], tuple[WordCategory, str]]:
    """Return every phrase of the package's lexicon as a tuple of words, with its category and value."""
    return {
        phrase: (pattern.entry.category, pattern.entry.value)
        for pattern in default_lexicon().patterns
        for phrase in pattern.phrases()
    }


def _copy(base: Lexicon) -> Lexicon:
    by_word = {word: list(patterns) for word, patterns in base.by_word.items()}
    hesitations = {word: list(patterns) for word, patterns in base.hesitations.items()}
    return Lexicon(
        patterns=list(base.patterns),
        by_word=by_word,
        forms=dict(base.forms),
        words=set(base.words),
        written=set(base.written),
        irregular=dict(base.irregular),
        respelled=dict(base.respelled),
        hesitations=hesitations,
    )


def _add_file(lexicon: Lexicon, path: Path, validate: bool = False) -> None:
    """Add the phrases of a file; with `validate`, parse each pattern now so that errors name their line."""
    lines = read_text(path, _MAX_BYTES).splitlines()
    section: LexicalEntry | None = None
    in_forms = False
    for number, line in enumerate(lines, start=1):
        text = line.strip().casefold().replace("-", " ")
        if not text or text.startswith("#"):
            continue
        try:
            if heading := _HEADING.fullmatch(text):
                in_forms = heading[0] == "[forms]"
                section = None if in_forms else _section_entry(heading)
            elif in_forms:
                lexicon.irregular[text.split()[0]] = forms = _irregular_forms(text)
                lexicon.written.update(forms)
            elif section is None:
                raise ValueError(f"expected a section such as [noun car] first, got '{text[:60]}'")
            else:
                before = len(lexicon.patterns)
                lexicon.add(text, section)
                for pattern in lexicon.patterns[before:] if validate else ():
                    pattern.parts()
        except ValueError as error:
            raise DataError(f"{path}: line {number}: {error}") from error


def _irregular_forms(text: str) -> tuple[str, ...]:
    forms = tuple(text.split())
    if not 2 <= len(forms) <= 6 or not all(WORD.fullmatch(word) for word in forms):
        raise ValueError(f"expected a word and its forms (-s, -ing, -ed), got '{text[:60]}'")
    return forms


def _section_entry(heading: re.Match[str]) -> LexicalEntry:
    """Return the entry that the phrases of a section share."""
    if heading[1] not in _SECTIONS:
        raise ValueError(f"expected a section of one of {', '.join(_SECTIONS)}, got '{heading[0]}'")
    category, value = _SECTIONS[heading[1]], heading[2].strip()
    allowed = SECTION_VALUES.get(category)
    if allowed and value.split(" ")[0] not in allowed:
        raise ValueError(f"expected [{category.value}] to be one of {', '.join(allowed)}, got '{value}'")
    if category in _NUMERIC and not re.fullmatch(r"\d{1,6}(\.\d{1,6})?", value):
        raise ValueError(f"expected a plain number, got '{heading[0]}'")
    options = {}
    for item in filter(None, (part.strip() for part in heading[3].split("|"))):
        key, _, choice = item.partition("=")
        if choice not in {"is": _VERB_STATES, "event": TRIGGERS}.get(key, ()):
            raise ValueError(
                f"expected is=STATE ({', '.join(_VERB_STATES)}) or event=EVENT ({', '.join(TRIGGERS)}), got '{item}'"
            )
        options[key] = choice
    return LexicalEntry(category, value, options.get("is", ""), options.get("event", ""))
