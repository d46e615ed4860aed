"""Ordinals, superlatives and the lead vehicle: the probability of each object to be the one in that position."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from appocc.checks import FloatArray
from grounding.query import Referent
from grounding.referent.fuzzy import rising
from grounding.referent.object_table import ObjectTable
from grounding.referent.predicates import in_own_lane
from grounding.vocabulary import ORDINALS

# From this x on an object is ahead of the ego rather than next to it.
_AHEAD_M = 3.0

# Probability that "the car in front of us" means the lead vehicle of the ego lane and not any vehicle ahead.
_LEAD_PROBABILITY = 0.85
# Qualifiers that combine with "in front of us" without naming another position.
_NON_POSITIONAL = frozenset(("ahead", "behind_ego", "moving", "stopped", "braking", "large", "small"))

# Sort key of each superlative, smallest first, and the scale of differences that are hard to tell.
SORT_KEYS: Mapping[str, tuple[Callable[[ObjectTable], FloatArray], float]] = {
    "nearest": (lambda table: table.distance_m, 0.3),
    "farthest": (lambda table: -table.distance_m, 0.3),
    "at_end": (lambda table: -table.distance_m, 0.3),  # of a row of vehicles
    "leftmost": (lambda table: -table.xy_m[:, 1], 0.2),
    "rightmost": (lambda table: table.xy_m[:, 1], 0.2),
    "largest": (lambda table: -table.size_m[:, 0] * table.size_m[:, 1], 0.5),
    "smallest": (lambda table: table.size_m[:, 0] * table.size_m[:, 1], 0.5),
    "first": (lambda table: _distance_ahead_m(table), 0.3),
    "last": (lambda table: -_distance_ahead_m(table), 0.3),
}


def _distance_ahead_m(table: ObjectTable) -> FloatArray:
    """Return the distance ahead (N,): the mean of arc length and x, because the estimated lane may be wrong."""
    return (table.along_m + table.xy_m[:, 0]) / 2


def find_ordinals(qualifiers: tuple[str, ...]) -> list[str]:
    """Return the ordinals and superlatives among qualifiers."""
    return [word for word in qualifiers if word in ORDINALS or word in SORT_KEYS]


def ordinal_probability(qualifiers: tuple[str, ...], table: ObjectTable, membership: FloatArray) -> FloatArray:
    """Return the probability (N,) of each object to be in the position that the qualifiers name.

    Args:
        qualifiers: qualifiers of a referent; without an ordinal or superlative `membership` is returned.
        table: objects.
        membership: (N,) probability of each object to be one of those that are counted.
    """
    ordinals = [word for word in qualifiers if word in ORDINALS or word == "last"]
    superlatives = [word for word in qualifiers if word in SORT_KEYS and word not in (*ordinals, "first")]
    if not ordinals and not superlatives:
        return membership
    number = next((ORDINALS[word] for word in ordinals if word in ORDINALS), 1)
    sorting = (superlatives or (["last"] if "last" in ordinals else ["first"]))[0]
    if not superlatives and "behind_ego" not in qualifiers:
        # Plain ordinals count along the road ahead and skip objects next to and behind the ego.
        membership = membership * rising(table.xy_m[:, 0], _AHEAD_M, 0.5) * (table.xy_m[:, 0] > table.ego.centre_m)
    key, scale = SORT_KEYS[sorting]
    # The last from the left is the first from the right.
    keys = key(table) * (-1 if superlatives and "last" in ordinals else 1)
    return membership * _poisson_binomial(number - 1, _precedence_probability(keys, membership, scale))


def lead_side(referent: Referent) -> int:
    """Return 1 for "the car in front of us", -1 for "the car behind us", 0 for another position or several cars."""
    qualifiers = {*referent.qualifiers}
    several = referent.number != 1 or is_plural(referent.head)
    if {"ahead", "first"} <= qualifiers:  # "the first one ahead of us"
        qualifiers = qualifiers - {"first"}
    if several or not referent.in_line or not referent.definite or not qualifiers <= _NON_POSITIONAL:
        return 0
    return ("ahead" in qualifiers) - ("behind_ego" in qualifiers)


def is_plural(head: str) -> bool:
    """Return whether a noun names several."""
    return head.endswith("people") or (head.endswith("s") and not head.endswith(("ss", "bus", "'s", " is", " was")))


def lead_probability(side: int, table: ObjectTable, membership: FloatArray) -> FloatArray:
    """Return the probability (N,) of each object to be the lead vehicle, or the one that follows the ego.

    This is the nearest one in the ego lane; if the lane is empty, the nearest one.

    Args:
        side: 1 for the lead vehicle, -1 for the following one.
        table: objects.
        membership: (N,) probability of each object to match the other words.
    """
    keys = side * _distance_ahead_m(table)
    in_lane = membership * in_own_lane(table)
    first = in_lane * _poisson_binomial(0, _precedence_probability(keys, in_lane, SORT_KEYS["first"][1]))
    nearest = membership * _poisson_binomial(0, _precedence_probability(keys, membership, SORT_KEYS["first"][1]))
    lead = first + (1 - in_lane).prod() * nearest
    return np.asarray(_LEAD_PROBABILITY * lead + (1 - _LEAD_PROBABILITY) * membership)


def _precedence_probability(keys: FloatArray, membership: FloatArray, scale: float) -> FloatArray:
    """Return the probability (N, N) that another object (column) is counted and precedes each one (row)."""
    precedes = membership / (1 + np.exp(np.clip((keys - keys[:, None]) / scale, -50, 50)))
    np.fill_diagonal(precedes, 0.0)
    return np.asarray(precedes)


def _poisson_binomial(count: int, probabilities: FloatArray) -> FloatArray:
    """Return the probability (N,) that exactly `count` of the independent events of each row happen.

    With odds o = p / (1 - p) this is the product of all 1 - p times the elementary symmetric polynomial of degree
    `count` of the odds, which Newton's identities compute from power sums.
    """
    odds = probabilities / (1 - probabilities)
    powers = [(odds**k).sum(axis=1) for k in range(1, count + 1)]
    sums = [np.ones(len(probabilities))]
    for k in range(1, count + 1):
        terms = [(-1) ** (i - 1) * sums[k - i] * powers[i - 1] for i in range(1, k + 1)]
        sums.append(np.sum(terms, axis=0) / k)
    return np.asarray(sums[count] * (1 - probabilities).prod(axis=1)).clip(0)
