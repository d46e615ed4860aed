"""Features of words: what the reader network sees of the tokens of a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, get_args
from zlib import crc32

from grounding.language.reader.word_classes import classes_of
from grounding.language.syntax.tagging.tagger import tag
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory
from grounding.query_schema import Noun

# Rows of the table of feature vectors; row 0 is no feature, from the second number on words and parts of words.
TABLE_ROWS, WORD_ROWS = 8192, 2048
# Words whose identity is no feature: what holds for a red car holds for a blue one.
_WITHOUT_WORDS = (WordCategory.COLOUR, WordCategory.MAKE, WordCategory.MODEL, WordCategory.NUMBER)
_NUMERIC = (WordCategory.COLOUR, WordCategory.NUMBER, WordCategory.UNIT, WordCategory.DISTANCE)
_GRAM = 3
_OF_WORDS = ("w:", "g:")
_CLASSES = get_args(Noun)


class WordFacts(NamedTuple):
    """What the lexicon tells of a token for certain.

    Attributes:
        text: its words.
        noun: class of vehicle that it names, '' for none or an unknown one.
        colour: colour that it names, with the shade before it, '' for none.
    """

    text: str
    noun: str = ""
    colour: str = ""


def word_facts(tokens: Sequence[Token]) -> list[WordFacts]:
    """Return the facts of each token."""
    return [WordFacts(token.text, _noun(token), _colour(tokens, i)) for i, token in enumerate(tokens)]


def _noun(token: Token) -> str:
    if token.category in (WordCategory.NOUN, WordCategory.MODEL):
        return token.value if token.value in _CLASSES else ""
    return {WordCategory.PERSON: "person", WordCategory.MAKE: "car"}.get(token.category, "")


def _colour(tokens: Sequence[Token], i: int) -> str:
    """Return the colour of a token: "dark blue" at "blue", "dark" where no colour follows."""
    token = tokens[i]
    if token.category is WordCategory.COLOUR:
        shaded = i > 0 and tokens[i - 1].category is WordCategory.SHADE
        return f"{tokens[i - 1].value} {token.value}" if shaded else token.value
    if token.category is WordCategory.SHADE:
        followed = i + 1 < len(tokens) and tokens[i + 1].category is WordCategory.COLOUR
        return "" if followed else token.value
    return ""


def token_features(tokens: Sequence[Token]) -> list[list[int]]:
    """Return the rows of the feature table of each token.

    Args:
        tokens: tokens of a sentence, not yet tagged.

    Returns:
        One list for each token, without duplicates, in order.
    """
    tagged = {token.start: token for token in tag(tokens)}
    return [[*dict.fromkeys(map(feature_row, _names(token, tagged.get(token.start))))] for token in tokens]


def _names(token: Token, tagged: Token | None) -> Iterator[str]:
    """Yield the names of the features of a token and of what the tagger makes of it."""
    yield f"c:{token.category.value}"
    yield f"t:{tagged.category.value}" if tagged else "t:"
    for one in (token, tagged):
        if one and one.value and one.category not in _NUMERIC:
            yield f"v:{one.category.value}:{one.value}"
    if token.form:
        yield f"f:{token.form}"
    if token.state:
        yield f"s:{token.state}"
    if token.event:
        yield f"e:{token.event}"
    if token.category in _WITHOUT_WORDS:
        return
    for word in token.text.split():
        yield f"w:{word}"
        yield from (f"k:{one}" for one in classes_of(word))
    if token.category is not WordCategory.NOUN:
        for word in token.written.split():
            marked = f"<{word}>"
            yield from (f"g:{marked[i : i + _GRAM]}" for i in range(max(1, len(marked) - _GRAM + 1)))


def feature_row(name: str) -> int:
    """Return the row of a feature in the table, by its name."""
    first, last = (WORD_ROWS, TABLE_ROWS) if name.startswith(_OF_WORDS) else (1, WORD_ROWS)
    return first + crc32(name.encode()) % (last - first)
