"""Attachment of noun phrases: subject, object or target, modifier of an earlier noun phrase, or exclusion."""

from __future__ import annotations

from grounding.language.semantics.discourse.appositions import attach_apposition, name_contrast
from grounding.language.semantics.discourse.command_frames import ENTERABLE, CommandFrame
from grounding.language.semantics.discourse.coreference import name_by_order
from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.mentions import add_mention, attach_distance, exclude, refine
from grounding.language.semantics.discourse.relation_attachment import (
    TARGET_KINDS,
    attach_kerb,
    attach_related,
    attach_target,
)
from grounding.language.semantics.discourse.repairs import replace_target
from grounding.language.syntax.clauses import TEMPORAL
from grounding.language.syntax.noun_phrases import PLACE_KINDS, VEHICLE_KINDS, NounPhrase

_EGO_WITH_VERB = ("i'm", "im", "we're", "you're")
# Verbs whose object is a thing even if it is a person: "pick up my friend next to the car".
_PEOPLE_AS_THINGS = ("stop", "take", "leave", "get")


def attach_phrase(state: DiscourseState, phrase: NounPhrase) -> None:
    """Attach a noun phrase by the open arguments and flags of the state."""
    host = state.open_phrase
    if state.open_relation is None and host is not None and host.postmodifiers[-1:] == ["nearest"]:
        state.open_relation = "toward"  # "the car nearest the van"
    own_car = phrase.kind == "ego" and " " in phrase.head and state.auxiliary and not state.open_relation
    if own_car:  # "that is our car"
        noun = phrase.head.split()[-1]
        phrase = NounPhrase(kind="vehicle", noun=noun, head=noun, start=phrase.start)
    name_by_order(state.discourse, phrase)
    if phrase.kind == "adjective" and phrase.colour and _is_other_end(state):
        phrase.kind = "one"  # "between the red one and the black"
    if phrase.kind == "ego":
        _attach_ego(state, phrase)
    elif state.is_repair and state.frame is None and replace_target(state, phrase):
        pass
    elif phrase.kind == "adjective":
        _attach_adjective(state, phrase)
    elif state.negated and state.existential:  # "there is no traffic"
        state.negated = False
        add_mention(state, phrase, "landmark")
    elif state.negated and _is_negated(state, phrase):
        _attach_negated(state, phrase)
    elif state.open_relation:
        attach_related(state, state.open_relation, phrase)
    elif state.frame is None:
        _attach_without_verb(state, phrase)
    elif state.event_stated or state.off_topic:
        add_mention(state, phrase, "landmark")
    else:
        _attach_after_verb(state, state.frame, phrase)


def _is_other_end(state: DiscourseState) -> bool:
    """Return whether a noun phrase is the second one of "between"."""
    frame = state.frame
    if frame is None or frame.target is None or state.open_relation is not None or state.last_relation != "between":
        return False
    return not any(relation == "between" for relation, _ in frame.landmarks)


def discard_leading_place(state: DiscourseState) -> None:
    """Turn a place without its verb into a mere mention: "there he is, in the van. stop"."""
    target = state.leading_frame.target
    state.leading_frame.lane = None
    if state.leading_frame.relation not in ("in", "on", "with"):
        return
    mentions = state.discourse.mentions
    state.discourse.mentions = [(phrase, "stated" if phrase is target else role) for phrase, role in mentions]
    state.leading_frame = CommandFrame()


def _attach_ego(state: DiscourseState, phrase: NounPhrase) -> None:
    """Make the ego the subject; "next to us" adds no information."""
    after_relation, state.open_relation = state.open_relation not in (None, "at", "same_as"), None
    if after_relation:
        state.open_distance_m = None
    elif state.in_relative_clause:
        state.subject, state.event_stated = "ego", True  # "the van that we passed"
    else:
        state.subject = "ego"
        state.auxiliary = phrase.head if phrase.head in _EGO_WITH_VERB else ""


def _attach_adjective(state: DiscourseState, phrase: NounPhrase) -> None:
    """Attach a predicate adjective to its noun: "that is red", "which is closest to us"."""
    subject = state.other_subject if state.auxiliary and not state.in_relative_clause else None
    host = subject or state.open_phrase or state.other_subject
    clothing = state.open_relation in ("in", "with") and host is not None and host.kind == "person"
    if host is None or state.event_stated or clothing or host.kind in ("thing", *PLACE_KINDS):
        state.open_relation = None if clothing else state.open_relation  # "the man in black"
        return
    if state.negated:
        host.excluded.append((phrase.colour, tuple(phrase.qualifiers)))
        state.negated = False
    else:
        refine(state, host, phrase)


def _is_negated(state: DiscourseState, phrase: NounPhrase) -> bool:
    """Return whether the open negation applies to the noun phrase and not to a later verb."""
    if state.frame is None and (state.open_relation or phrase.kind != "pronoun"):
        return True
    return state.open_phrase is not None and phrase.head not in ("he", "she", "they")


def _attach_negated(state: DiscourseState, phrase: NounPhrase) -> None:
    """Attach a negated noun phrase: a missing part, a place that the next words define, or an exclusion."""
    place = phrase.kind in PLACE_KINDS or (phrase.kind == "one" and not _has_vehicle(state))
    if state.in_relative_clause and phrase.kind not in VEHICLE_KINDS:
        state.negated = False  # "who has no lights"
        add_mention(state, phrase, "landmark")
    elif place and state.open_relation is None and state.next_kind in ("relation", "between"):
        state.discourse.mentions.append((phrase, "denied"))
        state.open_phrase = phrase  # "except the place behind the bus"
    else:
        exclude(state, state.open_relation, phrase, "denied")


def _has_vehicle(state: DiscourseState) -> bool:
    return any(phrase.kind in VEHICLE_KINDS for phrase, _ in state.discourse.mentions)


def _attach_without_verb(state: DiscourseState, phrase: NounPhrase) -> None:
    """Attach a noun phrase before any verb or relation: an apposition, or the subject of a statement."""
    if attach_apposition(state, phrase):
        return
    subject = state.other_subject
    predicate = subject is not None and bool(state.auxiliary)
    if predicate and phrase.kind == "one" and name_contrast(state, phrase):
        add_mention(state, phrase, "stated")  # "it is not the red car, it is the blue one"
    elif subject is not None and predicate and phrase.kind == "one":
        refine(state, subject, phrase)  # "his car is the black one"
    elif subject is not None and predicate and subject.kind == "one" and phrase.kind == "vehicle":
        subject.take_noun(phrase)  # "the blue one is my car"
    elif subject is not None and not (predicate and subject.kind == "pronoun"):
        add_mention(state, phrase, "landmark")
    else:
        add_mention(state, phrase, "event" if state.clause.connective in TEMPORAL else "stated")
        state.subject = phrase
        state.auxiliary = "is" if phrase.kind == "pronoun" and phrase.head.endswith("'s") else state.auxiliary
        for value in state.fronted_qualifiers:
            phrase.add_qualifier(value)
        state.fronted_qualifiers = []


def _attach_after_verb(state: DiscourseState, frame: CommandFrame, phrase: NounPhrase) -> None:
    """Attach a noun phrase that follows a verb without a relation."""
    noun = state.open_phrase
    no_target = frame.target is None
    first_between = bool(frame.landmarks) and frame.landmarks[-1][0] == "between"
    if no_target and state.last_relation == "between" and first_between and phrase.kind in VEHICLE_KINDS:
        attach_target(state, "between", phrase)  # "between the lamp post and the van"
    elif frame.verb_class in ("give", "leave") and (
        phrase.kind in PLACE_KINDS or (frame.target and phrase.kind == "thing")
    ):
        frame.landmarks.append(("object", phrase))
        add_mention(state, phrase, "landmark")
    elif no_target and phrase.kind == "vehicle" and noun is not None and noun.kind in PLACE_KINDS:
        # "The road the van came from", "the direction the van goes".
        state.in_relative_clause, state.subject = False, None
        attach_target(state, "same_as" if noun.head in ("direction", "way") else "at", phrase)
    elif (no_target and frame.direct_object is None) or (
        frame.verb_class == "take" and phrase.kind == "pronoun" and noun is None
    ):
        _attach_object(state, frame, phrase)
    elif _is_other_end(state) and frame.target is not None:
        if phrase.kind == "one" and state.next_kind != "relation":  # not "the white van and the one behind it"
            phrase.take_noun(frame.target)  # "between the silver car and the black one"
        if phrase.kind == "one":
            phrase.kind = phrase.noun = "vehicle"  # "between the silver one and the black one"
        frame.landmarks.append(("between", phrase))
        add_mention(state, phrase, "landmark")
    elif phrase.kind == "one" and frame.target is not None:
        refine(state, frame.target, phrase)
    else:
        add_mention(state, phrase, "stated")
        state.subject = phrase


def _attach_object(state: DiscourseState, frame: CommandFrame, phrase: NounPhrase) -> None:
    """Attach the object of a verb as target, landmark or exclusion."""
    place = _last_place(state) if frame.verb_class == "take" and phrase.kind == "pronoun" else None
    if frame.verb_class == "take" and phrase.kind == "one":
        _name_road(state, phrase)
    if frame.negated and frame.verb_class not in ("give_way", "wait"):
        frame.forbidden_target = phrase
        exclude(state, None, phrase)
    elif frame.verb_class == "take" and phrase.kind == "one" and state.next_kind == "relation" and _last_place(state):
        # "Not the space behind the van, take the one behind the truck".
        frame.landmarks.append(("object", NounPhrase(kind="spot", noun="parking_spot", head=phrase.head)))
    elif place is not None:  # "take it"
        frame.landmarks.append(("object", place))
    elif phrase.kind in TARGET_KINDS and not (phrase.kind == "person" and frame.verb_class in _PEOPLE_AS_THINGS):
        frame.target, frame.target_is_object = phrase, True
        add_mention(state, phrase, "target")
    else:
        reaches = frame.verb.endswith(" to") and phrase.kind == "thing"  # "creep up to the stop line"
        if reaches and attach_kerb(state, "toward", phrase):
            return
        frame.landmarks.append(("toward" if reaches else "object", phrase))
        add_mention(state, phrase, "landmark")
    attach_distance(state, "gap")


def _name_road(state: DiscourseState, phrase: NounPhrase) -> None:
    """Give "one" the noun of the road or turning that was mentioned last: "not this street, the next one"."""
    last = state.discourse.mentions[-1][0] if state.discourse.mentions else None
    if last is not None and last.noun in ENTERABLE and last.kind in ("region", "thing"):
        phrase.take_noun(last)


def _last_place(state: DiscourseState) -> NounPhrase | None:
    """Return the place mentioned last; subjects of statements first ("there is an entrance to a lot")."""
    places = [(phrase, role) for phrase, role in reversed(state.discourse.mentions) if phrase.kind in PLACE_KINDS]
    stated = [phrase for phrase, role in places if role == "stated"]
    return next(iter([*stated, *(phrase for phrase, _ in places)]), None)
