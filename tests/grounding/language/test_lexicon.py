from __future__ import annotations

from pathlib import Path

import pytest

from appocc.errors import DataError
from grounding.language import parse
from grounding.language.syntax.lexicon import Lexicon, default_lexicon, default_phrases, read_lexicon
from grounding.language.syntax.phrase_patterns import LexicalEntry
from grounding.language.syntax.word_categories import WordCategory


def test_all_patterns_of_the_package_are_valid() -> None:
    book = default_phrases()
    assert book[("pickup", "truck")] == (WordCategory.NOUN, "truck")
    assert book[("went", "back")] == (WordCategory.VERB, "turn around")
    assert len({category for category, _ in book.values()}) > 40


def test_patterns_have_choices_and_optional_parts() -> None:
    lexicon = Lexicon()
    lexicon.add("drop [me|us] off|out; let_me out", LexicalEntry(WordCategory.FILLER))
    found = {phrase for pattern in lexicon.patterns for phrase in pattern.phrases()}
    drops = {("drop", who, where) for who in ("me", "us") for where in ("off", "out")}
    assert found == drops | {("drop", "off"), ("drop", "out"), ("let", "me", "out")}
    assert lexicon.longest_match(("please", "drop", "us", "out", "now"), 1) == (4, LexicalEntry(WordCategory.FILLER))
    assert lexicon.longest_match(("drop", "it"), 0) is None


def test_a_lexicon_file_adds_words(tmp_path: Path) -> None:
    path = tmp_path / "mine.txt"
    path.write_text(
        "# Dutch\n[noun car]\nauto; wagen\n[relation behind]\nachter\n[the]\nde\n[verb park | is=parked]\nparkeer\n"
    )
    before = len(default_lexicon().patterns)
    lexicon = read_lexicon(path)
    query = parse("parkeer achter de auto", lexicon).query
    assert (query.action, query.relation) == ("park", "behind")
    assert query.referent is not None
    assert (query.referent.noun, query.referent.head) == ("car", "auto")
    assert len(default_lexicon().patterns) == before
    assert parse("parkeer achter de auto").query.action is None
    assert read_lexicon(path, Lexicon()).longest_match(("achter",), 0) == (
        1,
        LexicalEntry(WordCategory.RELATION, "behind"),
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("car; auto\n", "line 1: expected a section such as [noun car] first, got 'car; auto'"),
        ("[noun boat]\n", "line 1: expected [noun] to be one of car, van"),
        ("\n[colour polka]\n", "line 2: expected [colour] to be one of black"),
        ("[nouns car]\n", "line 1: expected a section of one of verb"),
        ("[break]\n", "line 1: expected a section of one of verb"),
        ("[noun car]\nsmall [auto\n", "line 2: expected words, a|b or [a|b], got 'small [auto'"),
        ("[noun car]\nauto||wagen\n", "line 2: expected words"),
        ("[noun car]\n[auto]|x y\n", "line 2: expected words"),
        ("[noun car]\n[auto|wagen] [rood]\n", "one at least not in brackets"),
        ("[noun car]\n" + "a " * 13 + "\n", "expected 1 to 12 words"),
        ("[unit x]\n", "line 1: expected a plain number, got '[unit x]'"),
        ("[verb park | was=parked]\n", "line 1: expected is=STATE"),
        ("[verb park | is=asleep]\n", "line 1: expected is=STATE"),
        ("[forms]\ngo\n", "line 2: expected a word and its forms"),
    ],
)
def test_errors_name_the_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "bad.txt"
    path.write_text(text)
    with pytest.raises(DataError) as raised:
        read_lexicon(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert reason in str(raised.value)
    assert "\n" not in str(raised.value)


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"cannot be read \(No such file"):
        read_lexicon(tmp_path / "none.txt")
    (tmp_path / "bytes.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="cannot be read as text"):
        read_lexicon(tmp_path / "bytes.txt")
    (tmp_path / "long.txt").write_text("[filler]\n" + "word\n" * 250_000)
    with pytest.raises(DataError, match="at most 1000000 bytes"):
        read_lexicon(tmp_path / "long.txt")
