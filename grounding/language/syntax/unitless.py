"""Numbers, and distances that are told without a unit of length: "forward ten", "two cars behind the bus"."""

from __future__ import annotations

from collections.abc import Sequence

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory

# Room that a vehicle takes in a row or a queue, and the most vehicles that are counted so.
_VEHICLE_M, _MOST_VEHICLES = 6.0, 9
# Verbs after which a number of vehicles tells how far: "park two cars behind it", but not "overtake two cars".
_PLACING = ("park", "stop", "pull_over", "wait", "follow", "approach", "stay", "get", "go", "drive", "move", "pull")
_ANY_VEHICLE = ("car", "vehicle")
# Places from which vehicles are counted.
_COUNTED_FROM = ("behind", "in_front_of", "past", "before", "ahead")
# Least and most of a number without a unit that is metres, and ends of the values of words before it.
_METRES = (2.0, 100.0)
_ONWARD = ("straight", "onward", "back")
_OR, _UNITS = (WordCategory.OR, WordCategory.TO), (WordCategory.UNIT, WordCategory.TIME)
_ENDS = (WordCategory.BREAK, WordCategory.COMMA, WordCategory.AND, WordCategory.THEN)


def read_number(tokens: Sequence[Token], start: int) -> tuple[int, float | None]:
    """Return the end of the number that begins at a token, and the number; None for none."""
    end, value = start, 0.0
    while end < len(tokens) and (number := number_at(tokens, end)) is not None:
        # "two hundred" multiplies, "twenty five" adds.
        value = value * number if end > start and number in (100, 1000) else value + number
        end += 1
        if end + 1 < len(tokens) and tokens[end].category is WordCategory.AND:
            # "Two and a half", "a hundred and fifty".
            end += (number_at(tokens, end + 1) or 1000) < (100 if value >= 100 else 1)
    if end > start and (most := _other_bound(tokens, end)) is not None:
        return end + 2, (value + most) / 2
    return end, value if end > start else None


def _other_bound(tokens: Sequence[Token], joint: int) -> float | None:
    """Return the other number of an estimate: 3 of "two or three metres"; None without one."""
    if joint + 2 >= len(tokens) or tokens[joint].category not in _OR or tokens[joint + 2].category not in _UNITS:
        return None
    return number_at(tokens, joint + 1)


def number_at(tokens: Sequence[Token], i: int) -> float | None:
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


def read_unitless(tokens: Sequence[Token], start: int) -> tuple[int, float] | None:
    """Return the end of a distance without a unit of length that begins at a token, and its metres; None for none."""
    end, number = read_number(tokens, start)
    if number is None and tokens[start].category is WordCategory.ONE and tokens[start].text == "one":
        end, number = start + 1, 1.0  # "one car behind the bus"
    if number is None:
        return None
    before, after = (tokens[start - 1] if start else None), tokens[end : end + 2]
    if _counts_vehicles(before, after) and number <= _MOST_VEHICLES:
        return end + 1, number * _VEHICLE_M
    onward = before is not None and _leads_on(before) and (not after or after[0].category in _ENDS)
    onward = onward or (
        _begins(before) and _is_straight(after[:1]) and (len(after) == 1 or after[1].category in _ENDS)
    )
    return (end, number) if onward and _METRES[0] <= number <= _METRES[1] else None


def name_units(tokens: Sequence[Token]) -> list[Token]:
    """Return tokens of a sentence with the vehicles that tell how far as units of length."""
    named = list(tokens)
    for i, token in enumerate(tokens):
        read = read_unitless(tokens, i)
        if read is not None and (last := tokens[read[0] - 1]).category is WordCategory.NOUN and last is not token:
            named[read[0] - 1] = last.with_category(WordCategory.UNIT, f"{_VEHICLE_M:g}")
    return named


def guessed_distances(tokens: Sequence[Token]) -> list[str]:
    """Tell how far it is taken to be where no unit of length is named; `tokens` are not tagged."""
    read = ((i, read_unitless(tokens, i)) for i in range(len(tokens)))
    found = ((" ".join(one.written for one in tokens[i : each[0]]), each[1]) for i, each in read if each is not None)
    return [f"'{written}' is taken as {metres:g} m" for written, metres in found]


def _counts_vehicles(before: Token | None, after: Sequence[Token]) -> bool:
    """Return whether a number between tokens counts the vehicles from a place on: "park | two | cars behind it"."""
    if len(after) < 2 or after[0].category is not WordCategory.NOUN or after[0].value not in _ANY_VEHICLE:
        return False
    placed = before is not None and before.category is WordCategory.VERB and before.value.split()[0] in _PLACING
    counted = after[1].value in _COUNTED_FROM or after[1].category in (WordCategory.AWAY, WordCategory.BETWEEN)
    return counted and (placed or _begins(before))


def _begins(before: Token | None) -> bool:
    """Return whether a clause begins after a token."""
    return before is None or before.category in _ENDS


def _leads_on(token: Token) -> bool:
    """Return whether a word says to drive on or back: "forward", "back up"."""
    verb = token.category is WordCategory.VERB and token.value.split()[-1] in _ONWARD
    return verb or token.text.split()[-1] == "back" or _is_straight([token])


def _is_straight(tokens: Sequence[Token]) -> bool:
    return any(token.category is WordCategory.DIRECTION and token.value == "straight" for token in tokens)
