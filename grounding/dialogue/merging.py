"""Merge a partial query into the last command: each slot that a later turn names replaces that of the command.

A turn such as "in front of it instead", "the red one" or "leave three metres" is read as a query that has only the
slots it names: the vehicle, the place, the sides, the distance, the action. What it does not name stays.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from grounding.query import Query
from grounding.requests import Request
from grounding.vocabulary import PASSING_ACTIONS, REFUSED

# Actions that staying behind a vehicle replaces.


def merge_request(request: Request, partial: Query) -> Request:
    """Return a step with a partial query merged into its own.

    The vehicle that was settled stays unless another one is named, a shifted goal unless another place is named.
    """
    query = merge(request.query, partial)
    placed = partial.relation != "none" or partial.landmark is not None or partial.distance_m is not None
    return replace(
        request,
        reading=request.reading.with_query(query),
        chosen=request.chosen if partial.referent is None and query.referent == request.query.referent else None,
        shifts=() if placed else request.shifts,
        held=None,
        ruled_out=frozenset(),
    )


def merge(base: Query, partial: Query) -> Query:
    """Return the query of a command with the slots that a partial query names.

    A new place takes distance and sides with it; a new vehicle keeps the place that is measured from it.
    """
    gap = partial.relation == "near" and partial.distance_m is not None and base.relation != "none"
    names_place = (partial.relation != "none" or partial.landmark is not None) and not gap  # "3 metres from it"
    slots: dict[str, Any] = {"command": partial.command}
    if base.manoeuvre in REFUSED:
        slots["manoeuvre"] = None  # what was refused is not asked for again
    if partial.manoeuvre in REFUSED:
        slots["manoeuvre"] = partial.manoeuvre
    if partial.action is not None:
        slots |= {"action": partial.action, "actions": partial.actions}
    elif partial.relation == "behind" and base.action in PASSING_ACTIONS:
        slots |= {"action": "follow", "actions": ("follow",)}  # who stays behind passes no more
    if partial.referent is not None:
        slots |= _vehicle_slots(base, partial)
    elif partial.excluded:
        slots["excluded"] = (*base.excluded, *partial.excluded)
    if names_place:
        slots |= _place_slots(base, partial)
    if names_place or partial.distance_m is not None:
        slots |= {"distance_m": partial.distance_m, "distance_of": partial.distance_of}
    if names_place or partial.goal_side or partial.road_side or partial.direction:
        names = ("goal_side", "road_side", "direction", "count")
        slots |= {name: getattr(partial, name) for name in names}
    return replace(base, **slots)


def names_gap_only(partial: Query) -> bool:
    """Return whether a query names nothing but the distance to a vehicle that it does not name."""
    elsewhere = partial.relation != "none" or partial.landmark or partial.secondary or partial.referent
    steered = partial.goal_side or partial.road_side or partial.direction
    return partial.distance_of == "referent" and not (elsewhere or steered or partial.unresolved)


def names_place(query: Query) -> bool:
    """Return whether a query says where: at what, on which side, in which direction or how far."""
    named = (query.referent, query.goal_side, query.road_side, query.direction, query.distance_m)
    return bool(query.secondary) or any(one is not None for one in named)


def _vehicle_slots(base: Query, partial: Query) -> dict[str, Any]:
    """Return the slots of another vehicle; exclusions of its colour are lifted: "fine, the black one"."""
    colour = partial.referent.colour if partial.referent else None
    kept = () if partial.relation != "none" else base.excluded
    still = tuple(one for one in kept if colour is None or one.colour != colour)
    goal = tuple(part for part in base.secondary if part.of != "referent")
    described = tuple(part for part in partial.secondary if part.of == "referent")
    return {
        "referent": partial.referent,
        "excluded": (*still, *partial.excluded),
        "secondary": (*goal, *described),
        "landmark": base.landmark or "referent",
        "unresolved": "",
        "sought": None,
    }


def _place_slots(base: Query, partial: Query) -> dict[str, Any]:
    """Return the slots of another place; a place at a landmark has no vehicle."""
    if base.landmark == "secondary" and not (partial.landmark or partial.referent or partial.secondary):
        # "Stop at the crossing." "On the right, before it": the place is measured from what it was.
        at = tuple(replace(part, relation=partial.relation) if part.of == "goal" else part for part in base.secondary)
        return {"relation": partial.relation, "secondary": at}
    keeps = partial.landmark != "secondary"
    described = tuple(part for part in base.secondary if part.of == "referent" and partial.referent is None)
    return {
        "relation": partial.relation,
        "landmark": partial.landmark or ("referent" if partial.referent else base.landmark),
        "referent": (partial.referent or base.referent) if keeps else partial.referent,
        "secondary": partial.secondary or (described if keeps else ()),
    }
