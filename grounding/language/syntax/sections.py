"""Files of patterns in sections, as `questions.txt`: what a sentence does by the phrases that it holds."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from appocc.files import read_text
from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.phrase_patterns import LexicalEntry
from grounding.language.syntax.word_categories import WordCategory

_FOLDER = Path(__file__).parent / "data"
_MAX_BYTES = 1_000_000
_HEADING = re.compile(r"\[([a-z]+(?:: [^\]]+)?)\]")


def section_lines(name: str) -> Iterator[tuple[str, str]]:
    """Yield (section, line of patterns) of a file of the package's language data, in its order.

    Raises:
        DataError: if the file is missing.
    """
    section = ""
    for line in read_text(_FOLDER / name, _MAX_BYTES).splitlines():
        if heading := _HEADING.fullmatch(line):
            section = heading[1]
        elif line and not line.startswith("#"):
            yield section, line


@cache
def read_sections(name: str) -> dict[str, Lexicon]:
    """Return the patterns of each section of a file of the package's language data, in its order.

    Raises:
        DataError: if the file is missing.
    """
    sections = dict[str, Lexicon]()
    for section, line in section_lines(name):
        sections.setdefault(section, Lexicon()).add(line, LexicalEntry(WordCategory.FILLER, section))
    return sections


def longest_end(sections: dict[str, Lexicon], section: str, words: tuple[str, ...], start: int) -> int:
    """Return the end of the longest phrase of a section from a word on; 0 if there is none."""
    matched = sections[section].longest_match(words, start) if start < len(words) else None
    return matched[0] if matched else 0
