"""Referent scoring: combine words, ordinals and priors into one score for every object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from grounding.query import Exclusion, Landmark, Query, Referent
from grounding.referent.object_table import ObjectTable
from grounding.referent.ordinals import find_ordinals, lead_probability, lead_side, ordinal_probability
from grounding.referent.predicates import QUALIFIERS, fit_words, to_referent
from grounding.referent.priors import counting_prior, is_behind, log_action_prior, log_salience
from grounding.referent.scene import SceneModel
from grounding.referent.spatial_relations import fit_relation, footprint_gap_m
from grounding.vocabulary import KNOWN_NOUNS, LANDMARK_KINDS, ORDINALS

# Least membership of a match in each word, and of the product of all words.
_LEAST_WORD_FIT, _LEAST_TOTAL_FIT = 0.12, 0.06
# Membership from which on an object counts fully when objects are counted, and the upper limit of any probability.
_FULL_COUNT_FIT, _MAX_PROBABILITY = 0.6, 0.95
# Colours are less reliable than other words: their weight (exponent) among matches, and the least fit of a match.
# An object of a doubtful colour still matches if all other words fit.
_COLOUR_WEIGHT, _LEAST_COLOUR_FIT, _DOUBTFUL_COLOUR_FIT = 0.7, 0.05, 0.2
# Membership of an excluded object, and weight of a qualifier that may describe the goal instead.
_EXCLUDED_FIT, _OPTIONAL_WEIGHT = 0.03, 0.3
# Objects with a lower probability are no landmarks.
_LEAST_LANDMARK_PROBABILITY = 0.05
# A vehicle this near to a landmark of the map is by it; spread of the membership of farther ones.
_AT_M, _AT_SPREAD_M = 4.0, 4.0
# Standard deviation of the logarithm of a stated distance: about a quarter.
_LOG_DISTANCE_STD = 0.25
# Scale of the difference of gaps by which one is closer, and the farthest gap.
_CLOSER_M, _FAR_M = 1.5, 1000.0
# Things that every map has, and that tell no object from another: "someone by the road".
_OF_EVERY_MAP = ("road", "street", "turn")
_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class ReferentScores:
    """Scores of N objects as one referent.

    Attributes:
        word_fits: membership (N,) in each word.
        matches: (N,) whether an object matches the words.
        probability: (N,) probability to be the referent by words and ordinals.
        log_score: (N,) its logarithm, priors over positions and actions included.
        notes: parts of the query that the scores leave out.
    """

    word_fits: Mapping[str, FloatArray]
    matches: BoolArray
    probability: FloatArray
    log_score: FloatArray
    notes: tuple[str, ...]

    @property
    def fit(self) -> FloatArray:
        """Membership (N,) in all words: their product."""
        return _product(self.word_fits)


def score_objects(query: Query, referent: Referent, scene: SceneModel) -> ReferentScores:
    """Score all objects of a scene as a query's referent."""
    table = scene.table
    word_fits = _fit_all_words(query, referent, scene)
    others = {word: fit for word, fit in word_fits.items() if word != referent.colour}
    plain, colour = _product(others), np.ones(len(table))
    matches = np.min([np.ones(len(table)), *others.values()], axis=0) >= _LEAST_WORD_FIT
    if referent.colour:
        colour = word_fits[referent.colour]
        matches &= colour >= _LEAST_COLOUR_FIT
    matches &= plain * np.maximum(colour, _DOUBTFUL_COLOUR_FIT) >= _LEAST_TOTAL_FIT
    probability = _position_probability(referent, table, matches, plain, colour)
    log_score = np.log(probability + _TINY) + log_salience(query, referent, table) + log_action_prior(query, table)
    for word in referent.qualifiers_optional:
        if word in QUALIFIERS:
            log_score = log_score + _OPTIONAL_WEIGHT * np.log(np.maximum(QUALIFIERS[word](table), 0.05))
    notes = (*note_invisible(referent), *note_unmapped(query, scene))
    return ReferentScores(word_fits, matches, probability, log_score, notes)


def note_invisible(referent: Referent) -> tuple[str, ...]:
    """Return a sentence for each word of a referent that no map shows, such as "rusty"."""
    return tuple(f"no map shows '{word}': it was left out" for word in referent.extra)


def note_unmapped(query: Query, scene: SceneModel) -> tuple[str, ...]:
    """Return a sentence for each thing in a query that the map does not hold, such as a tree."""
    # Of the goal, those are told that only describe it: "in the shade". Others are answered where it is planned.
    described = ("in", "on") if query.landmark != "secondary" else ()
    parts: list[Landmark | Exclusion] = [
        part
        for part in query.secondary
        if part.of != "goal" or (part.relation in described and part.noun not in (*LANDMARK_KINDS, "lane"))
    ]
    unknown = (part for part in (*parts, *query.excluded) if part.noun not in (*KNOWN_NOUNS, *_OF_EVERY_MAP))
    names = dict.fromkeys(part.noun.replace("_", " ") for part in unknown if not _is_on_map(part, scene))
    return tuple(f"the map holds no {name}: it was left out" for name in names)


def _fit_all_words(query: Query, referent: Referent, scene: SceneModel) -> dict[str, FloatArray]:
    """Return the membership (N,) in the words of a referent, its landmarks, its distance and the exclusions."""
    word_fits = fit_words(referent, scene)
    for part in query.secondary:
        if part.of in ("referent", "inverse") and part.noun in KNOWN_NOUNS:
            word_fits |= _fit_landmark(part, scene, _product(word_fits))
        elif _is_on_map(part, scene):
            word_fits |= _fit_map_landmark(part, scene, _product(word_fits))
    if query.distance_of == "descriptor" and query.distance_m:
        word_fits[f"{query.distance_m:g} m away"] = _fit_distance(query.distance_m, scene)
    for exclusion in query.excluded:
        excluded = to_referent(exclusion)
        if exclusion.relation is None and exclusion.noun in KNOWN_NOUNS and not _is_other_place(referent, excluded):
            word_fits[f"not {excluded.phrase()}"] = 1 - (1 - _EXCLUDED_FIT) * _fit_excluded(excluded, scene)
    return word_fits


def _is_other_place(referent: Referent, excluded: Referent) -> bool:
    """Return whether an exclusion only contrasts places in a row, all of which count: "the second, not the first"."""
    counted = find_ordinals(referent.qualifiers) and find_ordinals(excluded.qualifiers)
    return bool(counted) and excluded.colour in (None, referent.colour)


def _fit_excluded(excluded: Referent, scene: SceneModel) -> FloatArray:
    """Return the membership (N,) in an excluded description; of "not the first one" the first alone is excluded."""
    if not find_ordinals(excluded.qualifiers):
        return _product(fit_words(excluded, scene))
    probability = score_objects(Query(""), excluded, scene).probability
    return np.asarray(probability / max(float(probability.max(initial=0.0)), _LEAST_TOTAL_FIT))


def _position_probability(
    referent: Referent, table: ObjectTable, matches: BoolArray, plain: FloatArray, colour: FloatArray
) -> FloatArray:
    """Return the probability (N,) of matches to be the referent, by ordinals or as the lead vehicle.

    Args:
        referent: names the position.
        table: objects.
        matches: (N,) objects that match the words.
        plain: (N,) product of all words but the colour.
        colour: (N,) membership in the colour.
    """
    membership = np.where(matches, np.minimum(plain * colour**_COLOUR_WEIGHT, _MAX_PROBABILITY), 0.0)
    if find_ordinals(referent.qualifiers):
        # The best match counts fully, even if it fits only the speaker's notion of the noun.
        prior = counting_prior(referent, table)
        best_plain, best_colour = (
            np.max(fit * prior, where=matches, initial=_LEAST_TOTAL_FIT) for fit in (plain, colour)
        )
        relative = np.minimum(plain / min(best_plain, _FULL_COUNT_FIT), 1.0)
        relative = relative * np.minimum(colour / best_colour, 1.0) ** _COLOUR_WEIGHT
        membership = np.where(matches, np.minimum(relative, _MAX_PROBABILITY), 0.0) * prior
    probability = ordinal_probability(referent.qualifiers, table, membership)
    if referent.number == 2 and probability is not membership:
        next_one = tuple(word for word in referent.qualifiers if word not in ORDINALS)
        probability = probability + ordinal_probability(("second", *next_one), table, membership)
    side = lead_side(referent)
    return lead_probability(side, table, membership) if side else probability


def _product(word_fits: Mapping[str, FloatArray]) -> FloatArray:
    return np.asarray(np.prod(list(word_fits.values()), axis=0))


def _fit_landmark(part: Landmark, scene: SceneModel, plain: FloatArray) -> dict[str, FloatArray]:
    """Return the membership (N,) in a relation to the best landmark, given that in the other words."""
    table, landmark = scene.table, to_referent(part)
    if part.noun == "motorcycle" and "motorcycle" not in table.class_names:
        landmark = replace(landmark, head="bike")  # which may be a bicycle
    membership = np.minimum(_product(fit_words(landmark, scene)), _MAX_PROBABILITY) * counting_prior(landmark, table)
    probability = ordinal_probability(landmark.qualifiers, table, membership)
    chosen = np.flatnonzero(probability >= _LEAST_LANDMARK_PROBABILITY)
    words, relation = landmark.phrase(), part.relation.replace("_", " ")
    if part.of == "inverse":
        fit = fit_relation(part.relation, table, np.arange(len(table)))[chosen].T
        words = f"the {words} {relation} it"
    else:
        if part.relation == "closest_to":
            fit = _fit_closest(footprint_gap_m(table, chosen), chosen, plain)
        else:
            fit = fit_relation(part.relation, table, chosen)
        words = f"{relation} the {words}"
    return {words: np.max(fit * probability[chosen], axis=1, initial=0.0)}


def _fit_closest(gap_m: FloatArray, chosen: IntArray, plain: FloatArray) -> FloatArray:
    """Return the membership (N, M) in "closest to m" by the gaps (N, M), among those that the other words fit."""
    gap_m = gap_m.copy()
    gap_m[chosen, np.arange(len(chosen))] = np.inf  # no object is the closest to itself
    least_m = np.min(gap_m, axis=0, where=(plain >= _LEAST_WORD_FIT)[:, None], initial=_FAR_M)
    return np.asarray(np.exp(-np.maximum(gap_m - least_m, 0.0) / _CLOSER_M))


def _is_on_map(part: Landmark | Exclusion, scene: SceneModel) -> bool:
    """Return whether a part describes the referent, or rules out places, by a landmark that the vector map holds."""
    described = isinstance(part, Exclusion) or part.of == "referent"
    return described and scene.landmarks.knows(LANDMARK_KINDS.get(part.noun, ""))


def _fit_map_landmark(part: Landmark, scene: SceneModel, plain: FloatArray) -> dict[str, FloatArray]:
    """Return the membership (N,) in being by a landmark of the vector map: "the van at the crossing"."""
    table = scene.table
    away_m = scene.landmarks.distances_m(LANDMARK_KINDS[part.noun], table.xy_m) - table.size_m[:, 0] / 2
    fit = np.exp(-0.5 * (np.maximum(away_m - _AT_M, 0.0) / _AT_SPREAD_M) ** 2)
    if part.relation == "closest_to":
        ahead = plain * ~is_behind(table)  # a landmark that we have passed is not meant
        fit = _fit_closest(
            away_m[:, None], np.zeros(0, np.int64), ahead if (ahead >= _LEAST_WORD_FIT).any() else plain
        )[:, 0]
    return {f"{part.relation} the {part.noun}".replace("_", " "): fit}


def _fit_distance(distance_m: float, scene: SceneModel) -> FloatArray:
    """Return the membership (N,) in a distance, between centres or bumpers, whichever fits better."""
    table = scene.table
    between_m = table.distance_m - (table.ego.length_m + table.size_m[:, 0]) / 2
    off = [np.abs(np.log(np.maximum(away, 0.1) / distance_m)) for away in (table.distance_m, between_m)]
    return np.asarray(np.exp(-0.5 * (np.min(off, axis=0) / _LOG_DISTANCE_STD) ** 2))
