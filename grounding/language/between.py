"""The two ends of "between": a reading that has only one of them takes both from the words that follow the relation.

The reader network finds the relation and one vehicle; only the grammar reads pairs.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

from grounding.language.reading import Reading
from grounding.query import Query

_ENDS = re.compile(r"\b(?:between|betwixt|tween|inbetween|amid|middle of)\b(?P<ends>.*)", re.DOTALL)


def with_both_ends(reading: Reading, text: str, read: Callable[[str], Reading]) -> Reading:
    """Return a reading with both vehicles of "between", if it has one and the text names the other.

    Args:
        reading: the reading of the text.
        text: the normalised text.
        read: the grammar alone: text -> reading.
    """
    found = _ENDS.search(text)
    if found is None or not _lacks_end(reading.query):
        return reading
    ends = read(f"park between {found['ends']}").query
    if ends.relation != "between" or ends.referent is None or _lacks_end(ends):
        return reading
    query = replace(reading.query, referent=ends.referent, secondary=ends.secondary)
    steps = tuple(query if one == reading.query else one for one in reading.steps)
    return replace(reading, query=query, steps=steps)


def _lacks_end(query: Query) -> bool:
    """Return whether a place between two vehicles has only one of them."""
    named = query.referent is not None and query.referent.number == 1
    return query.relation == "between" and named and not query.secondary
