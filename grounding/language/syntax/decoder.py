"""Decoder: the likeliest sequences of words that a written sentence stands for (noisy channel, beam search).

A written word may be misspelt, a homophone, joined with its neighbour or split; asides may be no part of the command.
All of these are edges of one lattice with a cost each; the word model adds the cost of the words in context.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from grounding.language.syntax.asides import Asides
from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.spelling import EXTRA_BLANK, SpellingCandidates
from grounding.language.syntax.word_categories import NOUNS, WordCategory
from grounding.language.syntax.word_model import BOUNDARY, WordModel, symbol
from grounding.vocabulary import ORDINALS

_BEAM = 12
# Fewest words of a phrase that is right as written.
_LEAST_PHRASE = 4
# Words between the numbers of an estimate.
_BOUNDS = ("or", "to")
_TURNS = ("left", "right")
# Forms of nouns of several things: that of "vans" is also a verb's.
_PLURAL = ("plural", "s")
# Most letters of a word that is spelled out.
_MAX_SPELLED = 5


@dataclass(frozen=True, slots=True)
class Decoded:
    """A sequence of words and the written words that they stand for.

    Attributes:
        words: words of the command.
        spans: first and one past the last written word of each.
        cost: minus the log probability, up to a constant.
    """

    words: tuple[str, ...]
    spans: tuple[tuple[int, int], ...]
    cost: float


class _Path(NamedTuple):
    """A path through the lattice: the last edge, and the path before it."""

    cost: float
    last: str
    words: tuple[str, ...] = ()
    span: tuple[int, int] = (0, 0)
    before: _Path | None = None

    def decoded(self, cost: float) -> Decoded:
        """Return the words of the whole path."""
        edges, path = [], self
        while path.before is not None:
            edges.append(path)
            path = path.before
        words = tuple(word for edge in reversed(edges) for word in edge.words)
        return Decoded(words, tuple(edge.span for edge in reversed(edges) for _ in edge.words), cost)


class Decoder:
    """Decode written words with the words of a lexicon."""

    def __init__(self, lexicon: Lexicon) -> None:
        """Build the word model and the index of spelling candidates."""
        self._model, self._spelling = WordModel(lexicon), SpellingCandidates(lexicon)
        self._lexicon = lexicon
        self._asides = Asides(lexicon, self._model)

    def decode(self, written: Sequence[str], most: int) -> list[Decoded]:
        """Return the likeliest sequences of words, best first, at most `most`; at least one."""
        paths: list[list[_Path]] = [[] for _ in range(len(written) + 1)]
        paths[0].append(_Path(0.0, BOUNDARY))
        right = self._right_as_written(written)
        for i in range(len(written)):
            kept = sorted(paths[i], key=lambda path: path.cost)[:_BEAM]
            for end, words, cost in self._edges(written, i, i in right) if kept else ():
                paths[end] += self._extended(kept, words, cost, (i, end))
        ends = [(path.cost + self._end_cost(path.last), path) for path in paths[-1]]
        best: dict[tuple[str, ...], Decoded] = {}
        for cost, path in sorted(ends, key=lambda pair: pair[0])[: _BEAM + most]:
            decoded = path.decoded(cost)
            best.setdefault(decoded.words, decoded)
        return list(best.values())[:most]

    def _right_as_written(self, written: Sequence[str]) -> set[int]:
        """Return the words that are right: in whole phrases, between numbers, and numbers before nouns.

        "Tight to the kerb" is not "right to the kerb", and "the next 2 cars" is not "next to cars".
        """
        right: set[int] = set()
        for i in range(len(written)):
            match = self._lexicon.longest_match(tuple(written), i)
            if match is not None and match[0] - i >= _LEAST_PHRASE:
                right.update(range(i, match[0]))
            if 0 < i < len(written) - 1 and written[i] in _BOUNDS:
                right |= {i} if self._is_number(written[i - 1]) and self._is_number(written[i + 1]) else set()
            if written[i].isdigit() and self._is_plural(" ".join(written[i + 1 : i + 2])):
                right.add(i)
            if self._names_turn(written, i):
                right.update((i, i + 1))
        return right

    def _names_turn(self, written: Sequence[str], i: int) -> bool:
        """Return whether a word is a turn that is counted, and no aside: "next right then first left"."""
        return i > 0 and written[i] in _TURNS and written[i - 1] in ORDINALS

    def _is_plural(self, word: str) -> bool:
        match = self._lexicon.longest_match((word,), 0)
        return match is not None and match[1].category in NOUNS and self._lexicon.forms.get(word) in _PLURAL

    def _is_number(self, word: str) -> bool:
        match = self._lexicon.longest_match((word,), 0)
        return word.isdigit() or (match is not None and match[1].category is WordCategory.NUMBER)

    def _edges(self, written: Sequence[str], i: int, right: bool) -> Iterator[tuple[int, tuple[str, ...], float]]:
        """Yield the edges from a written word, which may be right as written: end, words, cost."""
        number = len(written) == 1 and written[0].isdigit()  # an answer, and no way to write "to"
        if right or number:
            yield i + 1, (written[i],), 0.0
        else:
            yield from self._corrected(written, i)
        for end, cost in () if self._names_turn(written, i) else self._asides.at(written, i):
            yield end, (), cost

    def _corrected(self, written: Sequence[str], i: int) -> Iterator[tuple[int, tuple[str, ...], float]]:
        """Yield the edges to what a written word may stand for, alone or joined with the words after it."""
        for words, cost in self._spelling.of(written[i]).items():
            yield i + 1, words, cost
        if i + 1 < len(written):
            for words, cost in self._spelling.of_pair(written[i], written[i + 1]).items():
                yield i + 2, words, cost
        for end in range(i + 2, _spelled_end(written, i) + 1):
            if (joined := "".join(written[i:end])) in self._spelling.words:
                yield end, (joined,), EXTRA_BLANK

    def _extended(
        self, paths: Sequence[_Path], words: tuple[str, ...], cost: float, span: tuple[int, int]
    ) -> list[_Path]:
        """Return each path with one more edge."""
        if not words:
            return [_Path(path.cost + cost, path.last, words, span, path) for path in paths]
        first, *others = symbols = [symbol(word) for word in words]
        inner = cost + sum(map(self._model.cost, symbols, others))
        follow = {last: self._model.cost(last, first) for last in {path.last for path in paths}}
        return [_Path(path.cost + inner + follow[path.last], symbols[-1], words, span, path) for path in paths]

    def _end_cost(self, last: str) -> float:
        return 0.0 if last == BOUNDARY else self._model.cost(last, BOUNDARY)


def _spelled_end(written: Sequence[str], i: int) -> int:
    """Return the end (exclusive) of the letters of a word that is spelled out: "s u v"."""
    end = i
    while end < min(len(written), i + _MAX_SPELLED) and len(written[end]) == 1 and written[end].isalpha():
        end += 1
    return end


@lru_cache(maxsize=4)
def decoder_of(lexicon: Lexicon) -> Decoder:
    """Return the decoder of a lexicon, built once."""
    return Decoder(lexicon)
