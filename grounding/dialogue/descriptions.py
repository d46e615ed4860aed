"""Descriptions of vehicles in a conversation: which candidates they fit, and steps with another description."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from grounding.answering import without
from grounding.language import Reading, WordCategory
from grounding.query import Query, Referent
from grounding.referent.ordinals import SORT_KEYS, find_ordinals
from grounding.referent.predicates import to_referent
from grounding.referent.resolver import Candidate, find_all, resolve, word_probabilities
from grounding.referent.scene import SceneModel
from grounding.requests import Request
from grounding.vocabulary import ORDINALS, PERSON_NOUNS

# A told distance is rounded, or remembered roughly.
_LEAST_TOLERANCE_M, _TOLERANCE = 2.5, 0.1
# Where "before" and "past" another vehicle are, along our way.
_ALONG = {"before": -1, "past": 1}
# Share of the probability of the candidate that fits best which another one has at least.
_ALIKE_FIT = 0.5
# Another candidate is this many times as far from a neighbour.
_CLEARLY_NEARER = 1.3


def reading_of(referent: Referent) -> Reading:
    """Return the partial reading of a description: it has the vehicle, and neither an action nor a place."""
    query = Query("", referent=referent)
    return Reading(query)


def any_of(query: Query) -> Query:
    """Return a query about any vehicle like its referent, so that all of them are candidates."""
    referent = query.referent
    return query if referent is None else replace(query, referent=replace(referent, definite=False))


def find_fitting(reading: Reading, candidates: Sequence[Candidate], scene: SceneModel) -> list[Candidate]:
    """Return the candidates that a description fits; positions count among those that fit its other words."""
    query = reading.query
    if query.referent is None:
        return []
    plain = without_positions(reading).query.referent or query.referent
    fitting = _with_words(query, plain, candidates, scene)
    for one in query.excluded:
        if one.relation is None:
            # "Not the white one" is as much about any vehicle as the description itself.
            same = query.referent.anaphora or one.noun == query.referent.noun
            fitting = find_others(reading_of(replace(to_referent(one), anaphora=same)), fitting, scene)
    return find_counted(query.referent.qualifiers, fitting, scene)


def find_others(reading: Reading, candidates: Sequence[Candidate], scene: SceneModel) -> list[Candidate]:
    """Return the candidates that a description does not fit: "not the nearest"."""
    referent = reading.query.referent
    if referent is not None:  # "not the ones behind us": all of them, and not the next one in our lane alone
        reading = reading.with_query(replace(reading.query, referent=replace(referent, in_line=False)))
    ids = {one.item.id for one in find_fitting(reading, candidates, scene)}
    return [one for one in candidates if one.item.id not in ids]


def _with_words(
    query: Query, referent: Referent, candidates: Sequence[Candidate], scene: SceneModel
) -> list[Candidate]:
    """Return the candidates that the words of a description fit, without its ordinals and superlatives."""
    plain = referent
    if referent.anaphora and referent.noun not in PERSON_NOUNS:
        plain = replace(plain, noun="vehicle", head="vehicle")  # what "one" stands for fits every candidate
    ids = {one.item.id for one in candidates}
    sure = {one.id for one in find_all(plain, scene)} if not referent.anaphora else set[str]()
    if sure and not sure & ids:
        return []  # another vehicle is such a van
    sought = replace(Query(""), referent=plain, secondary=query.secondary)
    # Landmarks of a description are no candidates, but they must be in the scene.
    keeps_others = bool(query.secondary)
    alone = scene if keeps_others else without(scene, frozenset({one.id for one in scene.table.items} - ids))
    fits = {key: fit for key, fit in word_probabilities(sought, alone).items() if key in ids}
    least = _ALIKE_FIT * max(fits.values(), default=0.0)
    fitting = [one for one in candidates if fits.get(one.item.id, -1.0) >= least]
    # Between candidates a colour is a contrast: of a black and a grey car, "the grey one" is not the black one.
    colour = referent.colour
    named = [one for one in fitting if colour and colour in (scene.colour_name(one.item) or "").split()]
    if colour and not named and resolve(sought, scene).status == "ok":
        return []  # another vehicle has that colour
    return named or fitting


def without_positions(reading: Reading) -> Reading:
    """Return a description without its ordinals and superlatives."""
    referent = reading.query.referent
    if referent is None:
        return reading
    positions = find_ordinals(referent.qualifiers)
    others = tuple(word for word in referent.qualifiers if word not in positions)
    return reading.with_query(replace(reading.query, referent=replace(referent, qualifiers=others)))


def find_counted(qualifiers: tuple[str, ...], candidates: Sequence[Candidate], scene: SceneModel) -> list[Candidate]:
    """Return the candidates in the position that qualifiers name among them, all without one: "second farthest".

    Several are returned if their order is hard to tell. Plain ordinals count along the road ahead.
    """
    words = find_ordinals(qualifiers)
    if not words or not candidates:
        return list(candidates)
    superlative = next((one for one in words if one in SORT_KEYS and one not in ("first", "last")), None)
    reverse, number = -1 if "last" in words else 1, next((ORDINALS[one] for one in words if one in ORDINALS), 1)
    ahead = [one for one in candidates if one.item.centre_m[0] > scene.ego.centre_m]
    counted = list(candidates) if superlative else ahead or list(candidates)
    key, scale = SORT_KEYS[superlative or "first"]
    ids = [one.id for one in scene.table.items]
    keys = key(scene.table)[[ids.index(one.item.id) for one in counted]]
    keys = reverse * (keys if superlative else np.abs(keys))
    if number > len(counted):
        return []
    return [one for one, near in zip(counted, np.abs(keys - np.sort(keys)[number - 1]) < scale, strict=True) if near]


def find_at_distance(distance_m: float, candidates: Sequence[Candidate], scene: SceneModel) -> list[Candidate]:
    """Return the candidates at a distance from us, as told in the question: "the fifteen metre one"."""
    tolerance_m = max(_LEAST_TOLERANCE_M, _TOLERANCE * distance_m)
    return [one for one in candidates if abs(one.item.distance_m(scene.ego) - distance_m) < tolerance_m]


def find_beside(
    neighbour: Referent, relation: str, candidates: Sequence[Candidate], scene: SceneModel
) -> list[Candidate]:
    """Return the candidate with a relation to another vehicle: "the one past the motorcycle".

    Args:
        neighbour: description of the other vehicle.
        relation: relation of the candidate to it; "before" and "past" are along our way, else the nearest counts.
        candidates: the candidates.
        scene: the scene.

    Returns:
        The candidate; none without such a neighbour, or if two candidates are about equally near to it.
    """
    found = resolve(Query("", referent=neighbour), scene)
    ids = {one.item.id for one in candidates}
    if found.status != "ok" or not found.candidates or found.candidates[0].item.id in ids:
        return []
    other = found.candidates[0].item
    sign = _ALONG.get(relation, 0)
    on_side = [one for one in candidates if sign * (one.item.centre_m[0] - other.centre_m[0]) >= 0]
    away = sorted((float(np.hypot(*(one.item.centre_m - other.centre_m))), i) for i, one in enumerate(on_side))
    unclear = len(away) > 1 and away[1][0] < _CLEARLY_NEARER * away[0][0]
    return [on_side[away[0][1]]] if away and not unclear else []


def widen(reading: Reading, scene: SceneModel) -> Reading:
    """Return a reading with any vehicle for "one" if no vehicle of the class spoken of fits: "the grey one"."""
    # "There's a gold bus, get in behind it" names a bus.
    ones = any(token.category is WordCategory.ONE for token in reading.tokens)
    named = {token.value for token in reading.tokens if token.category is WordCategory.NOUN and not ones}

    def wider(step: Query) -> Query:
        said = step.referent is not None and step.referent.noun in named
        return step if said else _with_any_vehicle(step, scene)

    return each_step(reading, wider)


def _with_any_vehicle(query: Query, scene: SceneModel) -> Query:
    referent = query.referent
    if referent is None or not referent.anaphora or not (referent.colour or referent.qualifiers):
        return query
    if referent.noun == "vehicle":
        return query
    found = resolve(query, scene)
    unknown = bool(referent.colour) and all(one.item.rgb is None for one in found.candidates[:1])
    counted = bool(find_ordinals(referent.qualifiers)) and found.status != "not_found"  # of its own class
    if (found.status == "ok" and not unknown) or counted:
        return query
    # A bike may be a bicycle.
    for noun in (*(("bicycle",) if referent.head == "bike" else ()), "vehicle"):
        wider = replace(query, referent=replace(referent, noun=noun, head=noun))
        found = resolve(wider, scene)
        if found.status == "ok" or (found.status == "ambiguous" and len(found.candidates) == 1):
            return wider
    return query


def each_step(reading: Reading, change: Callable[[Query], Query]) -> Reading:
    """Return a reading with its query and each of its steps changed."""
    query = change(reading.query)
    steps = tuple(query if step == reading.query else change(step) for step in reading.steps)
    return replace(reading, query=query, steps=steps)


def without_qualifiers(request: Request) -> Request:
    """Return a step whose referent has no qualifiers: "the nearest white car" becomes "the white car"."""
    referent = request.query.referent
    if referent is None:
        return request
    query = replace(request.query, referent=replace(referent, qualifiers=(), in_line=False))
    return replace(request, reading=request.reading.with_query(query))
