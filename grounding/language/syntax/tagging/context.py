"""Context of a token: categories of its neighbours, and the word groups that the tagging rules share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import DETERMINERS, HEADS, MODIFIERS, WordCategory

# Words inside a noun phrase, words that begin one, words before a command, words that end a clause.
PHRASE_WORDS = MODIFIERS | HEADS | {WordCategory.UNKNOWN, WordCategory.NUMBER}
PHRASE_STARTS = DETERMINERS | PHRASE_WORDS | {WordCategory.THAT}
COMMAND_STARTS = frozenset(
    (WordCategory.EGO, WordCategory.BREAK, WordCategory.COMMA, WordCategory.THEN, WordCategory.AND)
)
CLAUSE_ENDS = frozenset((WordCategory.BREAK, WordCategory.THEN))
TURNS = ("turn left", "turn right", "turn around")


def category_at(tokens: Sequence[Token], i: int) -> WordCategory:
    """Return the category of a token, BREAK beyond the ends."""
    return tokens[i].category if -len(tokens) <= i < len(tokens) else WordCategory.BREAK


def clause_start(tokens: Sequence[Token]) -> int:
    """Return the index of the first token of the current clause."""
    ends = [i for i, token in enumerate(tokens) if token.category in CLAUSE_ENDS | {WordCategory.COMMA}]
    return ends[-1] + 1 if ends else 0


def is_adjective(before: Sequence[Token], verb: Token, after: Sequence[Token]) -> bool:
    """Return whether a verb form modifies a noun: "parked black car", "the moving van"."""
    if verb.form not in ("ing", "past") or not verb.state or category_at(after, 0) not in MODIFIERS | HEADS:
        return False
    return verb.form == "past" or category_at(before, -1) in DETERMINERS | MODIFIERS | {
        WordCategory.RELATION,
        WordCategory.THAT,
    }


def ends_waiting(before: Sequence[Token], after: Sequence[Token]) -> bool:
    """Return whether a place between tokens is that of somebody after an awaited event: "until they are | over"."""
    last = next((token for token in after if token.category not in DETERMINERS), None)
    ends = CLAUSE_ENDS | {WordCategory.COMMA, WordCategory.AND, WordCategory.REGION, WordCategory.THING}
    conjunctions = [token for token in before if token.category is WordCategory.SUB]
    return (
        (category_at(before, -1) is WordCategory.BE or _is_short_for_be(before[-1:]))
        and bool(conjunctions)
        and conjunctions[-1].value in ("until", "when")
        and (last is None or last.category in ends)
        and (
            category_at(before, -2) in HEADS | {WordCategory.PRONOUN, WordCategory.BE}
            or _is_short_for_be(before[-1:])
        )
    )


def _is_short_for_be(last: Sequence[Token]) -> bool:
    """Return whether a token is a pronoun with its verb: "they're"."""
    return any(one.category is WordCategory.PRONOUN and one.text.endswith(("'s", "'re")) for one in last)


def as_passing(token: Token) -> Token:
    """Return a word as a verb that tells that somebody has passed."""
    return replace(token, category=WordCategory.VERB, value="none", form="past", state="", event="pass")
