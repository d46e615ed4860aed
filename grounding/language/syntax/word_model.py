"""Word model: how likely a word is after another in a command (bigrams with a back-off to classes of words)."""

from __future__ import annotations

import math
from collections import defaultdict
from functools import cache
from itertools import pairwise
from pathlib import Path

from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.word_categories import NOUNS, WordCategory

BOUNDARY, UNKNOWN, NUMBER = ".", "*", "0"
_FOLDER = Path(__file__).parent / "data"
# Categories with phrases of several words in a fixed order.
_FIXED = NOUNS | {
    WordCategory.MAKE,
    WordCategory.MODEL,
    WordCategory.VERB,
    WordCategory.RELATION,
    WordCategory.FILLER,
}
# Weight of a word that no command of the table contains, in counts.
_UNSEEN = 0.4
# A word that is in no table: the cost of being one, and of each letter (nats).
_STRANGE, _LETTER, _MAX_LETTERS = 6.0, 1.2, 30
# Share of the probability that does not depend on the word before.
_FLOOR = 0.02


def symbol(word: str) -> str:
    """Return the word as the model counts it: numbers are one symbol, end marks another."""
    if word in ".;!?":
        return BOUNDARY
    return NUMBER if word[0].isdigit() else word


@cache
def common_words() -> dict[str, int]:
    """Return common English words with their rank by frequency, from 0."""
    return {word: rank for rank, word in enumerate((_FOLDER / "words.txt").read_text(encoding="utf-8").split())}


@cache
def homophones() -> dict[str, tuple[str, ...]]:
    """Return word -> words of the lexicon that sound the same."""
    found: dict[str, list[str]] = defaultdict(list)
    for line in (_FOLDER / "homophones.txt").read_text(encoding="utf-8").splitlines():
        meant, *written = line.split()
        for word in written:
            found[word].append(meant)
    return {word: tuple(meant) for word, meant in found.items()}


@cache
def _successions() -> dict[str, dict[str, int]]:
    found: dict[str, dict[str, int]] = {}
    for line in (_FOLDER / "successions.txt").read_text(encoding="utf-8").splitlines():
        word, *pairs = line.split()
        found[word] = {other: int(count) for other, _, count in (pair.rpartition(":") for pair in pairs)}
    return found


class WordModel:
    """Costs of words in context.

    Interpolated bigrams (Witten-Bell discounting), backed off to bigrams of word classes: the lexicon's categories.
    """

    def __init__(self, lexicon: Lexicon) -> None:
        """Estimate the model from the package's table of successions and the classes of a lexicon."""
        counted = _successions()
        self._follow = _with_phrases(counted, lexicon)
        self._totals = {word: sum(counts.values()) for word, counts in self._follow.items()}
        self._classes = {word: _word_class(word, lexicon) for word in lexicon.words}
        self._class_sizes: dict[str, float] = defaultdict(float)
        self._counts: dict[str, float] = defaultdict(float)
        pairs: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        for word, counts in counted.items():
            for other, count in counts.items():
                self._counts[other] += count
                pairs[self.word_class(word)][self.word_class(other)] += count
        for word, name in self._classes.items():
            self._class_sizes[name] += self._counts[word] + _UNSEEN
        everything = sum(self._counts.values())
        class_counts: dict[str, float] = defaultdict(float)
        for counts_of_class in pairs.values():
            for name, total in counts_of_class.items():
                class_counts[name] += total
        self._class_share = {name: total / everything for name, total in class_counts.items()}
        self._pairs = {name: dict(counts) for name, counts in pairs.items()}
        self._pair_totals = {name: sum(counts.values()) for name, counts in pairs.items()}
        self._smallest_share = 0.5 / everything
        self._memo: dict[tuple[str, str], float] = {}

    def word_class(self, word: str) -> str:
        """Return the class of a word: a category of the lexicon, or the word itself."""
        return self._classes.get(word) or (word if not word.isalpha() else UNKNOWN)

    def cost(self, before: str, word: str) -> float:
        """Return minus the log probability of a word after another, both as symbols."""
        key = before, word
        if key not in self._memo:
            if len(self._memo) > 200_000:
                self._memo.clear()
            self._memo[key] = self._cost(before, word)
        return self._memo[key]

    def emission(self, word: str) -> float:
        """Return minus the log probability of a word within its class."""
        return -math.log(self._of_class(word, self.word_class(word)))

    def _cost(self, before: str, word: str) -> float:
        known = before if before in self._follow else UNKNOWN
        counts, total = self._follow.get(known, {}), self._totals.get(known, 0)
        kept = total / (total + len(counts)) if total else 0.0
        seen = counts.get(word, 0) / total if total else 0.0
        return -math.log(kept * seen + (1 - kept) * self._backed_off(before, word))

    def _backed_off(self, before: str, word: str) -> float:
        """Return the probability of a word by its class and the class before."""
        one, other = self.word_class(before), self.word_class(word)
        share = self._class_share.get(other, self._smallest_share)
        total = self._pair_totals.get(one, 0.0)
        pairs = self._pairs.get(one, {})
        kept = total / (total + len(pairs)) if total else 0.0
        ratio = kept * pairs.get(other, 0.0) / total if total else 0.0
        return ((1 - _FLOOR) * (ratio + (1 - kept) * share) + _FLOOR * share) * self._of_class(word, other)

    def _of_class(self, word: str, name: str) -> float:
        """Return the probability of a word within its class."""
        if name == UNKNOWN:
            rank = common_words().get(word)
            if rank is None:
                return math.exp(-_STRANGE - _LETTER * min(len(word), _MAX_LETTERS))
            return 0.1 / (rank + 100)  # Zipf: the sum over 20,000 ranks is about 0.5
        if word not in self._classes:
            return 1.0
        return (self._counts[word] + _UNSEEN) / self._class_sizes[name]


def _with_phrases(follow: dict[str, dict[str, int]], lexicon: Lexicon) -> dict[str, dict[str, int]]:
    """Return successions with those inside names and verbs: "land rover" is no misspelt "land over"."""
    found = dict(follow)
    for pattern in lexicon.patterns:
        if pattern.entry.category in _FIXED and " " in pattern.text:
            parts = [part.strip("[]").replace("_", "|").split("|") for part in pattern.text.split()]
            for before, after in pairwise(parts):
                for word in before:
                    found[word] = dict.fromkeys(after, 1) | found.get(word, {})
    return found


def _word_class(word: str, lexicon: Lexicon) -> str:
    """Return the category and the form of a word."""
    match, begun = lexicon.longest_match((word,), 0), lexicon.by_word.get(word)
    if match is None and not begun:
        return word  # only inside phrases
    category = match[1].category if match else begun[0].entry.category if begun else ""
    return f"{category} {lexicon.forms.get(word, '')}"
