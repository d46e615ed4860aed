"""Which vehicle a query means: soft predicates, soft counting, and honesty about ties."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from appocc.checks import FloatArray
from grounding.predicates import fits
from grounding.query import Referent
from grounding.scene import EGO_CENTRE_M, Scene, SceneObject

# Below this a vehicle does not fit what was said; two whose scores differ by less than the margin are a tie.
_MATCHES = 0.2
_MARGIN = np.log(1.6)
# Below this no vehicle is the one counted to: there are too few.
_LEAST_CHANCE = 0.05
# No vehicle fits for certain, so counting never hangs on a single one.
_MOST_CERTAIN = 0.95
# People speak of what lies before them: a vehicle behind the ego counts a quarter, unless the words say otherwise.
_BEHIND_WEIGHT = 0.25
_ORDINALS = {"first": 1, "next": 1, "second": 2, "third": 3, "fourth": 4}
# What a superlative sorts by, smallest first, and over which difference two vehicles are hard to tell apart.
_SORTING: Mapping[str, tuple[Callable[[SceneObject], float], float]] = {
    "nearest": (lambda item: item.distance_m, 0.3),
    "farthest": (lambda item: -item.distance_m, 0.3),
    "leftmost": (lambda item: -item.centre_m[1], 0.2),
    "rightmost": (lambda item: item.centre_m[1], 0.2),
    "largest": (lambda item: -item.length_m * item.width_m, 0.5),
    "smallest": (lambda item: item.length_m * item.width_m, 0.5),
    "first": (lambda item: item.centre_m[0], 0.3),
    "last": (lambda item: -item.centre_m[0], 0.3),
}


@dataclass(frozen=True)
class Candidate:
    """A vehicle that may be meant.

    Attributes:
        item: the vehicle.
        fits: each thing said of it, and how well it fits, 0..1.
        score: logarithm of how well it fits all in all, its place in the count included.
    """

    item: SceneObject
    fits: Mapping[str, float]
    score: float


@dataclass(frozen=True)
class Resolution:
    """The outcome: ok, ambiguous or not_found; candidates, best first (near misses where none fits)."""

    status: str
    candidates: tuple[Candidate, ...]
    reasons: tuple[str, ...]


def resolve(referent: Referent, scene: Scene, limit: int = 6) -> Resolution:
    """The vehicle that a referent means."""
    said = [fits(referent, item, scene) for item in scene.objects]
    plain = np.array([np.prod(list(one.values())) for one in said])
    if not len(plain) or float(plain.max()) < _MATCHES:
        return _nothing(referent, scene, said, limit)
    likely = np.where(plain >= _MATCHES, np.minimum(plain, _MOST_CERTAIN), 0.0)
    behind = np.array([_behind_ego(item, referent) for item in scene.objects])
    if float(np.max(plain[~behind], initial=0.0)) >= _MATCHES:
        likely[behind] *= _BEHIND_WEIGHT
    counted = _counted(referent, scene.objects, likely)
    distance = np.array([item.distance_m for item in scene.objects])
    # A slight liking for the near one breaks even scores, more of it where any will do.
    scores = np.log(counted + 1e-9) - distance / (60 if referent.definite else 15)
    order = [int(i) for i in np.argsort(-scores, kind="stable") if plain[i] >= _MATCHES]
    candidates = tuple(Candidate(scene.objects[i], said[i], float(scores[i])) for i in order[:limit])
    if counted[order[0]] < _LEAST_CHANCE:
        return Resolution("not_found", candidates, (_too_few(referent, len(order)),))
    tied = [c for c in candidates if c.score > candidates[0].score - _MARGIN]
    if len(tied) > 1 and referent.definite:
        reason = f"{len(tied)} vehicles fit '{referent.phrase()}' about equally well"
        return Resolution("ambiguous", tuple(tied), (reason,))
    return Resolution("ok", candidates, tuple(_why(referent, len(order))))


def _behind_ego(item: SceneObject, referent: Referent) -> bool:
    return bool(item.centre_m[0] < EGO_CENTRE_M - 2.5) and "behind_ego" not in referent.qualifiers


def _counted(referent: Referent, items: Sequence[SceneObject], likely: FloatArray) -> FloatArray:
    """Probability of each vehicle to be the one that the ordinals and superlatives count to."""
    ordinals = [word for word in referent.qualifiers if word in _ORDINALS or word == "last"]
    superlatives = [word for word in referent.qualifiers if word in _SORTING and word not in (*ordinals, "first")]
    if not ordinals and not superlatives:
        return likely
    number = next((_ORDINALS[word] for word in ordinals if word in _ORDINALS), 1)
    sorting = (superlatives or (["last"] if "last" in ordinals else ["first"]))[0]
    if not superlatives:
        # Plain ordinals count along the way ahead; what is beside or behind the ego is no part of the count.
        likely = np.where([item.centre_m[0] > EGO_CENTRE_M for item in items], likely, 0.0)
    key, step = _SORTING[sorting]
    # The last from the left is the first from the right.
    sign = -1 if superlatives and "last" in ordinals else 1
    keys = sign * np.array([key(item) for item in items])
    return np.array([likely[i] * _exactly(number - 1, _before(keys, likely, i, step)) for i in range(len(items))])


def _before(keys: FloatArray, likely: FloatArray, i: int, step: float) -> FloatArray:
    """Probability of every other vehicle to be one of those meant and to come before vehicle i."""
    ahead = likely / (1 + np.exp(np.clip((keys - keys[i]) / step, -50, 50)))
    return np.asarray(np.delete(ahead, i))


def _exactly(count: int, probabilities: FloatArray) -> float:
    """Probability that exactly `count` of independent events happen (Poisson binomial)."""
    chances = np.zeros(count + 1)
    chances[0] = 1.0
    for p in probabilities:
        chances[1:] = chances[1:] * (1 - p) + chances[:-1] * p
        chances[0] *= 1 - p
    return float(chances[count])


def _nothing(referent: Referent, scene: Scene, said: list[dict[str, float]], limit: int) -> Resolution:
    """Nothing fits: the nearest misses, and what of the words no vehicle allows for."""
    if not scene.objects:
        return Resolution("not_found", (), ("the map shows no vehicle",))
    # The mean keeps an order among vehicles that miss by one word and those that miss by all.
    closeness = [float(np.mean(list(one.values()))) for one in said]
    order = sorted(range(len(said)), key=lambda i: (-round(closeness[i], 1), scene.objects[i].distance_m))
    misses = tuple(
        Candidate(scene.objects[i], said[i], float(np.log(np.prod(list(said[i].values())) + 1e-9)))
        for i in order[: limit // 2]
    )
    reasons = [f"no vehicle on the map fits '{referent.phrase()}'"]
    lacking = [word for word in said[0] if max(one[word] for one in said) < _MATCHES]
    reasons += [f"none of the {len(said)} vehicles is '{word}'" for word in lacking]
    return Resolution("not_found", misses, tuple(reasons))


def _too_few(referent: Referent, matching: int) -> str:
    words = [word for word in referent.qualifiers if word in _ORDINALS or word in _SORTING]
    return f"no vehicle is the '{' '.join(words)}' one: {matching} fit the rest of '{referent.phrase()}'"


def _why(referent: Referent, matching: int) -> list[str]:
    """What was counted, in words."""
    if matching == 1:
        return [f"it is the only vehicle that fits '{referent.phrase()}'"]
    if not referent.definite:
        return [f"any of {matching} vehicles would do: the one that fits best and lies near was taken"]
    return [f"it fits '{referent.phrase()}' best of {matching} vehicles"]
