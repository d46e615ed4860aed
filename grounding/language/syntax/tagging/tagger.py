"""Tagger: the category of each token in context."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import NamedTuple

from grounding.language.syntax.quantities import merge_quantities
from grounding.language.syntax.tagging.context import CLAUSE_ENDS, category_at
from grounding.language.syntax.tagging.verb_rules import (
    tag_aux,
    tag_be,
    tag_extra,
    tag_nondrive,
    tag_noun,
    tag_out,
    tag_region,
    tag_relation,
    tag_thing,
    tag_verb,
)
from grounding.language.syntax.tagging.word_rules import (
    drop,
    tag_correct,
    tag_determiner,
    tag_direction,
    tag_ego,
    tag_except,
    tag_exists,
    tag_joint,
    tag_not,
    tag_number,
    tag_one,
    tag_ordinal,
    tag_person,
    tag_possessive,
    tag_question,
    tag_shade,
    tag_side,
    tag_superlative,
    tag_that,
    tag_then,
    tag_to,
    tag_unit,
)
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import DETERMINERS, HEADS, MODIFIERS, WordCategory

# Words without a part in the sentence.
_DROPPED = (WordCategory.FILLER, WordCategory.GREETING)
# People as whom the ego is addressed, too.
_ADDRESSEES = ("lad", "lads", "mate", "pal", "dude", "love", "buddy")
_PLACES_OF_SUBJECTS = (WordCategory.OUT, WordCategory.WHERE, WordCategory.NOT)
_AFTER_CONNECTIVE = frozenset((WordCategory.THEN, WordCategory.AND, WordCategory.EXCEPT, WordCategory.ORDINAL))


class _Compound(NamedTuple):
    """Two words that the lexicon knows as one phrase, and the categories after which they are two.

    Examples: "when the bus stops", "turn left, then right after the van".
    """

    after: frozenset[WordCategory]
    categories: tuple[WordCategory, WordCategory]
    values: tuple[str, str]
    event: str = ""

    def split(self, token: Token) -> tuple[Token, Token]:
        """Return both words."""
        first, second = token.text.split()
        middle = token.start + len(first)
        form = "s" if self.event else ""
        return (
            Token(
                category=self.categories[0],
                value=self.values[0],
                text=first,
                written=first,
                start=token.start,
                end=middle,
            ),
            Token(
                category=self.categories[1],
                value=self.values[1],
                text=second,
                written=second,
                start=middle + 1,
                end=token.end,
                form=form,
                state="stopped",
                event=self.event,
            ),
        )


_COMPOUNDS = {
    "bus stops": _Compound(
        DETERMINERS | {WordCategory.COLOUR, WordCategory.THAT},
        (WordCategory.NOUN, WordCategory.VERB),
        ("bus", "stop"),
        "stop",
    ),
    "right after": _Compound(_AFTER_CONNECTIVE, (WordCategory.DIRECTION, WordCategory.SUB), ("right", "after")),
    "right before": _Compound(_AFTER_CONNECTIVE, (WordCategory.DIRECTION, WordCategory.SUB), ("right", "before")),
}
# Tagged tokens before, the token, tokens after -> the token with its category in context.
_Rule = Callable[[Sequence[Token], Token, Sequence[Token]], Token]
_RULES: dict[WordCategory, _Rule] = {
    WordCategory.THAT: tag_that,
    WordCategory.VERB: tag_verb,
    WordCategory.SHADE: tag_shade,
    WordCategory.ONE: tag_one,
    WordCategory.DIRECTION: tag_direction,
    WordCategory.SIDE: tag_side,
    WordCategory.ORDINAL: tag_ordinal,
    WordCategory.SUPERLATIVE: tag_superlative,
    WordCategory.THE: tag_determiner,
    WordCategory.ANY: tag_determiner,
    WordCategory.POSSESSIVE: tag_possessive,
    WordCategory.PERSON: tag_person,
    WordCategory.TO: tag_to,
    WordCategory.QUESTION: tag_question,
    WordCategory.EXISTS: tag_exists,
    WordCategory.COMMA: tag_joint,
    WordCategory.AND: tag_joint,
    WordCategory.REGION: tag_region,
    WordCategory.NONDRIVE: tag_nondrive,
    WordCategory.NUMBER: tag_number,
    WordCategory.THEN: tag_then,
    WordCategory.RELATION: tag_relation,
    WordCategory.NOUN: tag_noun,
    WordCategory.AUX: tag_aux,
    WordCategory.BE: tag_be,
    WordCategory.OUT: tag_out,
    WordCategory.UNIT: tag_unit,
    WordCategory.ABOUT: drop,
    WordCategory.EXTRA: tag_extra,
    WordCategory.THING: tag_thing,
    WordCategory.MAKE: tag_thing,
    WordCategory.PART: tag_thing,
    WordCategory.EGO: tag_ego,
    WordCategory.CORRECT: tag_correct,
    WordCategory.NOT: tag_not,
    WordCategory.EXCEPT: tag_except,
}


def _is_contraction(after: Sequence[Token]) -> bool:
    """Return whether "'s" before these tokens is a verb: "that van's gone", but not "the man's parked car"."""
    first, second = category_at(after, 0), category_at(after, 1)
    if first is WordCategory.VERB:
        return after[0].form in ("ing", "past") and second not in MODIFIERS | HEADS
    return first in _PLACES_OF_SUBJECTS or (first in MODIFIERS and second in CLAUSE_ENDS | {WordCategory.COMMA})


def _split_contraction(token: Token, following: Token) -> tuple[Token, Token]:
    """Return the noun and the verb of "van's": "has" before an event that is over, else "is"."""
    finished = following.form == "past" and following.state not in ("parked", "stopped")
    noun = replace(token, text=token.text.removesuffix("'s"), form="", end=max(token.start, token.end - 2))
    verb = replace(token.with_category(WordCategory.BE), text="has" if finished else "is", start=noun.end)
    return noun, verb


def _as_person(before: Token | None, token: Token) -> Token:
    """Return a form of address after an article as a person: "there's a lad stepping out"."""
    named = token.text in _ADDRESSEES and before is not None and before.category is WordCategory.ANY
    return token.with_category(WordCategory.PERSON, "person") if named else token


def _as_reversing(token: Token, after: Token | None) -> Token:
    """Return "back" before a distance as a verb: "back five metres"."""
    measured = token.text == "back" and after is not None and after.category is WordCategory.DISTANCE
    return token.with_category(WordCategory.VERB, "other back") if measured else token


def tag(tokens: Sequence[Token]) -> list[Token]:
    """Return the tokens with their category in context, quantities merged and fillers removed."""
    tagged: list[Token] = []
    quantities = merge_quantities(tokens)
    merged = [_as_person(before, token) for before, token in zip([None, *quantities], quantities, strict=False)]
    merged = [_as_reversing(token, after) for token, after in zip_longest(merged, merged[1:]) if token is not None]
    kept = [token for token in merged if token.category not in _DROPPED]
    for i, token in enumerate(kept):
        after = kept[i + 1 : i + 6]
        if token.form == "own" and token.category in HEADS and _is_contraction(after):
            token, verb = _split_contraction(token, after[0])
            rule = _RULES.get(token.category)
            tagged += [rule(tagged, token, [verb, *after]) if rule else token, verb]
        elif (compound := _COMPOUNDS.get(token.text)) is not None and category_at(tagged, -1) in compound.after:
            tagged += compound.split(token)
        elif (rule := _RULES.get(token.category)) is not None:
            tagged.append(rule(tagged, token, after))
        else:
            tagged.append(token)
    return [token for token in tagged if token.category is not WordCategory.FILLER]
