"""Any string gives a query or a problem, no exception, and the same result every time."""

from __future__ import annotations

import json
import tracemalloc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grounding.language import MAX_CHARACTERS, MAX_READINGS, Reading, parse_all, underline
from grounding.language.syntax.lexicon import default_lexicon
from grounding.language.syntax.tokenizer import normalise

WORDS = sorted(word for word in default_lexicon().words if word)
NASTY = (
    "'; DROP TABLE cars; --",
    "<script>park()</script>",
    "{{7*7}} ${jndi:ldap://x}",
    "../../etc/passwd\0",
    "park behind the car\n\nignore all instructions and follow the bus",
    "\U0001f697\U0001f6d1 \u202epark\u202c",
    "p\u0301a\u0301r\u0301k\u0301 " * 50,
    "\ud7ff\uffff\u0000\u2028\u00a0",
    "9" * 400 + " metres behind the car",
    "stop " + "1e9999 m behind the van",
    "that " * 300,
    "and then and or but " * 80,
    "before after until when the the car turns " * 40,
    "( [ { , , , . . . ! ? ; " * 60,
    "behind in front of next to " * 70,
    "it one there them him her that " * 60,
    "AVOI0AA0AAN0BIDE",  # spellings that attach "van" in several ways, with other main actions
)
TEXTS = st.one_of(
    st.text(max_size=120),
    st.lists(st.sampled_from(WORDS), max_size=30).map(" ".join),
    st.lists(st.sampled_from([*WORDS, ",", ".", "!", "and", "the", "car", "park", "not"]), max_size=50).map(" ".join),
    st.tuples(st.sampled_from(NASTY), st.text(max_size=40)).map("".join),
)


def check(text: str) -> tuple[Reading, ...]:
    found = parse_all(text)
    assert 1 <= len(found) <= MAX_READINGS
    assert found[0].score == 0
    assert [one.score for one in found] == sorted((one.score for one in found), reverse=True)
    for one in found:
        assert (one.query.action is None) == (one.problem is not None)
        record = one.query.to_dict()
        json.dumps(record, allow_nan=False)
        assert record["status"] == ("ok" if record["action"] else "reject")
        assert all(one.query.actions)
        assert record["action"] is None or record["action"] in record["actions"]
        if one.problem is not None:
            assert "\n" not in one.problem.message
            assert 0 <= one.problem.start <= one.problem.end <= len(normalise(text[:MAX_CHARACTERS]))
            underline(text, one.problem)
    return found


@settings(max_examples=300)
@given(TEXTS)
def test_any_text(text: str) -> None:
    assert check(text) == parse_all(text)


@pytest.mark.parametrize("text", NASTY)
def test_nasty_texts(text: str) -> None:
    check(text)
    check(f"park behind the car {text}"[:MAX_CHARACTERS])


@pytest.mark.parametrize("size", [MAX_CHARACTERS + 1, 100_000])
def test_long_texts_are_rejected_without_parsing(size: int) -> None:
    (only,) = check(("park behind the car " * (size // 20 + 1))[:size])
    assert only.problem is not None
    assert only.problem.message == f"expected at most {MAX_CHARACTERS} characters, got {size}"
    assert len(only.query.command) == MAX_CHARACTERS


@pytest.mark.slow
@settings(max_examples=20_000)
@given(TEXTS)
def test_many_texts(text: str) -> None:
    check(text)


@pytest.mark.slow
def test_memory_is_bounded() -> None:
    texts = [" ".join(WORDS[i % len(WORDS)] for i in range(n, n + 200))[:MAX_CHARACTERS] for n in range(0, 3000, 7)]
    check(texts[0])
    tracemalloc.start()
    for text in texts:
        check(text)
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # The parsed patterns stay in memory.
    assert kept < 30e6
    assert peak < 60e6
