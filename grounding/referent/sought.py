"""The object that a query searches for: riders and drivers stand for their vehicle, a person may be told by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grounding.query import Landmark, Query, Referent
from grounding.referent.predicates import to_referent
from grounding.vocabulary import KNOWN_NOUNS, PERSON_NOUNS, VEHICLE_NOUNS

# Actions for other traffic, and places where only a vehicle is.
_TRAFFIC_ACTIONS = ("give_way", "follow", "overtake")
_TRAFFIC_PLACES = frozenset(("behind_ego", "own_lane", "left_lane", "right_lane", "other_lane", "oncoming"))


def with_sought_referent(query: Query) -> Query:
    """Return the query with the object to search for as its referent; riders and drivers merge with their vehicle."""
    referent, secondary = query.referent, query.secondary
    if referent is None:
        goals = [part for part in secondary if part.of == "goal" and part.noun in KNOWN_NOUNS][:1]
        return (
            replace(query, referent=to_referent(goals[0]), secondary=_without(goals, secondary)) if goals else query
        )
    if referent.clothes and referent.colour is None:
        referent = replace(referent, colour=referent.clothes, clothes=None)  # the colour of a person on the map
        query = replace(query, referent=referent)
    if "nearest" in referent.qualifiers and any(_is_measure(part) for part in secondary):
        # "The car closest to the van": nearest to the van, not to us.
        referent = replace(referent, qualifiers=tuple(one for one in referent.qualifiers if one != "nearest"))
        secondary = tuple(replace(part, relation="closest_to") if _is_measure(part) else part for part in secondary)
        query = replace(query, referent=referent, secondary=secondary)
    if _drives(query, referent):
        referent = replace(referent, noun="vehicle")
        query = replace(query, referent=referent)
    inside = [part for part in secondary if part.relation in ("on", "in")]
    if referent.noun in PERSON_NOUNS:
        ridden = [part for part in inside if part.of == "referent" and part.noun in VEHICLE_NOUNS][:1]
        if ridden:
            named = to_referent(ridden[0])
            vehicle = replace(referent, noun=named.noun, head=named.head, colour=named.colour)
            return replace(query, referent=vehicle, secondary=_without(ridden, secondary))
    riders = [part for part in inside if part.of == "inverse" and part.noun in PERSON_NOUNS]
    return replace(query, secondary=_without(riders, secondary))


def _is_measure(part: Landmark) -> bool:
    """Return whether a referent is the nearest one to a landmark."""
    return part.of == "referent" and part.relation == "toward"


def _drives(query: Query, referent: Referent) -> bool:
    """Return whether a person is the driver of a vehicle: "let the guy behind us overtake", "pass this slow guy"."""
    if query.action == "overtake" and referent.noun in PERSON_NOUNS:
        return True
    traffic = query.action in _TRAFFIC_ACTIONS and referent.noun in PERSON_NOUNS
    placed = referent.in_line or not _TRAFFIC_PLACES.isdisjoint(referent.qualifiers)
    return traffic and (placed or query.trigger == "merge")


def by_vehicle(query: Query) -> Query | None:
    """Return the query with the vehicle by which its person is described; None if there is none."""
    beside = [one for one in query.secondary if one.of == "referent" and one.noun in VEHICLE_NOUNS][:1]
    if query.referent is None or query.referent.noun not in PERSON_NOUNS or not beside:
        return None
    return replace(query, referent=to_referent(beside[0]), secondary=_without(beside, query.secondary))


def _without(some: Sequence[Landmark], landmarks: tuple[Landmark, ...]) -> tuple[Landmark, ...]:
    return tuple(part for part in landmarks if part not in some)
