"""The glossary names types and modules that exist, and each term once."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("appocc", "tracking", "grounding", "cli")


def rows() -> list[tuple[str, str]]:
    """(term, last column) of every row of the glossary's tables."""
    lines = (ROOT / "docs" / "glossary.md").read_text().splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    return [(row[0], row[-1]) for row in cells if row[0] != "term" and not row[0].startswith("---")]


@pytest.mark.parametrize(("term", "names"), rows())
def test_every_type_and_module_exists(term: str, names: str) -> None:
    dotted = re.findall(r"`([\w.]+)`", names)
    assert dotted, term
    for name in dotted:
        assert name.split(".")[0] in PACKAGES, (term, name)
        parent, _, last = name.rpartition(".")
        if last[0].isupper():
            assert isinstance(getattr(importlib.import_module(parent), last, None), type), (term, name)
        else:
            importlib.import_module(name)


def test_every_term_has_one_row() -> None:
    terms = [term for term, _ in rows()]
    assert len(terms) > 40
    assert sorted(terms) == sorted(set(terms))


@pytest.mark.parametrize("page", ["README.md", "docs/conventions.md"])
def test_the_glossary_is_linked(page: str) -> None:
    assert "glossary.md)" in (ROOT / page).read_text()
