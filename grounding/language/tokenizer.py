"""Sentence -> typed tokens: normalise, split into words, longest match in the lexicon, repair of small slips."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, replace

from grounding.language.lexicon import Lexicon, default_lexicon
from grounding.language.word_categories import NOUNS, WORD, Entry, Kind

MAX_CHARACTERS = 2000
_NUMBER = re.compile(r"\d{1,9}(?:\.\d{1,9})?")
# Only longer words are repaired: among short ones every slip is another word (car, cat; van, can). No word is longer
# than the last, and trying all its slips takes time that grows with the square of its length.
_REPAIRED_FROM, _REPAIRED_TO = 5, 30
_MARKS = {",": Kind.COMMA} | dict.fromkeys(".;!?", Kind.BREAK)


@dataclass(frozen=True, slots=True)
class Token:
    """One word or phrase of a sentence.

    Attributes:
        kind: what it is to the grammar.
        value: its meaning in the lexicon's words; the number of a NUMBER; metres of a UNIT.
        text: as written (normalised).
        meant: the same with slips of spelling mended.
        start: first character in the normalised sentence.
        end: one past the last.
        form: of a verb s, ing or past, of a noun plural, of words whose owner is named own ("the van's"); '' else.
        state: of a verb what it says of another vehicle.
        event: of a verb what it is when it is awaited of another vehicle.
    """

    kind: Kind
    value: str
    text: str
    meant: str
    start: int
    end: int
    form: str = ""
    state: str = ""
    event: str = ""

    def of_kind(self, kind: Kind, value: str = "") -> Token:
        """The same word as something else."""
        return replace(self, kind=kind, value=value, form="", state="", event="")


def normalise(text: str) -> str:
    """Lower case, plain quotes and blanks, no hyphens; characters keep their meaning, not their number."""
    folded = unicodedata.normalize("NFKC", text).casefold().replace("’", "'").replace("‘", "'").replace("`", "'")
    folded = re.sub(r"(?<=\w)[-‐‑](?=\w)", " ", re.sub(r"(?<=\d),(?=\d{3}\b)", "", folded))
    folded = re.sub(r"[–—:()/\"]|(?<=\s)-", " , ", folded)
    return " ".join("".join(c if c.isprintable() else " " for c in folded).split())


def tokenise(normalised: str, lexicon: Lexicon | None = None) -> list[Token]:
    """Typed tokens of a normalised sentence in order; marks that end a clause are BREAK, commas COMMA."""
    lexicon = lexicon or default_lexicon()
    found = list(WORD.finditer(normalised))
    mended = {word: _repaired(word, lexicon) for word in dict.fromkeys(match.group() for match in found)}
    words = tuple(mended[match.group()] for match in found)
    tokens: list[Token] = []
    i = 0
    while i < len(words):
        end, entry = lexicon.longest(words, i) or (i + 1, _plain(words[i], lexicon))
        start, stop = found[i].start(), found[end - 1].end()
        form = _form(words[i:end], entry, lexicon)
        said = normalised[start:stop], " ".join(words[i:end]), start, stop
        tokens.append(Token(entry.kind, entry.value, *said, form, entry.state, entry.event))
        i = end
    return tokens


def _plain(word: str, lexicon: Lexicon) -> Entry:
    """What a word is that the lexicon does not know; "the van's" is a van."""
    if word.endswith("'s") and (owner := lexicon.longest((word[:-2],), 0)) and owner[1].kind in NOUNS:
        return owner[1]
    if word in _MARKS:
        return Entry(_MARKS[word])
    if _NUMBER.fullmatch(word):
        return Entry(Kind.NUMBER, word)
    return Entry(Kind.POSSESSIVE) if word.endswith("'s") else Entry(Kind.UNKNOWN)


def _form(words: tuple[str, ...], entry: Entry, lexicon: Lexicon) -> str:
    if entry.kind is Kind.VERB:
        form = lexicon.forms.get(words[0], "")
        return form if form != "plural" else "s"
    if words[-1].endswith("'s"):
        return "own"
    return "plural" if lexicon.forms.get(words[-1]) in ("plural", "s") else ""


def _repaired(word: str, lexicon: Lexicon) -> str:
    """The word itself, or the best word with a meaning one slip away from a longer word that is not known."""
    plain = word.isascii() and word.isalpha() and _REPAIRED_FROM <= len(word) <= _REPAIRED_TO
    if word in lexicon.words or not plain:
        return word
    found = {slip for slip in _slips(word) if len(slip) >= _REPAIRED_FROM - 1 and _likely(word, slip, lexicon)}
    stems = {slip.removesuffix("s") for slip in found}
    return min(found, key=lambda slip: (abs(len(slip) - len(word)), slip)) if len(stems) == 1 else word


def _likely(word: str, slip: str, lexicon: Lexicon) -> bool:
    """Whether a known word may be meant: first letters are seldom wrong, and short words have many neighbours."""
    often = lexicon.words.get(slip, 0)
    swapped = sorted(word) == sorted(slip)
    same_length = len(word) == len(slip) and not swapped
    return (
        often > 0
        and (swapped or word[0] == slip[0])
        and (often == 2 or not same_length or len(word) > _REPAIRED_FROM)
    )


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


def did_you_mean(word: str, kinds: tuple[Kind, ...], lexicon: Lexicon | None = None) -> str | None:
    """The nearest single word of some kinds, None where nothing resembles it."""
    patterns = (lexicon or default_lexicon()).patterns
    choices = [one.text for one in patterns if one.entry.kind in kinds and one.text.isalpha()]
    found = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return found[0] if found else None
