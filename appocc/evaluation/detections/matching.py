"""Matching of detections with true boxes by the distance of their centres, best scores first."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from appocc.checks import FloatArray, IntArray
from appocc.evaluation.detections.box_table import BoxTable


def falling_scores(score: FloatArray) -> IntArray:
    """Return the order (N,) of scores, highest first; of equal ones the last comes first, as in the devkit."""
    return np.argsort(score, kind="stable")[::-1]


def match_by_score(detected: BoxTable, truth: BoxTable, gate_m: float) -> IntArray:
    """Return the index (N,) of the true box of each detection, -1 for none.

    Detections choose by falling score: each takes the nearest true box of its key frame that is not taken yet, if it
    is nearer than the gate.
    """
    found = np.full(len(detected), -1, np.int64)
    order = falling_scores(detected.score)
    order = order[np.argsort(detected.sample[order], kind="stable")]
    for sample in np.intersect1d(detected.sample, truth.sample).tolist():
        low, high = np.searchsorted(detected.sample[order], [sample, sample + 1])
        own, true = order[low:high], np.flatnonzero(truth.sample == sample)
        apart_m = cdist(detected.centre_m[own, :2], truth.centre_m[true, :2])
        for row, one in enumerate(own.tolist()):
            nearest = int(apart_m[row].argmin())
            if apart_m[row, nearest] < gate_m:
                found[one] = true[nearest]
                apart_m[:, nearest] = np.inf
    return found
