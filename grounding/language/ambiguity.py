"""Other ways to understand a query: what a side or a landmark is said of, and what a bike is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from grounding.query import Landmark, LandmarkRole, Query

MOST = 6
_GOALS = ("park", "stop", "pull_over")
# How often each is meant, against the reading it is an alternative to.
_SIDE_OF_GOAL, _AHEAD_OF_VEHICLE, _AHEAD_OF_GOAL = 0.25, 0.3, 0.15
_LANDMARK_ELSEWHERE, _BICYCLE = 0.3, 0.4


def alternatives(query: Query, late: Sequence[str]) -> list[tuple[Query, float]]:
    """The query with 0 and its alternatives with their log priors, best first.

    `late` holds the qualifiers that were said after the noun: "behind the van on the left" may mean the left of the
    road.
    """
    found = [(query, 0.0)]
    ways: list[tuple[Callable[[Query], Query | None], float]] = [
        (lambda one: _side_of_goal(one, late), _SIDE_OF_GOAL),
        (_landmark_elsewhere, _LANDMARK_ELSEWHERE),
        (_bicycle, _BICYCLE),
        (_ahead_of_vehicle, _AHEAD_OF_VEHICLE),
        (lambda one: _ahead_of_goal(one, late), _AHEAD_OF_GOAL),
    ]
    for way, share in ways:
        changed = [(other, score) for one, score in found if (other := way(one)) is not None]
        found += [(other, score + math.log(share)) for other, score in changed]
    return sorted(found, key=lambda pair: -pair[1])[:MOST]


def _side_of_goal(query: Query, late: Sequence[str]) -> Query | None:
    referent = query.referent
    if referent is None or query.action not in _GOALS or query.relation == "none" or query.goal_side:
        return None
    for side in ("left", "right"):
        word = f"{side}_side"
        if word in referent.qualifiers and word in late:
            kept = tuple(one for one in referent.qualifiers if one != word)
            return replace(query, goal_side=side, referent=replace(referent, qualifiers=kept))
    return None


def _landmark_elsewhere(query: Query) -> Query | None:
    """The thing beside the vehicle is beside the goal, or the other way round."""
    if query.referent is None or query.landmark != "referent":
        return None
    others: dict[LandmarkRole, LandmarkRole] = {"referent": "goal", "goal": "referent"}
    for i, mark in enumerate(query.secondary):
        if mark.of in others and mark.relation not in ("between", "into", "in"):
            moved = Landmark(mark.noun, mark.relation, others[mark.of], mark.colour, mark.qualifiers)
            return replace(query, secondary=(*query.secondary[:i], moved, *query.secondary[i + 1 :]))
    return None


def _bicycle(query: Query) -> Query | None:
    referent = query.referent
    if referent is None or referent.noun != "motorcycle" or referent.head not in ("bike", "bikes"):
        return None
    return replace(query, referent=replace(referent, noun="bicycle"))


def _ahead_of_vehicle(query: Query) -> Query | None:
    """In "park up ahead behind the van" the van is ahead."""
    referent = query.referent
    if referent is None or "ahead" not in referent.qualifiers_optional:
        return None
    kept = tuple(word for word in referent.qualifiers_optional if word != "ahead")
    qualifiers = (*referent.qualifiers, "ahead")
    return replace(query, referent=replace(referent, qualifiers=qualifiers, qualifiers_optional=kept))


def _ahead_of_goal(query: Query, late: Sequence[str]) -> Query | None:
    """In "park behind the van in front of us" the place is in front of us."""
    referent = query.referent
    if referent is None or query.relation == "none" or "ahead" not in referent.qualifiers or "ahead" not in late:
        return None
    kept = tuple(word for word in referent.qualifiers if word != "ahead")
    optional = (*referent.qualifiers_optional, "ahead")
    return replace(query, referent=replace(referent, qualifiers=kept, qualifiers_optional=optional))
