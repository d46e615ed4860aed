"""Tokenizer: normalise a sentence, decode its words, and match the longest phrases of the lexicon."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from grounding.language.syntax.decoder import Decoded, decoder_of
from grounding.language.syntax.lexicon import Lexicon, default_lexicon
from grounding.language.syntax.phrase_patterns import WORD, LexicalEntry
from grounding.language.syntax.word_categories import NOUNS, WordCategory

MAX_CHARACTERS = 2000
_NUMBER = re.compile(r"\d{1,9}(?:\.\d{1,9})?")
# Signs of text messages, and words without their last letters.
_SIGN_WORDS = {"@": "at", "w/o": "without", "b/w": "between", "w/": "with", "an'": "and", "o'": "of", "wi'": "with"}
_SIGNS = re.compile(r"@|\b(?:w/o|b/w|w/|an'|o'|wi')(?!\w)")
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d{1,2} ?(?:m|met(?:er|re)s?|feet|foot|ft|yards?|km)\b)")
# "km/h" and "miles an hour" are one word; "30kmh" is taken apart later.
_SPEED_UNIT = re.compile(r"(?<![a-z])(?:(?:kms?|kilomet(?:er|re)s?|miles?) ?(?:/|an?|per) ?h(?:ou)?r?|km/?h|kph)\b")
_WILL = re.compile(r"\b(he|she|it|they)'ll\b")
# A side, and "exactly" before a relation; relations that name a place at a vehicle, and no place to turn.
_INTENSIFIER = "right"
_AT_VEHICLE = ("behind", "in_front_of", "next_to", "near", "opposite")
_MARKS = {",": WordCategory.COMMA} | dict.fromkeys(".;!?", WordCategory.BREAK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Token:
    """One word or phrase of a sentence.

    Attributes:
        category: grammatical category.
        value: meaning in the lexicon; the number of a NUMBER; metres of a UNIT.
        text: the corrected words, without fillers: "in front of".
        written: the words as written: "in um front of".
        start: first character in the normalised sentence.
        end: one past the last character.
        form: inflection: s, ing or past (verb), plural (noun), own (possessive), or ''.
        state: state of a vehicle that does this: "parked"; '' for none.
        event: event of a vehicle that does this: "leave"; '' for none.
    """

    category: WordCategory
    value: str
    text: str
    written: str
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
    folded = _WILL.sub(r"\1 will", folded)
    folded = _SIGNS.sub(lambda found: f" {_SIGN_WORDS[found.group()]} ", folded)
    folded = _DECIMAL_COMMA.sub(".", re.sub(r"(?<=\d),(?=\d{3}\b)", "", folded))
    folded = re.sub(r"(?<!\S)[-−](?=\d)", "minus ", folded)
    folded = re.sub(r"(?<=\w)[-‐‑](?=\w)", " ", folded)
    folded = _SPEED_UNIT.sub(lambda found: "mph" if found.group()[:2] == "mi" else "kmph", folded)
    folded = re.sub(r"[–—:()/\"]|(?<=\s)-", " , ", folded)
    return " ".join("".join(c if c.isprintable() else " " for c in folded).split())


@dataclass(frozen=True)
class Tokenised:
    """One way to read the words of a sentence.

    Attributes:
        tokens: in order; end marks are BREAK, commas are COMMA, words left out are FILLER.
        corrections: words as written and as read, where they differ.
        cost: minus the log probability, up to a constant.
    """

    tokens: tuple[Token, ...]
    corrections: tuple[tuple[str, str], ...]
    cost: float


def tokenise(normalised: str, lexicon: Lexicon | None = None) -> tuple[Token, ...]:
    """Return the tokens of the likeliest way to read a normalised sentence."""
    return tokenise_all(normalised, lexicon, most=1)[0].tokens


def tokenise_all(normalised: str, lexicon: Lexicon | None = None, most: int = 6) -> list[Tokenised]:
    """Return the likeliest ways to read a normalised sentence, best first, at least one and at most `most`."""
    lexicon = lexicon or default_lexicon()
    found = list(WORD.finditer(normalised))
    decoded = decoder_of(lexicon).decode(tuple(match.group() for match in found), most)
    return [
        Tokenised(_match_phrases(one, normalised, found, lexicon), _corrections(one, normalised, found), one.cost)
        for one in decoded
    ]


def _match_phrases(
    decoded: Decoded, normalised: str, found: Sequence[re.Match[str]], lexicon: Lexicon
) -> tuple[Token, ...]:
    words, i, used = decoded.words, 0, 0
    tokens: list[Token] = []
    while i < len(words):
        end, entry = lexicon.longest_match(words, i) or (i + 1, _entry_without_match(words[i], lexicon))
        end, entry = _without_intensifier(words, i, lexicon) or (end, entry)
        counted = bool(tokens) and tokens[-1].category is WordCategory.ORDINAL
        if counted and entry.category is WordCategory.GREETING:  # "next right then first left"
            end, entry = lexicon.longest_match(words[: i + 1], i) or (end, entry)
        first, last = decoded.spans[i][0], decoded.spans[end - 1][1]
        tokens += _left_out(normalised, found[used:first])
        start, stop = found[first].start(), found[last - 1].end()
        token = Token(
            category=entry.category,
            value=entry.value,
            text=" ".join(words[i:end]),
            written=normalised[start:stop],
            start=start,
            end=stop,
            form=_form(words[i:end], entry, lexicon),
            state=entry.state,
            event=entry.event,
        )
        tokens.append(token)
        i, used = end, last
    return (*tokens, *_left_out(normalised, found[used:]))


def _without_intensifier(words: tuple[str, ...], start: int, lexicon: Lexicon) -> tuple[int, LexicalEntry] | None:
    """Return the match of a verb without its last word, if that belongs to what follows: "go right behind the van".

    None for a verb that turns without that word, too, and before places at which we can turn: "go right after it".
    """
    longest = lexicon.longest_match(words, start)
    if longest is None or longest[1].category is not WordCategory.VERB or words[longest[0] - 1] != _INTENSIFIER:
        return None
    last = longest[0] - 1
    relation = lexicon.longest_match(words, last)
    if relation is None or relation[0] == last + 1 or not _is_at_vehicle(relation[1]):
        return None
    shorter = lexicon.longest_match(words[:last], start)
    turns = shorter is None or shorter[0] != last or shorter[1].value.startswith("turn")
    return None if turns else shorter


def _is_at_vehicle(entry: LexicalEntry) -> bool:
    return entry.category is WordCategory.BETWEEN or entry.value in _AT_VEHICLE


def _left_out(normalised: str, found: Sequence[re.Match[str]]) -> list[Token]:
    """Return the tokens of words that are no part of the command."""
    return [
        Token(
            category=WordCategory.FILLER,
            value="",
            text=match.group(),
            written=match.group(),
            start=match.start(),
            end=match.end(),
        )
        for match in found
    ]


def _corrections(decoded: Decoded, normalised: str, found: Sequence[re.Match[str]]) -> tuple[tuple[str, str], ...]:
    """Return (written, read) of all words that differ by more than an apostrophe."""
    corrections = []
    for (first, last), pairs in groupby(zip(decoded.spans, decoded.words, strict=True), key=lambda pair: pair[0]):
        written = normalised[found[first].start() : found[last - 1].end()]
        words = " ".join(word for _, word in pairs)
        if words.replace("'", "") != written.replace("'", ""):
            corrections.append((written, words))
    return tuple(corrections)


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
