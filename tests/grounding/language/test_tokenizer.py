from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from grounding.language.syntax import tokenizer
from grounding.language.syntax.tagging.tagger import tag
from grounding.language.syntax.tokenizer import normalise, tokenise


def categories_and_values(text: str) -> list[tuple[str, str]]:
    return [(token.category.value, token.value) for token in tokenise(normalise(text))]


def tagged(text: str) -> list[tuple[str, str]]:
    return [(token.category.value, token.value) for token in tag(tokenise(normalise(text)))]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("park behind", [("verb", "park"), ("relation", "behind")]),
        ("stop on the left of", [("verb", "stop"), ("relation", "left_of")]),
        ("on the left side of the road", [("side", "left_side")]),
        ("on the right of us", [("side", "right_side")]),
        ("from the right", [("side", "from_right")]),
        ("in the far left lane", [("lane", "left_lane")]),
        ("turn left", [("verb", "turn left")]),
        ("in front of us", [("where", "ahead")]),
        ("in front of", [("relation", "in_front_of")]),
        ("right behind", [("relation", "behind")]),
        ("go right behind", [("verb", "go"), ("relation", "behind")]),
        ("head right alongside", [("verb", "go"), ("relation", "next_to")]),
        ("drive right near", [("verb", "drive"), ("relation", "near")]),
        ("go right between", [("verb", "go"), ("between", "")]),
        ("go right opposite", [("verb", "go"), ("relation", "opposite")]),
        ("go right past", [("verb", "turn right"), ("relation", "past")]),
        ("turn right behind", [("verb", "turn right"), ("relation", "behind")]),
        ("pull in behind", [("verb", "park"), ("relation", "behind")]),
        ("gray SUV", [("colour", "grey"), ("noun", "car")]),
        ("4x4", [("noun", "car")]),
        ("2nd bus", [("ordinal", "second"), ("noun", "bus")]),
        ("5m", [("number", "5"), ("unit", "1")]),
        ("2.5 feet", [("number", "2.5"), ("unit", "0.3048")]),
        ("don\u2019t", [("not", "")]),
        ("pick-up truck", [("noun", "truck")]),
        ("zebra-striped", [("thing", "crosswalk"), ("extra", "")]),
        ("qwertz", [("unknown", "")]),
        ("1,000 metres", [("number", "1000"), ("unit", "1")]),
        ("anna's van", [("possessive", ""), ("noun", "van")]),
        ("the van's door", [("the", ""), ("noun", "van"), ("part", "")]),
    ],
)
def test_longest_phrase_wins(text: str, expected: list[tuple[str, str]]) -> None:
    assert categories_and_values(text) == expected


def test_verbs_have_forms_states_and_events() -> None:
    forms = {token.text: token for token in tokenise("turns turning turned turn")}
    assert [forms[word].form for word in ("turns", "turning", "turned", "turn")] == ["s", "ing", "past", ""]
    assert {(token.state, token.event) for token in forms.values()} == {("turning", "turn")}
    (token,) = tokenise("pulling out")
    assert (token.state, token.event, token.form) == ("leaving", "leave", "ing")
    assert tokenise("buses")[0].form == "plural"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("five metres", [("distance", "5")]),
        ("two hundred feet", [("distance", "60.96")]),
        ("twenty five metres", [("distance", "25")]),
        ("two and a half metres", [("distance", "2.5")]),
        ("a metre", [("distance", "1")]),
        ("half a mile", [("distance", "804.672")]),
        ("for 10 minutes", [("relation", "for")]),
        ("park behind parked cars", [("verb", "park"), ("relation", "behind"), ("state", "parked"), ("noun", "car")]),
        ("at the light", [("relation", "at"), ("the", ""), ("thing", "traffic_light")]),
        ("the light blue car", [("the", ""), ("shade", "light"), ("colour", "blue"), ("noun", "car")]),
        ("the car that stopped", [("the", ""), ("noun", "car"), ("which", ""), ("verb", "stop")]),
        ("follow that car", [("verb", "follow"), ("the", ""), ("noun", "car")]),
        ("follow that", [("verb", "follow"), ("pronoun", "")]),
        ("to turn", [("to", ""), ("verb", "turn")]),
        ("to the van", [("relation", "toward"), ("the", ""), ("noun", "van")]),
        ("the next turn", [("the", ""), ("ordinal", "next"), ("thing", "turn")]),
        ("my friends car", [("possessive", ""), ("possessive", ""), ("noun", "car")]),
        ("would you mind parking beside it", [("verb", "park"), ("relation", "next_to"), ("pronoun", "")]),
    ],
)
def test_neighbours_decide_the_category(text: str, expected: list[tuple[str, str]]) -> None:
    assert [pair for pair in tagged(text) if pair[0] != "ego"] == expected


def test_tokens_keep_their_span() -> None:
    text = normalise("  Park   behind THE zebra ")
    assert text == "park behind the zebra"
    for token in tokenise(text):
        assert text[token.start : token.end] == token.text


def test_a_token_keeps_the_written_words() -> None:
    text = normalise("park in um frnt of the van")
    tokens = tokenise(text)
    assert [(token.text, token.written) for token in tokens] == [
        *(("park", "park"), ("in front of", "in um frnt of"), ("the", "the"), ("van", "van"))
    ]
    assert all(text[token.start : token.end] == token.written for token in tokens)


@settings(max_examples=200)
@given(st.text(max_size=80))
@example("dropour")
def test_any_text_has_tokens_in_order(text: str) -> None:
    tokens = tokenise(normalise(text))
    # The parts of a word that was written as one share its place.
    assert all(a.end <= b.start or (a.start, a.end) == (b.start, b.end) for a, b in pairwise(tokens))


def test_a_word_of_maximal_length_is_unknown() -> None:
    word = "a" * (tokenizer.MAX_CHARACTERS - 20)
    assert categories_and_values(f"stop behind {word}")[-1] == ("unknown", "")
