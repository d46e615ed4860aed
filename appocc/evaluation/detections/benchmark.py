"""nuScenes' detection metric (configuration of CVPR 2019): average precision by centre distance, and five errors.

Definitions: Caesar et al., nuScenes: A multimodal dataset for autonomous driving, CVPR 2020, section 3.1; the details
(interpolation, ties) follow nuscenes-devkit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.evaluation.detections.box_table import BoxTable
from appocc.evaluation.detections.matching import falling_scores, match_by_score
from appocc.geometry import wrap_angle
from appocc.objects import KINDS

GATES_M = (0.5, 1.0, 2.0, 4.0)
ERROR_GATE_M = 2.0
# True boxes and detections of a class count within this distance of the ego.
RANGE_M = {kind: 40.0 if kind in ("pedestrian", "motorcycle", "bicycle") else 50.0 for kind in KINDS}
# Errors of translation (m), scale (1 - IoU), orientation (rad), velocity (m/s) and attribute (1 - accuracy).
ERRORS = ("ATE", "ASE", "AOE", "AVE", "AAE")
_MIN_PRECISION = 0.1
_RECALLS = np.linspace(0, 1, 101)
# Index of the first recall above the minimum of 0.1.
_FIRST = 11
_AP_WEIGHT = 5


class ClassScores(NamedTuple):
    """Scores of one class.

    Attributes:
        positives: number of true boxes.
        ap: average precision by gate in metres.
        errors: ERRORS by name; 1 if the recall does not exceed the minimum.
    """

    positives: int
    ap: Mapping[float, float]
    errors: Mapping[str, float]

    @property
    def mean_ap(self) -> float:
        """Average precision, mean over the gates."""
        return float(np.mean(list(self.ap.values())))


class BenchmarkScores(NamedTuple):
    """Scores of the classes that have true boxes.

    Attributes:
        by_class: scores by class.
    """

    by_class: Mapping[str, ClassScores]

    @property
    def mean_ap(self) -> float:
        """Mean average precision over the classes; NaN without classes."""
        return _mean([scores.mean_ap for scores in self.by_class.values()])

    @property
    def errors(self) -> dict[str, float]:
        """Mean errors over the classes."""
        return {name: _mean([scores.errors[name] for scores in self.by_class.values()]) for name in ERRORS}

    @property
    def nds(self) -> float:
        """NuScenes detection score."""
        scores = [max(0.0, 1 - error) for error in self.errors.values()]
        return (_AP_WEIGHT * self.mean_ap + sum(scores)) / (_AP_WEIGHT + len(scores))


def score_benchmark(detected: BoxTable, truth: BoxTable, range_m: float | None = None) -> BenchmarkScores:
    """Score the classes of `KINDS` that have true boxes, up to their RANGE_M or `range_m`, whichever is less."""
    by_class = {}
    for kind, far_m in RANGE_M.items():
        limit_m = min(far_m, range_m or far_m)
        of_class, true = (
            some.select((some.kind == kind) & (some.distance_m < limit_m) & ~some.left_out)
            for some in (detected, truth)
        )
        if len(true):
            by_class[kind] = _score_class(of_class, true)
    return BenchmarkScores(by_class)


def _score_class(detected: BoxTable, truth: BoxTable) -> ClassScores:
    order = falling_scores(detected.score)
    matches = {gate_m: match_by_score(detected, truth, gate_m)[order] for gate_m in GATES_M}
    precision = {gate_m: _average_precision(match, len(truth)) for gate_m, match in matches.items()}
    return ClassScores(len(truth), precision, _mean_errors(detected.select(order), truth, matches[ERROR_GATE_M]))


def _average_precision(match: IntArray, positives: int) -> float:
    """Return the average precision of matches (N,) by falling score: mean above minimum recall and precision."""
    hits = np.cumsum(match >= 0)
    if not len(hits) or not hits[-1]:
        return 0.0
    precision = hits / np.arange(1, len(hits) + 1)
    curve = np.interp(_RECALLS, hits / positives, precision, right=0)
    return float(np.maximum(curve[_FIRST:] - _MIN_PRECISION, 0).mean() / (1 - _MIN_PRECISION))


def _mean_errors(detected: BoxTable, truth: BoxTable, match: IntArray) -> dict[str, float]:
    """Return the errors of matches (N,) by falling score: mean over recalls of the mean up to each recall."""
    hit = match >= 0
    if not hit.any():
        return dict.fromkeys(ERRORS, 1.0)
    score = np.interp(_RECALLS, np.cumsum(hit) / len(truth), detected.score, right=0)
    reached = np.flatnonzero(score)
    last = int(reached[-1]) if len(reached) else 0
    if last < _FIRST:
        return dict.fromkeys(ERRORS, 1.0)
    own = detected.select(hit)
    means = {name: _running_mean(error) for name, error in _errors(own, truth.select(match[hit])).items()}
    # np.interp needs rising scores.
    curves = {name: np.interp(score[::-1], own.score[::-1], mean[::-1])[::-1] for name, mean in means.items()}
    return {name: float(curve[_FIRST : last + 1].mean()) for name, curve in curves.items()}


def _errors(detected: BoxTable, truth: BoxTable) -> dict[str, FloatArray]:
    """Return the errors (N,) of N pairs; NaN if unknown."""
    shared = np.minimum(detected.size_wlh_m, truth.size_wlh_m).prod(axis=1)
    volumes = detected.size_wlh_m.prod(axis=1) + truth.size_wlh_m.prod(axis=1)
    wrong = np.where(truth.attribute == "", np.nan, detected.attribute != truth.attribute)
    errors = (
        np.hypot(*(detected.centre_m - truth.centre_m)[:, :2].T),
        1 - shared / (volumes - shared),
        np.abs(wrap_angle(detected.yaw_rad - truth.yaw_rad)),
        np.hypot(*(detected.velocity_mps - truth.velocity_mps).T),
        wrong,
    )
    return dict(zip(ERRORS, errors, strict=True))


def _running_mean(values: FloatArray) -> FloatArray:
    """Return the mean (N,) of the known values so far; 0 before the first, 1 if all are NaN."""
    known = ~np.isnan(values)
    if not known.any():
        return np.ones(len(values))
    count = np.cumsum(known)
    return np.asarray(np.nancumsum(values) / np.maximum(count, 1))


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else float("nan")
