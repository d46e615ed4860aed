"""People in a reading: what they wear, and whether they are to get in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from grounding.language.reading import Reading
from grounding.language.syntax.noun_phrases import named_clothes
from grounding.query import Query
from grounding.vocabulary import RELATIONS


def with_people(reading: Reading) -> Reading:
    """Return a reading with what its words tell of the person that it is about."""
    query = reading.query
    if _gets_in(query):
        return _changed(reading, action="stop", relation="next_to", landmark="referent", trigger=None)
    if query.referent is None or query.referent.noun != "person":
        return reading
    if query.referent.colour or query.referent.clothes:
        return reading
    return _changed(reading, referent=replace(query.referent, clothes=named_clothes(reading.tokens)))


def _gets_in(query: Query) -> bool:
    """Return whether a person who is at a vehicle is to be let in: "my colleague is by the bus, let him in"."""
    referent = query.referent
    if query.trigger != "merge" or referent is None:
        return False
    of = "referent" if referent.noun == "person" else "inverse"
    return any(one.of == of and one.relation in RELATIONS for one in query.secondary)


def _changed(reading: Reading, **values: Any) -> Reading:
    """Return a reading with other values of its query, and of the steps that are about the same person."""
    query = reading.query
    if action := values.get("action"):
        values["actions"] = tuple(action if one == query.action else one for one in query.actions)
    steps = tuple(replace(one, **values) if one.referent == query.referent else one for one in reading.steps)
    return replace(reading, query=replace(query, **values), steps=steps)
