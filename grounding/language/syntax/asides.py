"""Asides: words that are no part of a command, with the cost (nats) of leaving them out.

Hesitations ("um", "you know"), repeated words, and forms of address at the edges of a clause ("okay appo", "thanks
mate").
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.word_categories import DETERMINERS, MODIFIERS, WordCategory
from grounding.language.syntax.word_model import WordModel, common_words

# Costs of leaving out a sound and a repeated word.
_SOUND_COST, _REPEATED = 0.5, 6.0
# Costs of leaving out a form of address: alone, beside a mark or a filler, after a greeting.
_ADDRESS, _MARKED_ADDRESS, _GREETED_ADDRESS = 5.0, 2.0, 0.0
# Extra cost of a common English word that nothing sets apart from the command.
_COMMON_ADDRESS = 6.0
_MAX_ADDRESS, _MAX_HESITATION, _MAX_REPEATED = 3, 5, 2
# "Um", "errr", "mmm", "ugh", "pfft": sounds that speakers draw out.
_SOUND = re.compile(
    r"u+[hm]+|u+g+h+|e+r+m*|e+h+[mr]*|m+h*m+|h+m+(?:p+h+)?|a+h+m*|a+w+|a+r+g+h*|o+h+|oo+h*|p+f+t*|t+s+k+|p+s+t+"
    r"|s+h+e+s+h+|g+r+r+|e+k+|whoo+ps|y+ikes"
)
_MARKS = frozenset(",.;!?")
# Categories that need a complement: a name after them is no form of address.
_NEED_MORE = (
    DETERMINERS
    | MODIFIERS
    | {
        WordCategory.RELATION,
        WordCategory.TO,
        WordCategory.OF,
        WordCategory.BETWEEN,
        WordCategory.AND,
        WordCategory.OR,
        WordCategory.THAT,
        WordCategory.NUMBER,
    }
)
# Categories that begin a command after a form of address without a comma.
_AFTER_ADDRESS = frozenset(
    (
        WordCategory.VERB,
        WordCategory.AUX,
        WordCategory.EGO,
        WordCategory.NOT,
        WordCategory.EXISTS,
        WordCategory.SUB,
        WordCategory.QUESTION,
        WordCategory.FILLER,
        WordCategory.GREETING,
        WordCategory.NONDRIVE,
    )
)
_COPULAS = (WordCategory.BE, WordCategory.QUESTION)
# Possessives that no form of address begins with.
_THEIRS = ("your", "his", "her", "its", "their", "the")
_BEFORE_NAME = frozenset((WordCategory.POSSESSIVE, WordCategory.UNKNOWN, WordCategory.EXTRA))


class Asides:
    """Find asides with the words of a lexicon."""

    def __init__(self, lexicon: Lexicon, model: WordModel) -> None:
        """Keep the lexicon and the model, which knows how common a name is."""
        self._lexicon, self._model = lexicon, model

    def at(self, written: Sequence[str], i: int) -> Iterator[tuple[int, float]]:
        """Yield end (exclusive) and cost of each aside that begins at a word; the commas around it belong to it."""
        end, cost = self._hesitation(written, i)
        if end > i:
            yield end, cost
            if end < len(written) and written[end] == ",":
                yield end + 1, cost
        if written[i] == "," and i + 1 < len(written) and self._hesitation(written, i + 1)[0] > i + 1:
            yield i + 1, 0.0
        for length in range(1, _MAX_REPEATED + 1):
            if written[i] not in _MARKS and i >= length and written[i : i + length] == written[i - length : i]:
                yield i + length, _REPEATED
        yield from self._addresses(written, i)

    def _hesitation(self, written: Sequence[str], i: int) -> tuple[int, float]:
        """Return the end of a hesitation and the cost of leaving it out; the end is `i` if there is none."""
        if _SOUND.fullmatch(written[i]):
            return i + 1, _SOUND_COST
        length, cost = self._lexicon.hesitation(tuple(written[i : i + _MAX_HESITATION]))
        return i + length, cost

    def _addresses(self, written: Sequence[str], i: int) -> Iterator[tuple[int, float]]:
        """Yield forms of address at the start and the end of a clause."""
        before = self._category(written, i - 1)
        absent = before is WordCategory.NOT and self._category(written, i - 2) in _COPULAS
        if before in _NEED_MORE or absent:  # "where there are no people"
            return
        after_comma = before is WordCategory.COMMA
        greeted = (self._category(written, i - 2) if after_comma else before) is WordCategory.GREETING
        after_mark = before in (WordCategory.COMMA, WordCategory.BREAK)
        for end in range(i + 1, min(i + _MAX_ADDRESS, len(written)) + 1):
            if not written[end - 1].isalnum() or end - i == len(written):
                return
            after = self._category(written, end)
            before_mark = after in (WordCategory.COMMA, WordCategory.BREAK)
            beside_filler = WordCategory.FILLER in (before, after)
            alone = (after_mark and not after_comma) or beside_filler
            if not (before_mark or greeted or (alone and not after_comma and after in _AFTER_ADDRESS)):
                continue
            starts = i == 0 or greeted
            cost = self._name_cost(written[i:end], starts, greeted or (i == 0 and before_mark))
            if cost is None:
                continue
            marked = beside_filler or (after_mark and (before_mark or i > 0))
            cost += _GREETED_ADDRESS if greeted else _MARKED_ADDRESS if marked else _ADDRESS
            person = self._category(written, end - 1) is WordCategory.PERSON
            if not (greeted or marked or i == 0 or person) and written[end - 1] in common_words():
                cost += _COMMON_ADDRESS  # "stay healthy"
            yield end, cost
            if (after_mark or greeted) and after is WordCategory.COMMA:
                yield end + 1, cost

    def _name_cost(self, words: Sequence[str], starts: bool, vehicle: bool) -> float | None:
        """Return the cost of words as a form of address, with `vehicle` also to a vehicle; None if they are none."""
        *others, name = (self._category(words, i) for i in range(len(words)))
        vehicle = vehicle or (starts and set(others) == {WordCategory.UNKNOWN})  # "appo car, ..."
        part = name is WordCategory.UNKNOWN and words[-1] in self._lexicon.written  # "thank you so much"
        if part or words[-1] in self._lexicon.respelled or words[0] in _THEIRS:  # "u turn", "follow your dreams"
            return None
        fits = name in (WordCategory.UNKNOWN, WordCategory.PERSON) or (vehicle and name is WordCategory.NOUN)
        fits = fits or (vehicle and name is WordCategory.NUMBER and set(others) == {WordCategory.UNKNOWN})  # "unit 4"
        if not fits or not set(others) <= _BEFORE_NAME or self._lexicon.forms.get(words[-1]) in ("plural", "s"):
            return None
        return sum(self._model.emission(word) for word in words)

    def _category(self, written: Sequence[str], i: int) -> WordCategory:
        """Return the category of a written word; beyond the ends and for end marks BREAK."""
        if not 0 <= i < len(written) or written[i] in ".;!?":
            return WordCategory.BREAK
        if written[i] == ",":
            return WordCategory.COMMA
        match = self._lexicon.longest_match((written[i],), 0)
        return match[1].category if match else WordCategory.UNKNOWN
