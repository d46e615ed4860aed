"""Negations: "avoid parking", "a non-black car", "near no truck" as "not X"."""

from __future__ import annotations

import re
from dataclasses import replace

from grounding.language.semantics.contrasts.letters import comma, letter, span
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory


def is_ending(token: Token) -> bool:
    """Return whether a verb ends an action: "stop following", "avoid parking"."""
    return token.category is WordCategory.VERB and token.value in ("stop", "avoid") and " " not in token.text


def negate_ended(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "avoid parking" to "not parking", and "stop parking and go" to "not parking, then go"."""
    (first, second), after = tokens[match.start() :][:2], span(tokens, match, "after")
    if not is_ending(first) or second.form != "ing":
        return None
    if after and letter(after[-1]) == "A":
        after[-1] = replace(after[-1].with_category(WordCategory.THEN), text="then")
    return [first.with_category(WordCategory.NOT), replace(second, form=""), *after]


def negate_modifier(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "a non-black car" to "a car that is not black"."""
    negation = span(tokens, match, "not")
    which = negation[0].with_category(WordCategory.WHICH, "that is")
    before, noun, modifier = (span(tokens, match, group) for group in ("before", "noun", "modifier"))
    return [*before, *noun, replace(which, text="that is"), *negation, *modifier]


def end_negation(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "don't stop until you are past the bus" to "stop past the bus"."""
    verb, relation = tokens[match.start() + 1 :][:2]
    return [verb, relation] if relation.text.startswith(("until", "till")) else None


def negate_place(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "near no truck" and "near anything but a truck" to ", not near a truck"."""
    relation, negation, noun = (span(tokens, match, group) for group in ("relation", "not", "noun"))
    named = [_vehicle(token) if token.category is WordCategory.ONE else token for token in noun]
    return [comma(relation[0]), negation[0].with_category(WordCategory.NOT), *relation, *named]


def negate_presence(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "where there are no people" and "without people near" to ", not near people"."""
    negation, noun, near = (span(tokens, match, group) for group in ("not", "noun", "near"))
    first = tokens[match.start()]
    exists = first.value == "at" and tokens[match.start() + 1].category is WordCategory.EXISTS
    if not exists and (not near or near[0].value != "near" or first.value not in ("", "with")):
        return None
    where = replace(negation[0].with_category(WordCategory.RELATION, "near"), text="near")
    return [comma(first), replace(negation[0].with_category(WordCategory.NOT), text="not"), where, *noun]


def stop_short(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "stop no further than the van" to "stop before the van, not past it"."""
    relation, negation, noun = (span(tokens, match, group) for group in ("relation", "not", "noun"))
    if relation[0].value != "past":
        return None
    return [
        relation[0].with_category(WordCategory.RELATION, "before"),
        *noun,
        comma(relation[0]),
        *negation,
        *relation,
        *noun,
    ]


def measure_from(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "six feet away from" to "six feet near": the distance tells how far."""
    return [tokens[match.start()].with_category(WordCategory.RELATION, "near")]


def negate_nearness(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "far from the bus" to ", not near the bus"."""
    far, noun = span(tokens, match, "far"), span(tokens, match, "noun")
    near = far[0].with_category(WordCategory.RELATION, "near")
    return [comma(far[0]), far[0].with_category(WordCategory.NOT), near, *noun]


def _vehicle(token: Token) -> Token:
    return replace(token.with_category(WordCategory.NOUN, "vehicle"), text="vehicle", written="vehicle")
