"""Interpreter: reads clauses from left to right, chunk by chunk, into a discourse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from grounding.language.semantics.discourse.attachment import attach_phrase, discard_leading_place
from grounding.language.semantics.discourse.command_frames import Discourse
from grounding.language.semantics.discourse.coreference import phrase_of
from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.function_word_rules import (
    handle_auxiliary,
    handle_exception,
    handle_existential,
    handle_infinitive,
    handle_negation,
    handle_particle,
    handle_question,
    handle_relative_pronoun,
    handle_there,
    handle_unknown,
)
from grounding.language.semantics.discourse.mentions import attach_distance
from grounding.language.semantics.discourse.spatial_rules import (
    handle_away,
    handle_between,
    handle_distance,
    handle_ego_place,
    handle_here,
    handle_lane,
    handle_of,
    handle_relation,
    handle_side,
)
from grounding.language.semantics.discourse.verb_rules import (
    handle_branch,
    handle_direction,
    handle_meanwhile,
    handle_other_verb,
    handle_verb,
)
from grounding.language.syntax.clauses import Clause
from grounding.language.syntax.noun_phrases import NounPhrase, chunk
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory
from grounding.query import Referent

_HANDLERS: Mapping[WordCategory, Callable[[DiscourseState, Token], None]] = {
    WordCategory.VERB: handle_verb,
    WordCategory.NONDRIVE: handle_other_verb,
    WordCategory.MEANWHILE: handle_meanwhile,
    WordCategory.DIRECTION: handle_direction,
    WordCategory.BRANCH: handle_branch,
    WordCategory.RELATION: handle_relation,
    WordCategory.BETWEEN: handle_between,
    WordCategory.OF: handle_of,
    WordCategory.SIDE: handle_side,
    WordCategory.WHERE: handle_ego_place,
    WordCategory.HERE: handle_here,
    WordCategory.LANE: handle_lane,
    WordCategory.DISTANCE: handle_distance,
    WordCategory.AWAY: handle_away,
    WordCategory.NOT: handle_negation,
    WordCategory.EXCEPT: handle_exception,
    WordCategory.WHICH: handle_relative_pronoun,
    WordCategory.BE: handle_auxiliary,
    WordCategory.AUX: handle_auxiliary,
    WordCategory.EXISTS: handle_existential,
    WordCategory.QUESTION: handle_question,
    WordCategory.THERE: handle_there,
    WordCategory.TO: handle_infinitive,
    WordCategory.OUT: handle_particle,
    WordCategory.UNKNOWN: handle_unknown,
}


def interpret(clauses: Sequence[Clause], antecedent: Referent | None = None) -> Discourse:
    """Return the discourse of the clauses of a text; pronouns may refer to an antecedent from before the text."""
    state = DiscourseState()
    if antecedent is not None:
        state.discourse.mentions.append((phrase_of(antecedent), "context"))
    for clause in clauses:
        state.previous_frame, state.frame, state.clause = state.frame or state.previous_frame, None, clause
        state.clear()
        state.off_topic = clause.connective == "unless"
        if clause.starts_sentence:
            discard_leading_place(state)
        state.remaining = list(chunk(clause.tokens))
        while state.remaining:
            part = state.remaining.pop(0)
            if isinstance(part, NounPhrase):
                attach_phrase(state, part)
            elif handler := _HANDLERS.get(part.category):
                handler(state, part)
        attach_distance(state, "travel_or_gap")
    return state.discourse
