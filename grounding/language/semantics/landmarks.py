"""Landmarks of a query: the things that locate its goal or its referent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import cast

from grounding.language.semantics.discourse.command_frames import Discourse
from grounding.language.semantics.main_action import Intent
from grounding.language.syntax.noun_phrases import NounPhrase
from grounding.query import Landmark, LandmarkRelation, LandmarkRole
from grounding.vocabulary import RELATIONS

# Relations without a place.
NOT_SPATIAL = ("with", "of", "for", "object")
# Endings of plurals -> of singulars, the first match counts.
_PLURALS: tuple[tuple[str, str], ...] = (
    ("people", "person"),
    ("men", "man"),
    ("children", "child"),
    ("ies", "y"),
    ("sses", "ss"),
    ("ches", "ch"),
    ("s", ""),
)


def landmarks_of(
    discourse: Discourse, intents: Sequence[Intent], main: Intent, referent: NounPhrase | None
) -> Iterator[Landmark]:
    """Yield the landmarks of all frames (those of the main intent first), of a person and of the referent."""
    others = (intent for intent in intents if intent is not main and intent.frame is not main.frame)
    for intent in (main, *others):
        last, meant = len(intent.frame.landmarks) - 1, _thing_meant(intent)
        if meant is not None:
            yield _landmark(meant, intent.frame.relation, "goal")
        for i, (written, thing) in enumerate(intent.frame.landmarks):
            if meant is not None and thing.noun == meant.noun:
                continue
            crosses = intent.frame.direction == "straight" or intent.frame.manoeuvre == "onward"
            entered = written == "along" or (written == "object" and (intent.action == "turn" or crosses))
            relation = "into" if entered else written
            if intent.frame.inverse_relation and i == last:
                yield _landmark(thing, intent.frame.inverse_relation, "inverse")
            elif relation not in NOT_SPATIAL and _is_landmark(thing) and not _is_manner(relation, thing):
                yield from _ends(relation, thing, referent) or (_landmark(thing, relation, "goal"),)
        turns = intent.frame.direction in ("left", "right") and referent is None
        if turns and "behind_ego" in intent.frame.goal_qualifiers:
            yield Landmark("road", "into", qualifiers=("behind_ego",))  # "turn left where we just came past"
        named = intent.frame.lane in ("left_lane", "middle_lane", "right_lane") and intent.action == "change_lane"
        if intent.frame.lane and (intent.action == "other" or named):
            where: LandmarkRelation = "into" if intent.action == "change_lane" else "in"
            yield Landmark("lane", where, qualifiers=(intent.frame.lane,))
    person = main.target
    if person is not None and person.kind == "person" and person is not referent:
        for relation, other in person.related:  # "the pedestrians behind it"
            if other is referent or other.kind == "pronoun":
                yield _landmark(person, relation, "inverse")
    for relation, other in referent.related if referent is not None else ():
        beside = other_vehicle(discourse, referent, other) if other.kind == "pronoun" else other
        if beside is not None and beside is not referent and relation not in NOT_SPATIAL and _is_landmark(beside):
            yield _landmark(beside, relation, "referent")


def _ends(relation: str, thing: NounPhrase, referent: NounPhrase | None) -> tuple[Landmark, ...]:
    """Return the other end of "between" and how it stands to the referent: "the van and the car behind it"."""
    if relation != "between" or referent is None:
        return ()
    end, related = (
        _landmark(thing, relation, "goal"),
        [one for one, other in thing.related if other.kind == "pronoun"],
    )
    if "next" in end.qualifiers and not related:  # "between the van and the next car"
        end, related = replace(end, qualifiers=tuple(one for one in end.qualifiers if one != "next")), ["past"]
    return end, *(_landmark(referent, one, "partner") for one in related)


def other_vehicle(discourse: Discourse, referent: NounPhrase | None, pronoun: NounPhrase) -> NounPhrase | None:
    """Return the vehicle named before a pronoun that is not the one it describes: "the car in front of it"."""
    mentions = [one for one, _ in discourse.mentions]
    before = mentions[: mentions.index(pronoun)] if pronoun in mentions else []
    others = (one for one in reversed(before) if one.kind == "vehicle" and one is not referent)
    return next(others, None)


def _thing_meant(intent: Intent) -> NounPhrase | None:
    """Return the thing that the pronoun of a place stands for: "someone's on the crossing, stop before it"."""
    target, frame = intent.target, intent.frame
    named = target is not None and target.kind == "thing" and frame.relation in RELATIONS
    return target if named and frame.target is not target else None


def _is_landmark(thing: NounPhrase) -> bool:
    """Return whether a noun phrase names a thing that a query may hold."""
    return bool(thing.noun) and thing.kind in ("vehicle", "thing", "person", "region") and thing.noun != "side"


def _is_manner(relation: str, thing: NounPhrase) -> bool:
    """Return whether a phrase describes the manner: "like a snail"."""
    return relation == "same_as" and thing.kind == "thing"


def _landmark(thing: NounPhrase, relation: str, of: LandmarkRole) -> Landmark:
    relation = cast(LandmarkRelation, relation)
    return Landmark(written_noun(thing), relation, of, colour=thing.colour, qualifiers=tuple(thing.qualifiers))


def written_noun(phrase: NounPhrase) -> str:
    """Return the noun of a vehicle; for other things the written word in the singular (street, not road)."""
    if phrase.kind == "vehicle":
        return phrase.noun
    word = phrase.head
    if word.startswith("where "):
        return phrase.noun  # "where the road meets the next one"
    if phrase.number != 1:
        word = next((word.removesuffix(many) + one for many, one in _PLURALS if word.endswith(many)), word)
    written = word.replace(" ", "_")
    return phrase.noun if phrase.noun.endswith(written) else written
