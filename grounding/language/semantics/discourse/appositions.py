"""Appositions: noun phrases that refine an earlier one: "behind the silver one, the hatchback"."""

from __future__ import annotations

from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.mentions import refine
from grounding.language.syntax.noun_phrases import VEHICLE_KINDS, NounPhrase
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory

_PREDICATES = (WordCategory.VERB, WordCategory.BE, WordCategory.AUX)


def attach_apposition(state: DiscourseState, phrase: NounPhrase) -> bool:
    """Attach a noun phrase without verb and relation to the one before; return whether it is an apposition."""
    no_predicate = not any(isinstance(part, Token) and part.category in _PREDICATES for part in state.remaining)
    if phrase.kind == "vehicle":
        return no_predicate and _name_one(state, phrase)
    if phrase.kind != "one" or state.clause.starts_sentence:
        return False
    before = state.previous_frame
    if before is None:
        last = state.discourse.mentions[-1][0] if state.discourse.mentions else None
        if not no_predicate or state.other_subject is not None or last is None or last.kind not in VEHICLE_KINDS:
            return False
        refine(state, last, phrase)  # "that is my car, the blue one"
        return True
    if before.target is not None and no_predicate:
        refine(state, before.target, phrase)
        return True
    if before.target is None and before.direct_object is not None and state.next_kind == "relation":
        state.open_phrase = before.direct_object  # "take the exit, the one behind the bus"
        return True
    return False


def _name_one(state: DiscourseState, phrase: NounPhrase) -> bool:
    """Give a noun to the "one" mentioned last; return whether it had none."""
    mentioned = [other for other, _ in state.discourse.mentions]
    first = phrase.start == state.clause.tokens[0].start
    if not first or not mentioned or mentioned[-1].kind != "one":
        return False
    if any(one.kind in VEHICLE_KINDS for one in mentioned):
        return False
    phrase.merge_into(mentioned[-1])
    state.open_phrase = mentioned[-1]
    return True


def name_contrast(state: DiscourseState, phrase: NounPhrase) -> bool:
    """Give "one" the noun of an excluded vehicle; return whether a vehicle is excluded.

    Example: "it is not the red car, it is the blue one".
    """
    vehicles = [(other, role) for other, role in state.discourse.mentions if other.kind in VEHICLE_KINDS]
    if not vehicles or vehicles[-1][1] not in ("excluded", "denied"):
        return False
    phrase.take_noun(vehicles[-1][0])
    return True
