"""Everything that a query says, and what it leaves unsaid, weighed for all things on the street at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray
from grounding.query import Exclusion, Landmark, Query, Referent
from grounding.referent.class_fit import KNOWN
from grounding.referent.ordinals import ORDINALS, counted, counting_words, leading, leads
from grounding.referent.predicates import QUALIFIERS, described, fits
from grounding.referent.priors import membership, of_action, place
from grounding.referent.scene import Scene
from grounding.referent.spatial_relations import related

# A thing is one of those meant if it fits every word at least so well, and all of them together.
_LEAST_WORD, _LEAST_ALL = 0.12, 0.06
# What fits so well counts in full where things are counted; yet nothing fits for certain.
_PLAINLY, _MOST_CERTAIN = 0.6, 0.95
# Light and people's words differ: among things that have the colour it tells less than the fit says. What fits it
# less than the least does not have it; above that a doubtful colour rules nothing out that all other words fit.
_COLOUR_WEIGHT, _LEAST_COLOUR, _DOUBTFUL_COLOUR = 0.7, 0.05, 0.2
# What an exclusion leaves of a vehicle, and how much a qualifier weighs that may belong to the place.
_EXCLUDED, _OPTIONAL = 0.03, 0.3
# Less likely things are no landmarks.
_LEAST_LANDMARK = 0.05
# A descriptor of distance is right to within a quarter.
_DISTANCE_SPREAD = 0.25
_NOWHERE = 1e-9


@dataclass(frozen=True)
class Weighed:
    """What is said of N things.

    Attributes:
        said: fits (N,) of each word.
        matches: (N,) whether a thing is one of those that the words fit.
        chance: (N,) probability to be the one, its place in the count included.
        score: (N,) logarithms of it, likings for places and actions included.
        notes: what could not be weighed.
    """

    said: Mapping[str, FloatArray]
    matches: BoolArray
    chance: FloatArray
    score: FloatArray
    notes: tuple[str, ...]


def weigh(query: Query, referent: Referent, scene: Scene) -> Weighed:
    """The things of a scene as a query's referent, its words multiplied."""
    crowd = scene.crowd
    said = fits(referent, scene)
    for part in query.secondary:
        if part.of != "goal" and part.noun in KNOWN:
            said |= _beside(part, scene)
    if query.distance_of == "descriptor" and query.distance_m:
        said[f"{query.distance_m:g} m away"] = _so_far_away(query.distance_m, scene)
    for exclusion in query.excluded:
        if exclusion.relation is None and exclusion.noun in KNOWN:
            ruled_out = described(exclusion)
            said[f"not {ruled_out.phrase()}"] = 1 - (1 - _EXCLUDED) * _product(fits(ruled_out, scene))
    others = {word: fit for word, fit in said.items() if word != referent.colour}
    plain, colour = _product(others), np.ones(len(crowd))
    matches = np.min(list(others.values()), axis=0) >= _LEAST_WORD
    if referent.colour:
        colour = said[referent.colour]
        matches &= colour >= _LEAST_COLOUR
    matches &= plain * np.maximum(colour, _DOUBTFUL_COLOUR) >= _LEAST_ALL
    likely = np.where(matches, np.minimum(plain * colour**_COLOUR_WEIGHT, _MOST_CERTAIN), 0.0)
    if counting_words(referent.qualifiers):
        # What fits best is such a thing, if only by the words of the one who speaks.
        member = membership(referent, crowd)
        plainly, best = (np.max(fit * member, where=matches, initial=_LEAST_ALL) for fit in (plain, colour))
        counts = np.minimum(plain / min(plainly, _PLAINLY), 1.0) * np.minimum(colour / best, 1.0) ** _COLOUR_WEIGHT
        likely = np.where(matches, np.minimum(counts, _MOST_CERTAIN), 0.0) * member
    chance = counted(referent.qualifiers, crowd, likely)
    if referent.number == 2 and chance is not likely:
        following = tuple(word for word in referent.qualifiers if word not in ORDINALS)
        chance = chance + counted(("second", *following), crowd, likely)
    if side := leads(referent):
        chance = leading(side, crowd, likely)
    score = np.log(chance + _NOWHERE) + place(query, referent, crowd) + of_action(query, crowd)
    for word in referent.qualifiers_optional:
        if word in QUALIFIERS:
            score = score + _OPTIONAL * np.log(np.maximum(QUALIFIERS[word](crowd), 0.05))
    unseen = tuple(f"no map shows '{word}': it was left out" for word in referent.extra)
    return Weighed(said, matches, chance, score, (*unseen, *unknown_things(query)))


def unknown_things(query: Query) -> tuple[str, ...]:
    """What a command names beside vehicles and people, in words: no map holds it."""
    parts: list[Landmark | Exclusion] = [part for part in query.secondary if part.of != "goal"]
    names = dict.fromkeys(part.noun.replace("_", " ") for part in (*parts, *query.excluded) if part.noun not in KNOWN)
    return tuple(f"the map holds no {name}: it was left out" for name in names)


def _product(said: Mapping[str, FloatArray]) -> FloatArray:
    return np.asarray(np.prod(list(said.values()), axis=0))


def _beside(part: Landmark, scene: Scene) -> dict[str, FloatArray]:
    """How well things stand to the best other one that a command names ("the van in front of the truck")."""
    crowd, landmark = scene.crowd, described(part)
    likely = np.minimum(_product(fits(landmark, scene)), _MOST_CERTAIN) * membership(landmark, crowd)
    likely = counted(landmark.qualifiers, crowd, likely)
    chosen = np.flatnonzero(likely >= _LEAST_LANDMARK)
    words, relation = landmark.phrase(), part.relation.replace("_", " ")
    if part.of == "inverse":
        stands = related(part.relation, crowd, np.arange(len(crowd)))[chosen].T
        words = f"the {words} {relation} it"
    else:
        stands = related(part.relation, crowd, chosen)
        words = f"{relation} the {words}"
    return {words: np.max(stands * likely[chosen], axis=1, initial=0.0)}


def _so_far_away(distance_m: float, scene: Scene) -> FloatArray:
    """From middle to middle, or from our bumper to its, whichever suits better."""
    crowd = scene.crowd
    between = crowd.distance_m - (crowd.ego.length_m + crowd.size_m[:, 0]) / 2
    off = [np.abs(np.log(np.maximum(away, 0.1) / distance_m)) for away in (crowd.distance_m, between)]
    return np.asarray(np.exp(-0.5 * (np.min(off, axis=0) / _DISTANCE_SPREAD) ** 2))
