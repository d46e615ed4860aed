"""Quantities: numbers with a unit of length become distances in metres."""

from __future__ import annotations

from collections.abc import Sequence

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory


def merge_quantities(tokens: Sequence[Token]) -> list[Token]:
    """Replace numbers with their unit of length by one DISTANCE in metres, and drop durations."""
    merged: list[Token] = []
    i = 0
    while i < len(tokens):
        end, value, has_number = i, 0.0, False
        while end < len(tokens) and (number := _number_at(tokens, end)) is not None:
            # "two hundred" multiplies, "twenty five" adds.
            value = value * number if has_number and number in (100, 1000) else value + number
            has_number, end = True, end + 1
            if end + 1 < len(tokens) and tokens[end].category is WordCategory.AND:
                # "Two and a half", "a hundred and fifty".
                end += (_number_at(tokens, end + 1) or 1000) < (100 if value >= 100 else 1)
        article = end == i and tokens[i].category is WordCategory.ANY
        unit_at = end + article
        unit = tokens[unit_at] if unit_at < len(tokens) and (has_number or article) else None
        if unit is not None and unit.category is WordCategory.UNIT:
            qualifying = (WordCategory.ANY, WordCategory.EXTRA, WordCategory.ABOUT)
            while has_number and merged and merged[-1].category in qualifying:
                merged.pop()  # "a good 15 metres"
            merged.append(_distance(tokens[i : unit_at + 1], (value if has_number else 1.0) * float(unit.value)))
            i = unit_at + 1
        elif unit is not None and unit.category is WordCategory.TIME:
            i = unit_at + 1
        else:
            merged.append(tokens[i])
            i += 1
    return merged


def _number_at(tokens: Sequence[Token], i: int) -> float | None:
    """Return the number that a token stands for; "one" and "couple" do before a unit, and "one" before a number."""
    token = tokens[i]
    if token.text == "couple" and i + 1 < len(tokens) and tokens[i + 1].category is WordCategory.UNIT:
        return 2.0
    if token.category is WordCategory.NUMBER:
        return float(token.value)
    after = tokens[i + 1] if i + 1 < len(tokens) else token
    followed = after.category in (WordCategory.UNIT, WordCategory.TIME) or after.value in ("100", "1000")
    if after.category is WordCategory.AND and i + 2 < len(tokens):  # "one and a half"
        followed = tokens[i + 2].category is WordCategory.NUMBER and float(tokens[i + 2].value) < 1
    return 1.0 if token.category is WordCategory.ONE and token.text == "one" and followed else None


def _distance(tokens: Sequence[Token], metres: float) -> Token:
    text, written = (" ".join(part) for part in zip(*((t.text, t.written) for t in tokens), strict=True))
    return Token(
        category=WordCategory.DISTANCE,
        value=f"{metres:.10g}",
        text=text,
        written=written,
        start=tokens[0].start,
        end=tokens[-1].end,
    )
