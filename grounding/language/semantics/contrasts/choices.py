"""Contrasts: "not X, Y" and "Y, not X" as "Y, not X" or as "Y" alone."""

from __future__ import annotations

import re
from dataclasses import replace

from grounding.language.semantics.contrasts.letters import SIDES, comma, complete, letter, span
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory


def contrast(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "not X, Y" and "don't stop behind X but behind Y" to "Y, not X"."""
    negation, verb, rejected, chosen = (span(tokens, match, name) for name in ("not", "verb", "rejected", "chosen"))
    if letter(rejected[0]) in "st" and letter(rejected[0]) != letter(chosen[0]):
        return None
    if letter(rejected[0]) == "t":
        return [*verb, *chosen]  # of two directions the other one is excluded by the choice
    chosen = complete(chosen, rejected)
    return [*verb, *chosen, comma(negation[0]), negation[0].with_category(WordCategory.NOT), *rejected]


def share_noun(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "in front of, not behind, the van" to "in front of the van, not behind the van"."""
    chosen, rejected, noun = (span(tokens, match, name) for name in ("chosen", "rejected", "noun"))
    negation = chosen[0].with_category(WordCategory.NOT)
    return [*chosen, *noun, comma(chosen[0]), negation, *rejected, *noun]


def choose_relation(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "not behind, in front" to "in front of it"."""
    chosen = tokens[match.start("chosen")]
    if letter(chosen) == "w":
        if "front" not in chosen.text:
            return None
        chosen = chosen.with_category(WordCategory.RELATION, "in_front_of")
    return [chosen, replace(chosen.with_category(WordCategory.PRONOUN), text="it", written="")]


def choose_direction(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "don't go left around the van, go right" to "go right around the van"."""
    rejected, chosen = tokens[match.start("rejected")], tokens[match.start("chosen")]
    values = [rejected.value, chosen.value]
    return [chosen, *span(tokens, match, "place")] if {*values} == {"turn left", "turn right"} else None


def drop_direction(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Drop "not right" after "turn left", "not on the right" after "on the left", "not the left lane"."""
    rejected = tokens[match.end() - 1].value.split("_")[0]
    values = (token.value.replace("_", " ") for token in tokens[: match.start()])
    before = [word for value in values for word in value.split() if word in SIDES]
    return [] if before and rejected in SIDES and before[-1] != rejected else None


def take_other_side(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "anywhere but on the left" to "on the right"."""
    side = tokens[match.end() - 1]
    rejected = side.value.split("_")[0]
    if rejected not in SIDES:
        return None
    (other,) = {*SIDES} - {rejected}
    return [replace(side, value=side.value.replace(rejected, other), text=side.text.replace(rejected, other))]


def relate_side(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "to the left, not to the right, of" to "left of"."""
    chosen, rejected = (tokens[match.start(group)].value.removesuffix("_side") for group in ("chosen", "rejected"))
    if {chosen, rejected} != {*SIDES}:
        return None
    return [tokens[match.start()].with_category(WordCategory.RELATION, f"{chosen}_of")]


def name_lane(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "the left lane, the right one" to "the left lane, the right lane"."""
    lane, between, side = (span(tokens, match, group) for group in ("lane", "between", "side"))
    named = side[0].value.removesuffix("_side")
    value = f"{named}_lane" if named in SIDES else ""
    return [*lane, *between, side[0].with_category(WordCategory.LANE, value)] if value else None


def share_head(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "the second and not the first truck" to "the second truck, not the first truck"."""
    chosen, rejected, noun = (span(tokens, match, name) for name in ("chosen", "rejected", "noun"))
    negation = chosen[0].with_category(WordCategory.NOT)
    return [*chosen, *noun, comma(chosen[0]), negation, *rejected, *noun]


def choose_modifier(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "white, not silver" to "white", and "silver, no white" to "white"."""
    at = match.start("not")
    first, second = tokens[match.start()], tokens[at + 1]
    colours = first.category is second.category is WordCategory.COLOUR
    return ([second] if tokens[at].text == "no" else [first]) if colours else None


def drop_prohibition(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Drop "don't stop here" before "stop past the car": the second command says where."""
    values = {tokens[match.start("verb")].value, tokens[match.end()].value}
    return [] if len(values) == 1 else None


def stop_elsewhere(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "don't stop here, further up is better" to "stop further up"."""
    return [*span(tokens, match, "verb"), *span(tokens, match, "chosen")]


def correct_place(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "next to the van, not next to it, behind it" to "behind the van"."""
    first, same = tokens[match.start()], tokens[match.start("same")]
    return [*span(tokens, match, "chosen"), *span(tokens, match, "noun")] if first.value == same.value else None
