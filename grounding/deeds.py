"""Clauses -> story: read from left to right, part by part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from grounding import places, verbs
from grounding.clauses import Clause
from grounding.grammar import Phrase, parts
from grounding.kinds import Kind
from grounding.story import Story
from grounding.telling import Telling
from grounding.tokens import Token

_HANDLERS: Mapping[Kind, Callable[[Telling, Token], None]] = {
    Kind.VERB: verbs.verb,
    Kind.NONDRIVE: verbs.other_verb,
    Kind.MEANWHILE: verbs.meanwhile,
    Kind.DIRECTION: verbs.turned,
    Kind.RELATION: places.relation,
    Kind.BETWEEN: places.between,
    Kind.OF: places.of,
    Kind.SIDE: places.side,
    Kind.WHERE: places.where,
    Kind.LANE: places.lane,
    Kind.DISTANCE: places.distance,
    Kind.AWAY: places.away,
    Kind.NOT: places.negation,
    Kind.EXCEPT: places.exception,
    Kind.WHICH: places.which,
    Kind.BE: places.helper,
    Kind.AUX: places.helper,
    Kind.EXISTS: places.exists,
    Kind.QUESTION: places.question,
    Kind.THERE: places.there,
    Kind.TO: places.purpose,
    Kind.OUT: places.out,
    Kind.UNKNOWN: places.unknown,
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
