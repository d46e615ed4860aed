"""Self-repairs: "the blue, no, the green truck" as "the green truck"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from grounding.language.semantics.contrasts.letters import SIDES, WHOLE_NOUN, comma, complete, letter, span
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory

# "The one" and where it is.
_BARE_ONE = re.compile("d*o[rsw]")


def carry_out_repair(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Replace the reparandum by the repair: "the blue, no, the green truck"."""
    before, repair = span(tokens, match, "before"), span(tokens, match, "repair")
    letters = "".join(map(letter, before))
    first = letter(repair[0])
    if first == "r":
        return _replace_from(before, letters.rfind("r"), repair)
    if first == "w" and "front" in repair[0].text and (at := letters.rfind("r")) >= 0:
        return [*before[:at], before[at].with_category(WordCategory.RELATION, "in_front_of"), *before[at + 1 :]]
    if first in "st":
        return _replace_side(before, repair)
    if first in "lwx":
        return _replace_from(before, letters.rfind(first), repair, length=1)
    if all(letter(token) == "m" for token in repair):
        return _replace_modifier(before, repair)
    nouns = [found for found in re.finditer(WHOLE_NOUN, letters) if "p" not in found.group()]
    if not nouns or not _may_replace(before[nouns[-1].start() : nouns[-1].end()], repair):
        return None
    repaired = _replace_from(before, nouns[-1].start(), repair)
    reparandum = before[nouns[-1].start() : nouns[-1].end()]
    said = tokens[match.end("before") : match.start("repair")]
    if _BARE_ONE.match("".join(map(letter, repair))) and any("mean" in token.text for token in said):
        one = next(i for i, token in enumerate(repair) if letter(token) == "o")
        return [*before, *repair[one + 1 :]]  # "the white car, I mean the one next to the red car"
    if repaired is None or not _names_another(reparandum, repair):
        return repaired
    return [*repaired, comma(repair[0]), repair[0].with_category(WordCategory.NOT), *reparandum]


def _replace_from(
    before: list[Token], at: int, repair: Sequence[Token], length: int | None = None
) -> list[Token] | None:
    """Return `before` with its tokens from `at` on, or `length` of them, replaced; None without a reparandum."""
    if at < 0:
        return None
    end = len(before) if length is None else at + length
    return [*before[:at], *complete(repair, before[at:end]), *before[end:]]


def _replace_side(before: list[Token], repair: Sequence[Token]) -> list[Token] | None:
    """Replace the last side or direction, which may be part of a verb ("turn left")."""
    side = repair[0].value.removesuffix("_side")
    for at in range(len(before) - 1, -1, -1):
        token = before[at]
        words = token.value.replace("_", " ").split()
        named = [word for word in words if word in SIDES]
        if not named or side not in SIDES:
            continue
        changed = replace(token, value=token.value.replace(named[0], side))
        return [*before[:at], changed, *before[at + 1 :], *repair[1:]]
    return None


def _replace_modifier(before: list[Token], repair: Sequence[Token]) -> list[Token] | None:
    """Replace the last modifier of the same category: "the blue truck, no, green"."""
    for at in range(len(before) - 1, -1, -1):
        if before[at].category is repair[0].category:
            return [*before[:at], *repair, *before[at + 1 :]]
    return None


def _may_replace(reparandum: Sequence[Token], repair: Sequence[Token]) -> bool:
    """Return whether both noun phrases are vehicles, or neither is; one without a noun may be either."""
    kinds = [
        {token.category in (WordCategory.NOUN, WordCategory.MAKE, WordCategory.MODEL) for token in part}
        for part in ([t for t in reparandum if letter(t) == "h"], [t for t in repair if letter(t) == "h"])
    ]
    return not kinds[0] or not kinds[1] or bool(kinds[0] & kinds[1])


def _names_another(reparandum: Sequence[Token], repair: Sequence[Token]) -> bool:
    """Return whether a complete reparandum differs from the repair in its modifiers alone: "the red car"."""
    heads = [[token.value for token in part if letter(token) == "h"] for part in (reparandum, repair)]
    described = any(letter(token) in "msw" for token in reparandum)
    return described and bool(heads[0]) and heads[1] in ([], heads[0])
