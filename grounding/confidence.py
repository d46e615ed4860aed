"""Confidence of an answer: the probability that vehicle and place are those that were meant.

A logistic function of few numbers, fitted by `python -m benchmarks.grounding_confidence` on simulated cases with
truth, on exact, noisy and predicted maps. Their sentences are clean: the weight of changed words is the log odds
ratio of right readings with and without such words among the labelled sentences.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from grounding.language import Reading
from grounding.referent.resolver import Candidate
from grounding.referent.scene import SceneModel

# Largest log odds of a referent against the other candidates, and least log of a fit and of a score.
_MAX_MARGIN, _LEAST_LOG = 4.0, -4.0
# Cost of a wrong goal, in needless questions.
_WRONG_COST = 2.0


class Evidence(NamedTuple):
    """What the confidence depends on.

    Attributes:
        margin: log odds of the referent against all other candidates, at most 4.
        fit: logarithm of the least fit of the referent in a word, 0 without a referent.
        goal: logarithm of the score of the goal.
        exact: 1 on a map of true boxes, else 0.
        changed: corrected and dropped words, and fields that the reader network changed.
    """

    margin: float
    fit: float
    goal: float
    exact: float
    changed: float


# Fitted: one weight for each number of the evidence, and the log odds without any.
_WEIGHTS = Evidence(margin=0.65, fit=1.12, goal=0.53, exact=1.92, changed=-0.5)
_BIAS = 1.04


def gather_evidence(
    reading: Reading,
    referent: Candidate | None,
    candidates: Sequence[Candidate],
    goal_score: float,
    scene: SceneModel,
) -> Evidence:
    """Return the evidence for an answer.

    Args:
        reading: the reading that is answered.
        referent: the vehicle meant; None if the command names none.
        candidates: all vehicles that fit, the referent included.
        goal_score: score of the goal, 0..1.
        scene: the scene.
    """
    margin, fit = _MAX_MARGIN, 0.0
    if referent is not None:
        rivals = sum(math.exp(one.score - referent.score) for one in candidates if one is not referent)
        margin = min(-math.log(rivals), _MAX_MARGIN) if rivals > 0 else _MAX_MARGIN
        fit = _log(min(referent.fits.values(), default=1.0))
    changed = len(reading.corrections) + len(reading.dropped) + len(reading.revised)
    return Evidence(margin, fit, _log(goal_score), float(scene.table.is_exact), float(changed))


def confidence_of(evidence: Evidence) -> float:
    """Return the probability 0..1 that an answer with this evidence is right."""
    odds = _BIAS + sum(weight * value for weight, value in zip(_WEIGHTS, evidence, strict=True))
    return 1 / (1 + math.exp(-odds))


def is_worth_acting(confidence: float) -> bool:
    """Return whether acting costs less than asking: whether a wrong goal is unlikely enough."""
    return (1 - confidence) * _WRONG_COST <= 1


def _log(share: float) -> float:
    return max(math.log(max(share, 1e-9)), _LEAST_LOG)
