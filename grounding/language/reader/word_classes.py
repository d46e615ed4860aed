"""Classes of everyday words: what a word that the reader never saw has in common with those that it learnt."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

from appocc.files import read_text

PATH = Path(__file__).parent / "data" / "word_classes.txt"
_MOST_BYTES = 1_000_000
# Endings of inflected words, and what the base form has instead, in the order in which they are tried.
_ENDINGS = {
    **{"'s": ("",), "ies": ("y",), "es": ("",), "s": ("",), "ied": ("y",), "ed": ("", "e"), "ing": ("", "e")},
    **{"in": ("",), "in'": ("",), "er": ("", "e"), "est": ("", "e"), "ly": ("",)},
}
_SHORTEST = 3


def classes_of(word: str) -> tuple[str, ...]:
    """Return the classes of a word, or of its base form; none for an unknown one."""
    table = _table()
    return next((table[one] for one in _forms(word) if one in table), ())


def _forms(word: str) -> Iterator[str]:
    """Yield a word and what may be its base form: "stopping", "stopp", "stop"."""
    yield word
    for ending, instead in _ENDINGS.items():
        stem = word.removesuffix(ending)
        if stem != word and len(stem) >= _SHORTEST:
            yield from (stem + one for one in instead)
            if ending[0] in "ei" and stem[-1] == stem[-2]:
                yield stem[:-1]


@cache
def _table() -> Mapping[str, tuple[str, ...]]:
    """Return word -> its classes."""
    found: dict[str, list[str]] = defaultdict(list)
    for line in read_text(PATH, _MOST_BYTES).splitlines():
        name, _, words = line.partition(": ")
        for word in dict.fromkeys(words.split()):
            found[word].append(name)
    return {word: tuple(names) for word, names in found.items()}
