"""Quantities: numbers with a unit of length become distances in metres; times and speeds are told."""

from __future__ import annotations

from collections.abc import Sequence

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.unitless import number_at, read_number, read_unitless
from grounding.language.syntax.word_categories import HEADS, MODIFIERS, WordCategory

# Words for a manner of driving; those for care ("safely") ask for nothing else than is done anyway.
_MANNERS = ("slow", "slowly", "quick", "quickly", "fast", "gently", "gradually", "softly", "smoothly")
# Categories of which a number before them counts.
_COUNTED = MODIFIERS | HEADS | {WordCategory.UNIT, WordCategory.UNKNOWN, WordCategory.OF, WordCategory.VERB}
# Words beside a unit of length that ask for so much more.
_MORE = ("more", "further", "farther", "extra")
# Last words of phrases for a duration that the lexicon leaves out.
_DURATIONS = ("minutes", "secs", "ticks")
# Words before a distance that make it a limit, and the categories of the words of such a limit: "in the next".
_LIMITS = ("next", "first", "following")
_BEFORE_LIMIT = (WordCategory.ORDINAL, WordCategory.THE, WordCategory.RELATION)


def unheld_amounts(tokens: Sequence[Token]) -> list[str]:
    """Return the amounts that no query holds, as written: times, speeds, limits, and numbers that count nothing.

    Args:
        tokens: tokens of a sentence, not tagged.
    """
    found: list[str] = []
    i = 0
    while i < len(tokens):
        if _is_unit(tokens, i) and _part_after(tokens, i):
            i += 3
            continue
        if (unitless := read_unitless(tokens, i)) is not None:
            i = unitless[0]
            continue
        end, _ = read_number(tokens, i)
        after = tokens[end].category if end < len(tokens) else WordCategory.BREAK
        before = tokens[i - 1] if i else None
        timed = after is WordCategory.TIME and (end > i or (before and before.category is WordCategory.ANY))
        limits = end > i and after is WordCategory.UNIT and before is not None and before.text in _LIMITS
        left_out = tokens[i].category is WordCategory.FILLER and tokens[i].text.split()[-1]
        if left_out and (left_out.isdigit() or left_out in _DURATIONS):
            found.append(tokens[i].written)
        if timed or limits or (end > i and after not in _COUNTED):
            found.append(" ".join(token.written for token in tokens[i - limits : end + bool(timed or limits)]))
        i = max(end, i + 1)
    return found


def named_manners(tokens: Sequence[Token]) -> list[str]:
    """Return the words for a manner of driving: "slowly"; tokens as in `unheld_amounts`."""
    adverbs = (token for token in tokens if token.category in (WordCategory.FILLER, WordCategory.VERB))
    return [word for token in adverbs for word in token.text.split() if word in _MANNERS]


def merge_quantities(tokens: Sequence[Token]) -> list[Token]:
    """Replace numbers with their unit of length by one DISTANCE in metres, and drop durations."""
    merged: list[Token] = []
    i = 0
    while i < len(tokens):
        end, value = read_number(tokens, i)
        end += value is not None and _is_more(tokens, end) and _is_unit(tokens, end + 1)  # "five more metres"
        article = value is None and tokens[i].category is WordCategory.ANY
        unit_at = end + article
        unit = tokens[unit_at] if unit_at < len(tokens) and (value is not None or article) else None
        if unit is not None and unit.category is WordCategory.UNIT:
            qualifying = (WordCategory.ABOUT, *(() if article else (WordCategory.ANY, WordCategory.EXTRA)))
            while merged and merged[-1].category in qualifying:
                merged.pop()  # "a good 15 metres", "at least a metre"
            if value is not None and merged and merged[-1].text == "by":
                merged.pop()  # "reverse by five metres"
            if (
                value is not None and merged and merged[-1].text in _LIMITS
            ):  # "in the next 50 metres" limits the place
                while merged and merged[-1].category in _BEFORE_LIMIT:
                    merged.pop()
                i = unit_at + 1
                continue
            part = _part_after(tokens, unit_at)
            metres = ((1.0 if value is None else value) + part) * float(unit.value)
            after = unit_at + 1 + (2 if part else 0)
            after += value is not None and _is_more(tokens, after)  # "five metres more"
            merged.append(_distance(tokens[i:after], metres))
            i = after
        elif unit is not None and unit.category is WordCategory.TIME:
            i = unit_at + 1
        elif (unitless := read_unitless(tokens, i)) is not None:
            merged.append(_distance(tokens[i : unitless[0]], unitless[1]))
            i = unitless[0]
        else:
            merged.append(tokens[i])
            i += 1
    return merged


def more_words(tokens: Sequence[Token]) -> list[Token]:
    """Return the words that only say that a distance is to be added: "more" in "five metres more"."""
    return [
        one
        for i, one in enumerate(tokens)
        if _is_more(tokens, i) and (_is_unit(tokens, i - 1) or _is_unit(tokens, i + 1))
    ]


def _is_more(tokens: Sequence[Token], i: int) -> bool:
    return 0 <= i < len(tokens) and tokens[i].text in _MORE


def _part_after(tokens: Sequence[Token], unit_at: int) -> float:
    """Return the part of a unit that is added after it: "a metre and a half"; 0 without one."""
    joint = tokens[unit_at + 1 : unit_at + 2]
    if not joint or joint[0].category is not WordCategory.AND or len(tokens) < unit_at + 3:
        return 0.0
    if _is_unit(tokens, unit_at + 3):
        return 0.0  # "a metre and half a mile"
    number = number_at(tokens, unit_at + 2)
    return number if number is not None and number < 1 else 0.0


def _is_unit(tokens: Sequence[Token], i: int) -> bool:
    return 0 <= i < len(tokens) and tokens[i].category is WordCategory.UNIT


def _distance(tokens: Sequence[Token], metres: float) -> Token:
    text, written = (" ".join(part) for part in zip(*((t.text, t.written) for t in tokens), strict=True))
    return Token(
        category=WordCategory.DISTANCE,
        value=f"{metres:.10g}",
        form="counted",
        text=text,
        written=written,
        start=tokens[0].start,
        end=tokens[-1].end,
    )
