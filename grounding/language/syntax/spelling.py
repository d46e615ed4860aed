"""Spelling: the words that a written word may stand for, each with a cost (nats)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import cache

from rapidfuzz.distance import OSA
from rapidfuzz.process import extract, extractOne

from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.word_model import common_words, homophones

# Costs: of one wrong letter, a homophone, another way to write a word, a missing apostrophe, a missing and an extra
# blank.
EDIT, HOMOPHONE, RESPELLED, APOSTROPHE, MISSING_BLANK, EXTRA_BLANK = 7.0, 5.0, 3.0, 1.5, 10.0, 3.0
# Extra costs of a correction of a word of the lexicon, and of another English word.
KNOWN_WORD, REAL_WORD = 4.0, 8.0
# How much likelier a swap of letters and a neighbouring key are than other edits.
LIKELY = 1.0
_KEYS = ("qwertyuiop", "asdfghjkl", "zxcvbnm")
# Longer words are not corrected, and words of this length may hold two wrong letters.
_MAX_LENGTH, _TWO_EDITS_LENGTH = 30, 6
_MAX_COMMON, _MIN_JOINED = 3, 5
# Most words, and pairs of words, whose candidates are kept for the next text.
_MAX_KEPT = 20_000


class SpellingCandidates:
    """Candidates for written words: words of the lexicon, and common words, at a small edit distance.

    Distances count insertions, deletions, replacements and swaps of neighbouring letters (optimal string alignment).
    """

    def __init__(self, lexicon: Lexicon) -> None:
        """Index the words of a lexicon and the common words by length."""
        inflected = {word for word in lexicon.words if word in common_words()}
        self._known = lexicon.words | common_words().keys()
        self._written = lexicon.written
        self._targets = _by_length(word for word in lexicon.written | inflected if word.replace("'", "").isalpha())
        self._common = _by_length(word for word in common_words() if word not in lexicon.words)
        self._lexicon = lexicon
        self._bare: dict[str, list[str]] = defaultdict(list)
        for word in lexicon.words:
            if "'" in word:
                self._bare[word.replace("'", "")].append(word)
        self._memo: dict[str, dict[tuple[str, ...], float]] = {}
        self._pairs: dict[tuple[str, str], dict[tuple[str, ...], float]] = {}

    @property
    def words(self) -> set[str]:
        """The words of the lexicon."""
        return self._lexicon.words

    def of(self, word: str) -> Mapping[tuple[str, ...], float]:
        """Return the words that one written word may stand for, itself included, with their costs."""
        if word not in self._memo:
            if len(self._memo) > _MAX_KEPT:
                self._memo.clear()
            self._memo[word] = self._candidates(word)
        return self._memo[word]

    def of_pair(self, first: str, second: str) -> Mapping[tuple[str, ...], float]:
        """Return the single words that two written words may stand for: "bee hind"."""
        if (first, second) not in self._pairs:
            if len(self._pairs) > _MAX_KEPT:
                self._pairs.clear()
            self._pairs[first, second] = self._pair_candidates(first, second)
        return self._pairs[first, second]

    def _pair_candidates(self, first: str, second: str) -> dict[tuple[str, ...], float]:
        joined = first + second
        if not joined.isalpha() or not _MIN_JOINED <= len(joined) <= _MAX_LENGTH:
            return {}
        exact: dict[tuple[str, ...], float] = {(joined,): EXTRA_BLANK} if joined in self._written else {}
        # Of two words of which one is right already, the other is a word of its own.
        near = [word for word in _nearest(joined, self._targets, 1) if word not in (first, second)]
        return exact | {(word,): EXTRA_BLANK + EDIT + KNOWN_WORD for word in near}

    def _same_meaning(self, word: str, other: str) -> bool:
        """Return whether two words have the same entry: "grey" and "gray"."""
        forms = self._lexicon.forms
        entries = [self._lexicon.longest_match((one,), 0) for one in (word, other)]
        return entries[0] is not None and entries[0] == entries[1] and forms.get(word) == forms.get(other)

    def _candidates(self, word: str) -> dict[tuple[str, ...], float]:
        found: dict[tuple[str, ...], float] = {(word,): 0.0}

        def offer(words: tuple[str, ...], cost: float) -> None:
            found[words] = min(cost, found.get(words, cost))

        for meant in self._lexicon.respelled.get(word, ()):
            offer(tuple(meant.split()), RESPELLED)
        for meant in homophones().get(word, ()):
            if not self._same_meaning(word, meant):
                offer((meant,), HOMOPHONE)
        for meant in self._bare.get(word, ()):
            offer((meant,), APOSTROPHE)
        if word.startswith("'"):  # "'old it": a dropped h, or a quotation mark
            bare, voiced = word[1:], f"h{word[1:]}"
            offer((bare,), APOSTROPHE)
            offer((voiced,), 0.0 if voiced in self._known else RESPELLED + EDIT)
        if not word.replace("'", "").isalpha() or not 2 <= len(word) <= _MAX_LENGTH:
            return found
        real = word in self._known
        extra = KNOWN_WORD if word in self._lexicon.words else REAL_WORD if real else 0.0
        edits = 2 if len(word) >= _TWO_EDITS_LENGTH and not real else 1
        for meant, count in _nearest(word, self._targets, edits).items():
            if not self._same_meaning(word, meant):
                offer((meant,), count * EDIT + extra - LIKELY * _is_likely(word, meant))
        if not real:
            ranked = sorted(_nearest(word, self._common, 1), key=lambda one: common_words()[one])
            for meant in ranked[:_MAX_COMMON]:
                offer((meant,), EDIT)
            for i in range(1, len(word)):
                if len(word[:i]) > 1 and len(word[i:]) > 1 and {word[:i], word[i:]} <= self._known:
                    offer((word[:i], word[i:]), MISSING_BLANK)
        return found


def _by_length(words: Iterable[str]) -> dict[int, list[str]]:
    found: dict[int, list[str]] = defaultdict(list)
    for word in sorted(words):
        found[len(word)].append(word)
    return found


def _is_likely(word: str, meant: str) -> bool:
    """Return whether two letters are swapped, or one is a neighbour of the right one on the keyboard."""
    if len(word) != len(meant):
        return False
    wrong = [pair for pair in zip(word, meant, strict=True) if pair[0] != pair[1]]
    return sorted(word) == sorted(meant) or (len(wrong) == 1 and wrong[0][1] in _neighbour_keys(wrong[0][0]))


@cache
def _neighbour_keys(letter: str) -> str:
    places = {key: (row, column) for row, keys in enumerate(_KEYS) for column, key in enumerate(keys)}
    row, column = places.get(letter, (9, 9))
    near = ((0, -1), (0, 1), (-1, 0), (-1, 1), (1, -1), (1, 0))
    return "".join(key for key, (r, c) in places.items() if (r - row, c - column) in near)


def _nearest(word: str, choices: Mapping[int, list[str]], edits: int) -> dict[str, int]:
    """Return the choices at most some edits away, with their distance."""
    return {
        found: int(distance)
        for length in range(len(word) - edits, len(word) + edits + 1)
        for found, distance, _ in extract(
            word, choices.get(length, ()), scorer=OSA.distance, score_cutoff=edits, limit=None
        )
        if distance
    }


def suggest_word(word: str, choices: Iterable[str]) -> str | None:
    """Return the most similar of some words, None if none is similar."""
    found = extractOne(word[:_MAX_LENGTH], list(choices), scorer=OSA.normalized_similarity, score_cutoff=0.55)
    return str(found[0]) if found else None
