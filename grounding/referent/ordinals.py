"""First, second, last, nearest, leftmost, the one in front of us: the probability of each thing to be that one."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from appocc.checks import FloatArray
from grounding.query import Referent
from grounding.referent.fuzzy import rises
from grounding.referent.object_table import Crowd
from grounding.referent.predicates import own_lane

# From here on a vehicle is before us rather than beside us.
_AHEAD_M = 3.0

# How surely "the car in front of us" is the one right before us in our lane; it may be any one ahead.
_LEADS = 0.85
# What may be said beside it without telling another place.
_NO_PLACE = frozenset(("ahead", "behind_ego", "moving", "stopped", "braking", "large", "small"))

ORDINALS: Mapping[str, int] = {"first": 1, "next": 1, "second": 2, "third": 3, "fourth": 4}
# What a superlative sorts by, smallest first, and over which difference two vehicles are hard to tell apart.
SORTING: Mapping[str, tuple[Callable[[Crowd], FloatArray], float]] = {
    "nearest": (lambda crowd: crowd.distance_m, 0.3),
    "farthest": (lambda crowd: -crowd.distance_m, 0.3),
    "leftmost": (lambda crowd: -crowd.xy_m[:, 1], 0.2),
    "rightmost": (lambda crowd: crowd.xy_m[:, 1], 0.2),
    "largest": (lambda crowd: -crowd.size_m[:, 0] * crowd.size_m[:, 1], 0.5),
    "smallest": (lambda crowd: crowd.size_m[:, 0] * crowd.size_m[:, 1], 0.5),
    "first": (lambda crowd: _way_ahead_m(crowd), 0.3),
    "last": (lambda crowd: -_way_ahead_m(crowd), 0.3),
}


def _way_ahead_m(crowd: Crowd) -> FloatArray:
    """(N,) how far ahead they are, half along our lane and half as we see it, should the lane be another."""
    return (crowd.along_m + crowd.xy_m[:, 0]) / 2


def counting_words(qualifiers: tuple[str, ...]) -> list[str]:
    """Those that count."""
    return [word for word in qualifiers if word in ORDINALS or word in SORTING]


def counted(qualifiers: tuple[str, ...], crowd: Crowd, likely: FloatArray) -> FloatArray:
    """(N,) probabilities to be the one that is counted to, given those to be one that counts (N,)."""
    ordinals = [word for word in qualifiers if word in ORDINALS or word == "last"]
    superlatives = [word for word in qualifiers if word in SORTING and word not in (*ordinals, "first")]
    if not ordinals and not superlatives:
        return likely
    number = next((ORDINALS[word] for word in ordinals if word in ORDINALS), 1)
    sorting = (superlatives or (["last"] if "last" in ordinals else ["first"]))[0]
    if not superlatives and "behind_ego" not in qualifiers:
        # Plain ordinals count along the way ahead; what is beside or behind the ego is no part of the count.
        likely = likely * rises(crowd.xy_m[:, 0], _AHEAD_M, 0.5) * (crowd.xy_m[:, 0] > crowd.ego.centre_m)
    key, step = SORTING[sorting]
    # The last from the left is the first from the right.
    keys = key(crowd) * (-1 if superlatives and "last" in ordinals else 1)
    return likely * _exactly(number - 1, _before(keys, likely, step))


def leads(referent: Referent) -> int:
    """1 for "the car in front of us", -1 for the one behind us, 0 with another place told or several meant."""
    words, several = {*referent.qualifiers}, referent.number != 1 or _plural(referent.head)
    if several or not referent.in_line or not referent.definite or not words <= _NO_PLACE:
        return 0
    return ("ahead" in words) - ("behind_ego" in words)


def _plural(head: str) -> bool:
    return head.endswith("s") and not head.endswith(("ss", "bus"))


def leading(side: int, crowd: Crowd, likely: FloatArray) -> FloatArray:
    """(N,) probabilities to be the one before us (1) or behind us (-1), given those to fit what else is said (N,).

    The nearest one in our lane is; where none is in our lane, the nearest one.
    """
    keys = side * _way_ahead_m(crowd)
    in_lane = likely * own_lane(crowd)
    first = in_lane * _exactly(0, _before(keys, in_lane, SORTING["first"][1]))
    nearest = likely * _exactly(0, _before(keys, likely, SORTING["first"][1]))
    return np.asarray(_LEADS * (first + (1 - in_lane).prod() * nearest) + (1 - _LEADS) * likely)


def _before(keys: FloatArray, likely: FloatArray, step: float) -> FloatArray:
    """(N, N) probability of every other one (column) to be one that counts and to come before each (row)."""
    ahead = likely / (1 + np.exp(np.clip((keys - keys[:, None]) / step, -50, 50)))
    np.fill_diagonal(ahead, 0.0)
    return np.asarray(ahead)


def _exactly(count: int, probabilities: FloatArray) -> FloatArray:
    """(N,) probability that exactly `count` of independent events happen, whose probabilities are a row each.

    With odds o = p / (1 - p) it is the product of all 1 - p, times the sum over all ways to choose `count` of the o;
    Newton's identities make those sums of sums of powers.
    """
    odds = probabilities / (1 - probabilities)
    powers = [(odds**k).sum(axis=1) for k in range(1, count + 1)]
    sums = [np.ones(len(probabilities))]
    for k in range(1, count + 1):
        terms = [(-1) ** (i - 1) * sums[k - i] * powers[i - 1] for i in range(1, k + 1)]
        sums.append(np.sum(terms, axis=0) / k)
    return np.asarray(sums[count] * (1 - probabilities).prod(axis=1)).clip(0)
