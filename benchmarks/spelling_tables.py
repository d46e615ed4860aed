"""Make the tables of the spelling correction: common words, homophones, and which word follows which in commands.

    python -m benchmarks.spelling_tables WORDS PRONUNCIATIONS COMMANDS [--out FOLDER]

- WORDS: `frequency_dictionary_en_82_765.txt` of the Python package symspellpy (MIT): a word and its frequency a line.
- PRONUNCIATIONS: `cmudict-en-us.dict` of the Debian package pocketsphinx-en-us (BSD): a word and its phones a line.
- COMMANDS: labelled commands (JSONL), from which the successions of words are counted.

Written: `words.txt` (the 20,000 most frequent words, most frequent first), `homophones.txt` (words of the lexicon and
those that sound the same) and `successions.txt` (word pairs with counts). `NOTICE.txt` there names the sources.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from grounding.language.evaluation import read_labelled_commands
from grounding.language.syntax.lexicon import DEFAULT_PATH, Lexicon, default_lexicon
from grounding.language.syntax.phrase_patterns import WORD
from grounding.language.syntax.tokenizer import normalise
from grounding.language.syntax.word_model import BOUNDARY, UNKNOWN, symbol

COMMON_WORDS = 20_000
VOWELS = "AEIOU"


def frequent_words(path: Path) -> tuple[list[str], list[str]]:
    """Return the words of a frequency dictionary, most frequent first, and its contractions, which have no count."""
    rows = (line.split() for line in path.read_text(encoding="utf-8-sig").splitlines())
    counted = [(word, int(count)) for word, count in rows if re.fullmatch(r"[a-z]+", word)]
    contractions = [line.split()[0] for line in path.read_text(encoding="utf-8-sig").splitlines() if "'" in line]
    # Of single letters only "a" and "i" are words.
    plain = [word for word, _ in sorted(counted, key=lambda pair: -pair[1]) if len(word) > 1 or word in "ai"]
    return plain, contractions


def homophones(path: Path, words: Iterable[str], lexicon: Lexicon) -> dict[str, list[str]]:
    """Return the words of the lexicon with the words of the same pronunciation."""
    wanted = {*words, *lexicon.words}
    by_sound: dict[tuple[str, ...], set[str]] = defaultdict(set)
    for line in path.read_text(encoding="latin-1").splitlines():
        head, *sounds = line.split()
        word = re.sub(r"\(\d+\)$", "", head)
        if word in wanted:
            by_sound[tuple(sounds)].add(word)
    found: dict[str, set[str]] = defaultdict(set)
    for phones, words in by_sound.items():
        for word in words & lexicon.words:
            found[word] |= words - {word}
            # "Next" is heard as "necks": speakers drop a last T or D after another consonant.
            if len(phones) > 3 and phones[-1] in "TD" and phones[-2][0] not in VOWELS:
                found[word] |= by_sound.get(phones[:-1], set())
    return {word: sorted(others - {word}) for word, others in sorted(found.items()) if others - {word}}


def successions(texts: Iterable[str], known: set[str]) -> dict[str, Counter[str]]:
    """Return word -> count of each word that follows it; sentences begin and end with the boundary."""
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for text in texts:
        symbols = [symbol(match.group()) for match in WORD.finditer(normalise(text))]
        words = [word if word in known or not word.isalpha() else UNKNOWN for word in symbols]
        for one, following in pairwise([BOUNDARY, *words, BOUNDARY]):
            if (one, following) != (BOUNDARY, BOUNDARY):
                found[one][following] += 1
    return dict(sorted(found.items()))


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments and write the three tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("words", "pronunciations", "commands"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--out", type=Path, default=DEFAULT_PATH.parent)
    given = parser.parse_args(arguments)
    lexicon, (plain, contractions) = default_lexicon(), frequent_words(given.words)
    common = [*plain[: COMMON_WORDS - len(contractions)], *contractions]
    sounds = homophones(given.pronunciations, plain, lexicon)
    known = {*common, *lexicon.words}
    follow = successions((record["command"] for record in read_labelled_commands(given.commands)), known)
    tables = {
        "words.txt": common,
        "homophones.txt": [f"{word} {' '.join(others)}" for word, others in sounds.items()],
        "successions.txt": [
            " ".join([word, *(f"{other}:{count}" for other, count in sorted(counts.items()))])
            for word, counts in follow.items()
        ],
    }
    for name, lines in tables.items():
        (given.out / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
        print(f"{given.out / name}: {len(lines)} lines, {(given.out / name).stat().st_size} bytes")


if __name__ == "__main__":
    main()
