"""Numbers and their units in a sentence: distances in metres."""

from __future__ import annotations

from collections.abc import Sequence

from grounding.language.tokenizer import Token
from grounding.language.word_categories import Kind


def counted(tokens: Sequence[Token]) -> list[Token]:
    """The tokens, numbers with their units as one DISTANCE in metres; times are left out."""
    done: list[Token] = []
    i = 0
    while i < len(tokens):
        end, value, any_number = i, 0.0, False
        while end < len(tokens) and (amount := _amount(tokens, end)) is not None:
            # "two hundred" multiplies, "twenty five" adds.
            value = value * amount if any_number and amount in (100, 1000) else value + amount
            any_number, end = True, end + 1
            if end + 1 < len(tokens) and tokens[end].kind is Kind.AND:
                # "Two and a half", "a hundred and fifty".
                end += (_amount(tokens, end + 1) or 1000) < (100 if value >= 100 else 1)
        article = end == i and tokens[i].kind is Kind.ANY
        unit_at = end + article
        unit = tokens[unit_at] if unit_at < len(tokens) and (any_number or article) else None
        if unit is not None and unit.kind is Kind.UNIT:
            while any_number and done and done[-1].kind in (Kind.ANY, Kind.EXTRA, Kind.ABOUT):
                done.pop()  # "a good 15 metres"
            done.append(_joined(tokens[i : unit_at + 1], (value if any_number else 1.0) * float(unit.value)))
            i = unit_at + 1
        elif unit is not None and unit.kind is Kind.TIME:
            i = unit_at + 1
        else:
            done.append(tokens[i])
            i += 1
    return done


def _amount(tokens: Sequence[Token], i: int) -> float | None:
    token = tokens[i]
    if token.kind is Kind.NUMBER:
        return float(token.value)
    after = tokens[i + 1] if i + 1 < len(tokens) else token
    followed = after.kind in (Kind.UNIT, Kind.TIME) or after.value in ("100", "1000")
    if after.kind is Kind.AND and i + 2 < len(tokens):  # "one and a half"
        followed = tokens[i + 2].kind is Kind.NUMBER and float(tokens[i + 2].value) < 1
    return 1.0 if token.kind is Kind.ONE and token.text == "one" and followed else None


def _joined(tokens: Sequence[Token], metres: float) -> Token:
    text, meant = (" ".join(part) for part in zip(*((t.text, t.meant) for t in tokens), strict=True))
    return Token(Kind.DISTANCE, f"{metres:.10g}", text, meant, tokens[0].start, tokens[-1].end)
