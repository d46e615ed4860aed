"""Tokenizer: normalise a sentence, split it into words, and match the longest phrases of the lexicon."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass, replace

from grounding.language.syntax.lexicon import Lexicon, default_lexicon
from grounding.language.syntax.phrase_patterns import WORD, LexicalEntry
from grounding.language.syntax.spelling import correct_spelling
from grounding.language.syntax.word_categories import NOUNS, WordCategory

MAX_CHARACTERS = 2000
_NUMBER = re.compile(r"\d{1,9}(?:\.\d{1,9})?")
_MARKS = {",": WordCategory.COMMA} | dict.fromkeys(".;!?", WordCategory.BREAK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Token:
    """One word or phrase of a sentence.

    Attributes:
        category: grammatical category.
        value: meaning in the lexicon; the number of a NUMBER; metres of a UNIT.
        text: normalised text.
        corrected: the text after spelling correction.
        start: first character in the normalised sentence.
        end: one past the last character.
        form: inflection: s, ing or past for a verb, plural for a noun, own for a possessive ("the van's"); else ''.
        state: for a verb, the state that it ascribes to another vehicle.
        event: for a verb, the trigger when a command waits for another vehicle to do it.
    """

    category: WordCategory
    value: str
    text: str
    corrected: str
    start: int
    end: int
    form: str = ""
    state: str = ""
    event: str = ""

    def with_category(self, category: WordCategory, value: str = "") -> Token:
        """Return the same word with another category and value, without form, state and event."""
        return replace(self, category=category, value=value, form="", state="", event="")


def normalise(text: str) -> str:
    """Return the text in lower case (NFKC) with plain quotes, single blanks and no hyphens.

    The normalised text may be longer or shorter than the original.
    """
    folded = unicodedata.normalize("NFKC", text).casefold().replace("’", "'").replace("‘", "'").replace("`", "'")
    folded = re.sub(r"(?<=\w)[-‐‑](?=\w)", " ", re.sub(r"(?<=\d),(?=\d{3}\b)", "", folded))
    folded = re.sub(r"[–—:()/\"]|(?<=\s)-", " , ", folded)
    return " ".join("".join(c if c.isprintable() else " " for c in folded).split())


def tokenise(normalised: str, lexicon: Lexicon | None = None) -> list[Token]:
    """Return the tokens of a normalised sentence in order; end marks are BREAK, commas are COMMA."""
    lexicon = lexicon or default_lexicon()
    found = list(WORD.finditer(normalised))
    corrections = {word: correct_spelling(word, lexicon) for word in dict.fromkeys(match.group() for match in found)}
    words = tuple(corrections[match.group()] for match in found)
    tokens: list[Token] = []
    i = 0
    while i < len(words):
        end, entry = lexicon.longest_match(words, i) or (i + 1, _entry_without_match(words[i], lexicon))
        start, stop = found[i].start(), found[end - 1].end()
        token = Token(
            category=entry.category,
            value=entry.value,
            text=normalised[start:stop],
            corrected=" ".join(words[i:end]),
            start=start,
            end=stop,
            form=_form(words[i:end], entry, lexicon),
            state=entry.state,
            event=entry.event,
        )
        tokens.append(token)
        i = end
    return tokens


def _entry_without_match(word: str, lexicon: Lexicon) -> LexicalEntry:
    """Return the entry of a mark, a number, a possessive ("the van's" counts as a van) or an unknown word."""
    if word.endswith("'s") and (owner := lexicon.longest_match((word[:-2],), 0)) and owner[1].category in NOUNS:
        return owner[1]
    if word in _MARKS:
        return LexicalEntry(_MARKS[word])
    if word.endswith("n't"):
        return LexicalEntry(WordCategory.NOT)
    if _NUMBER.fullmatch(word):
        return LexicalEntry(WordCategory.NUMBER, word)
    return LexicalEntry(WordCategory.POSSESSIVE if word.endswith("'s") else WordCategory.UNKNOWN)


def _form(words: tuple[str, ...], entry: LexicalEntry, lexicon: Lexicon) -> str:
    if entry.category is WordCategory.VERB:
        form = lexicon.forms.get(words[0], "")
        return form if form != "plural" else "s"
    if words[-1].endswith("'s"):
        return "own"
    return "plural" if lexicon.forms.get(words[-1]) in ("plural", "s") else ""
