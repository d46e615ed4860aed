"""Clauses -> story: read from left to right, part by part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from grounding.language import spatial_rules, verb_rules
from grounding.language.attachment import Telling
from grounding.language.clauses import Clause
from grounding.language.command_frames import Story
from grounding.language.noun_phrases import Phrase, parts
from grounding.language.tokenizer import Token
from grounding.language.word_categories import Kind

_HANDLERS: Mapping[Kind, Callable[[Telling, Token], None]] = {
    Kind.VERB: verb_rules.verb,
    Kind.NONDRIVE: verb_rules.other_verb,
    Kind.MEANWHILE: verb_rules.meanwhile,
    Kind.DIRECTION: verb_rules.turned,
    Kind.RELATION: spatial_rules.relation,
    Kind.BETWEEN: spatial_rules.between,
    Kind.OF: spatial_rules.of,
    Kind.SIDE: spatial_rules.side,
    Kind.WHERE: spatial_rules.where,
    Kind.LANE: spatial_rules.lane,
    Kind.DISTANCE: spatial_rules.distance,
    Kind.AWAY: spatial_rules.away,
    Kind.NOT: spatial_rules.negation,
    Kind.EXCEPT: spatial_rules.exception,
    Kind.WHICH: spatial_rules.which,
    Kind.BE: spatial_rules.helper,
    Kind.AUX: spatial_rules.helper,
    Kind.EXISTS: spatial_rules.exists,
    Kind.QUESTION: spatial_rules.question,
    Kind.THERE: spatial_rules.there,
    Kind.TO: spatial_rules.purpose,
    Kind.OUT: spatial_rules.out,
    Kind.UNKNOWN: spatial_rules.unknown,
}


def tell(clauses: Sequence[Clause]) -> Story:
    """The story of the clauses of a text."""
    told = Telling()
    for clause in clauses:
        told.before, told.deed, told.clause = told.deed or told.before, None, clause
        told.clear()
        if clause.new:
            told.forget_place()
        told.rest = list(parts(clause.tokens))
        while told.rest:
            part = told.rest.pop(0)
            if isinstance(part, Phrase):
                told.phrase(part)
            elif handler := _HANDLERS.get(part.kind):
                handler(told, part)
        told.spend_gap("way")
    return told.story
