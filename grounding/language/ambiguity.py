"""Ambiguity: other readings of a query, by the attachment of sides and landmarks and by the meaning of "bike"."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from grounding.query import LandmarkRole, Query
from grounding.vocabulary import KNOWN_NOUNS, ORDINALS

MAX_READINGS = 6
_STOPPING_ACTIONS = ("park", "stop", "pull_over")
# Prior of each alternative, relative to the reading that it changes.
_SIDE_OF_GOAL, _AHEAD_OF_VEHICLE, _AHEAD_OF_GOAL = 0.25, 0.3, 0.15
_LANDMARK_ELSEWHERE, _BICYCLE = 0.3, 0.4


def list_alternatives(query: Query, postmodifiers: Sequence[str]) -> list[tuple[Query, float]]:
    """Return the query with score 0 and its alternatives with their log priors, best first.

    `postmodifiers` are the qualifiers after the noun: the left side in "behind the van on the left" may be that of
    the road.
    """
    found = [(query, 0.0)]
    rules: list[tuple[Callable[[Query], Query | None], float]] = [
        (lambda one: _move_side_to_goal(one, postmodifiers), _SIDE_OF_GOAL),
        (_move_landmark, _LANDMARK_ELSEWHERE),
        (_read_bike_as_bicycle, _BICYCLE),
        (_move_ahead_to_vehicle, _AHEAD_OF_VEHICLE),
        (lambda one: _move_ahead_to_goal(one, postmodifiers), _AHEAD_OF_GOAL),
    ]
    for rule, prior in rules:
        changed = [(other, score) for one, score in found if (other := rule(one)) is not None]
        found += [(other, score + math.log(prior)) for other, score in changed]
    return sorted(found, key=lambda pair: -pair[1])[:MAX_READINGS]


def _move_side_to_goal(query: Query, postmodifiers: Sequence[str]) -> Query | None:
    """Attach the side of the vehicle to the goal: "park behind the van on the left"."""
    referent = query.referent
    if referent is None or query.action not in _STOPPING_ACTIONS or query.relation == "none" or query.goal_side:
        return None
    if any(word in (*ORDINALS, "last") for word in referent.qualifiers):
        return None  # "the third car on the left": it is counted there
    for side in ("left", "right"):
        word = f"{side}_side"
        if word in referent.qualifiers and word in postmodifiers:
            kept = tuple(one for one in referent.qualifiers if one != word)
            return replace(query, goal_side=side, referent=replace(referent, qualifiers=kept))
    return None


def _move_landmark(query: Query) -> Query | None:
    """Attach a landmark of the vehicle to the goal, or one of the goal to the vehicle."""
    if query.referent is None or query.landmark != "referent":
        return None
    opposite: dict[LandmarkRole, LandmarkRole] = {"referent": "goal", "goal": "referent"}
    for i, landmark in enumerate(query.secondary):
        # A place has one vehicle: at the goal another is left out. "The car nearest the crossing" is one phrase.
        measure = landmark.relation == "toward" and "nearest" in query.referent.qualifiers
        fixed = landmark.of == "referent" and (landmark.noun in KNOWN_NOUNS or measure)
        if landmark.of in opposite and landmark.relation not in ("between", "into", "in") and not fixed:
            moved = replace(landmark, of=opposite[landmark.of])
            return replace(query, secondary=(*query.secondary[:i], moved, *query.secondary[i + 1 :]))
    return None


def _read_bike_as_bicycle(query: Query) -> Query | None:
    """Read "bike" as a bicycle and not as a motorcycle."""
    referent = query.referent
    if referent is None or referent.noun != "motorcycle" or referent.head not in ("bike", "bikes"):
        return None
    return replace(query, referent=replace(referent, noun="bicycle"))


def _move_ahead_to_vehicle(query: Query) -> Query | None:
    """Attach "ahead" to the vehicle: "park up ahead behind the van"."""
    referent = query.referent
    if referent is None or "ahead" not in referent.qualifiers_optional:
        return None
    kept = tuple(word for word in referent.qualifiers_optional if word != "ahead")
    qualifiers = (*referent.qualifiers, "ahead")
    return replace(query, referent=replace(referent, qualifiers=qualifiers, qualifiers_optional=kept))


def _move_ahead_to_goal(query: Query, postmodifiers: Sequence[str]) -> Query | None:
    """Attach "ahead" to the goal: "park behind the van in front of us"."""
    referent = query.referent
    after_noun = "ahead" in postmodifiers
    if referent is None or query.relation == "none" or "ahead" not in referent.qualifiers or not after_noun:
        return None
    kept = tuple(word for word in referent.qualifiers if word != "ahead")
    optional = (*referent.qualifiers_optional, "ahead")
    return replace(query, referent=replace(referent, qualifiers=kept, qualifiers_optional=optional))
