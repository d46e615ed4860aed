"""Classes of everyday words."""

from __future__ import annotations

import pytest

from grounding.language.reader.features import WORD_ROWS, feature_row, token_features
from grounding.language.reader.word_classes import classes_of
from grounding.language.syntax.tokenizer import tokenise


@pytest.mark.parametrize(
    ("word", "kind"),
    [
        ("bakery", "shop"),
        ("bakeries", "shop"),
        ("granny", "family"),
        ("nestling", "v_park"),
        ("stopping", "v_stop"),
        ("nicer", "beauty"),
        ("parked", "state_parked"),
    ],
)
def test_a_word_has_the_classes_of_its_base_form(word: str, kind: str) -> None:
    assert kind in classes_of(word)


@pytest.mark.parametrize("word", ["", "s", "zyxgh", "..", "ing"])
def test_other_words_have_none(word: str) -> None:
    assert classes_of(word) == ()


def test_words_of_one_class_share_a_feature_and_words_have_rows_of_their_own() -> None:
    bakery, florist = ({*token_features(tokenise(f"the {word}"))[1]} for word in ("bakery", "florist"))
    assert feature_row("k:shop") in bakery & florist
    assert feature_row("k:shop") < WORD_ROWS <= feature_row("w:bakery")
