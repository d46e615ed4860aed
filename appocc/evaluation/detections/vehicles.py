"""Detected vehicles as one class: precision and recall, headings, and paints against the true maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.colours import Exposure, lab_from_rgb, word_probabilities
from appocc.evaluation.cells import ratio
from appocc.evaluation.detections.box_table import BoxTable
from appocc.evaluation.detections.matching import match_by_score
from appocc.geometry import wrap_angle

GATE_M = 2.0
RANGES_M = (20.0, 40.0)
_HEADING_RAD = np.radians(20.0)


@dataclass(frozen=True)
class VehicleDetection:
    """Vehicles within a distance of the ego, at one score.

    Attributes:
        range_m: the distance.
        vehicles: number of true vehicles.
        found: number of those that are detected.
        false: number of detections without a vehicle.
        heading_right: share of the found ones whose heading is off by at most 20 degrees.
        ciede2000_median: median colour difference of the paints of the found ones; NaN if colours are unknown.
        colour_word_right: share of the found ones whose most likely colour word is the true one; NaN as above.
    """

    range_m: float
    vehicles: int
    found: int
    false: int
    heading_right: float
    ciede2000_median: float
    colour_word_right: float

    def as_json(self) -> dict[str, Any]:
        """Return the figures; shares 0..1."""
        return {
            "vehicles": self.vehicles,
            "found": self.found,
            "false": self.false,
            "precision": ratio(self.found, self.found + self.false),
            "recall": ratio(self.found, self.vehicles),
            "F1": ratio(2 * self.found, self.vehicles + self.found + self.false),
            "heading_within_20_deg": self.heading_right,
            "ciede2000_median": self.ciede2000_median,
            "colour_word_right": self.colour_word_right,
        }


def score_vehicle_detection(
    detected: BoxTable, truth: BoxTable, light: Sequence[Exposure]
) -> tuple[float, list[VehicleDetection]]:
    """Score vehicles at the score that gives the best F1 within the largest range.

    A pair counts at the distance of its true vehicle, so that no pair is divided by the limit.

    Args:
        detected: detections of all classes.
        truth: annotated boxes of all categories; every vehicle counts, occluded ones too.
        light: exposure of the true map of each key frame; empty if the paints are unknown.

    Returns:
        The score (NaN without detections), and the figures by range.
    """
    detected, truth = detected.select(detected.vehicle), truth.select(truth.vehicle)
    match = match_by_score(detected, truth, GATE_M)
    hit = match >= 0
    distance_m = detected.distance_m.copy()
    distance_m[hit] = truth.distance_m[match[hit]]
    lowest = _best_score(detected.score, hit, distance_m, truth.distance_m)
    kept = detected.score >= lowest
    own, true = detected.select(hit & kept), truth.select(match[hit & kept])
    turned = np.abs(wrap_angle(own.yaw_rad - true.yaw_rad)) <= _HEADING_RAD
    delta_e, word_right = _paint_errors(own, true, light)
    scores = []
    for range_m in RANGES_M:
        near = true.distance_m <= range_m
        scores.append(
            VehicleDetection(
                range_m=range_m,
                vehicles=int((truth.distance_m <= range_m).sum()),
                found=int(near.sum()),
                false=int((kept & ~hit & (distance_m <= range_m)).sum()),
                heading_right=ratio(turned[near].sum(), near.sum()),
                ciede2000_median=_median(delta_e[near]),
                colour_word_right=_mean(word_right[near]),
            )
        )
    return lowest, scores


def _best_score(score: FloatArray, hit: BoolArray, distance_m: FloatArray, truth_m: FloatArray) -> float:
    """Return the lowest score of the detections with the best F1 within the largest range; NaN without detections.

    Lower scores do not change the matches of higher ones, so that one matching serves all.
    """
    near = distance_m <= RANGES_M[-1]
    score, hit = score[near], hit[near]
    if not len(score):
        return float("nan")
    order = np.argsort(-score, kind="stable")
    ranked = score[order]
    f1 = 2 * np.cumsum(hit[order]) / (np.arange(1, len(ranked) + 1) + (truth_m <= RANGES_M[-1]).sum())
    # Equal scores are kept or left out together.
    f1[:-1][ranked[:-1] == ranked[1:]] = -1
    return float(ranked[int(f1.argmax())])


def _paint_errors(detected: BoxTable, truth: BoxTable, light: Sequence[Exposure]) -> tuple[FloatArray, FloatArray]:
    """Return CIEDE2000 (N,) and whether the colour words agree (N,) of N pairs; NaN where a colour is unknown."""
    from skimage.color import deltaE_ciede2000

    delta_e, right = np.full(len(truth), np.nan), np.full(len(truth), np.nan)
    known = np.isfinite(detected.rgb).all(axis=1) & np.isfinite(truth.rgb).all(axis=1)
    delta_e[known] = deltaE_ciede2000(lab_from_rgb(detected.rgb[known]), lab_from_rgb(truth.rgb[known]))
    for number, exposure in enumerate(light):
        own = known & (truth.sample == number)
        words = [word_probabilities(some.rgb[own], exposure).argmax(axis=1) for some in (detected, truth)]
        right[own] = words[0] == words[1]
    return delta_e, right


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")
