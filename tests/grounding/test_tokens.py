from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grounding.lexicon import Kind, phrases
from grounding.tokens import did_you_mean, normalise, tokenise


def kinds_and_values(text: str) -> list[tuple[str, str]]:
    return [(token.kind.value, token.value) for token in tokenise(normalise(text))]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("park behind", [("ACTION", "park"), ("RELATION", "behind")]),
        ("stop on the left of", [("ACTION", "stop"), ("RELATION", "left_of")]),
        ("on the left side of the road", [("SIDE", "left_side")]),
        ("on the left of the road", [("SIDE", "left_side")]),
        ("on the right of us", [("SIDE", "right_side")]),
        ("from the right", [("SIDE", "from_right")]),
        ("turn left", [("ACTION", "turn left")]),
        ("in front of us", [("WHERE", "ahead")]),
        ("in front of", [("RELATION", "in_front_of")]),
        ("right behind", [("RELATION", "behind")]),
        ("go to", [("ACTION", "approach toward")]),
        ("find me a parking spot", [("ACTION", "park")]),
        ("gray SUV", [("COLOUR", "grey"), ("NOUN", "car")]),
        ("4x4", [("NOUN", "car")]),
        ("2nd bus", [("ORDINAL", "second"), ("NOUN", "bus")]),
        ("5m", [("NUMBER", "5"), ("UNIT", "1")]),
        ("2.5 feet", [("NUMBER", "2.5"), ("UNIT", "0.3048")]),
        ("don\u2019t", [("BEYOND", "")]),
        ("zebra", [("UNKNOWN", "")]),
    ],
)
def test_longest_phrase_wins(text: str, expected: list[tuple[str, str]]) -> None:
    assert kinds_and_values(text) == expected


def test_tokens_know_where_they_stand() -> None:
    text = normalise("  Park   behind THE zebra ")
    assert text == "park behind the zebra"
    for token in tokenise(text):
        assert text[token.start : token.end] == token.text


@pytest.mark.parametrize(
    ("slip", "meant"),
    [("trcuk", "truck"), ("sliver", "silver"), ("blak", "blak"), ("whitee", "white"), ("movie", "movie")],
)
def test_slips_of_longer_words_are_mended(slip: str, meant: str) -> None:
    (token,) = tokenise(slip)
    assert (token.text, token.meant) == (slip, meant)


def test_known_words_are_never_mended() -> None:
    for phrase in phrases():
        for word in phrase:
            assert all(token.text == token.meant for token in tokenise(word) if token.kind is not Kind.BREAK)


def test_did_you_mean() -> None:
    assert did_you_mean("trukc", (Kind.NOUN,)) == "truck"
    assert did_you_mean("xyzzy", (Kind.NOUN,)) is None


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=80))
def test_any_text_has_tokens_in_order(text: str) -> None:
    tokens = tokenise(normalise(text))
    assert all(a.end <= b.start for a, b in pairwise(tokens))
