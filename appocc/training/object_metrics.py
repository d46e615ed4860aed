"""Validation metrics of objects: F1 of vehicles at every score, and the score with the best one."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from appocc.checks import FloatArray
from appocc.grid import BEVGrid
from appocc.models.base import ObjectOutput
from appocc.models.object_decoding import decode_objects
from appocc.objects import KINDS, PEOPLE
from appocc.probability_calibration import Calibration, ProbabilityHistogram, fit_temperature_and_bias
from appocc.training.batches.packed_objects import KIND, XY

# Candidate scores are k / 100.
BINS = 100
# A vehicle is found by a box whose centre is nearer than this; vehicles out of range are ignored.
_GATE_M, _RANGE_M = 2.0, 40.0
_PEOPLE = [KINDS.index(kind) for kind in PEOPLE]


def object_counts(output: ObjectOutput, objects: Tensor, grid: BEVGrid) -> Tensor:
    """Return the counts (3, BINS) of a batch: found vehicles and false boxes by score, and in [2, 0] true vehicles.

    Args:
        output: head outputs of a batch.
        objects: (B, K, 13) true objects.
        grid: grid of the maps.
    """
    counts = np.zeros((3, BINS))
    everywhere = np.ones(grid.shape, np.bool_)
    for number, rows in enumerate(objects.cpu().numpy()):
        own = ObjectOutput(*(each[number : number + 1] for each in output))
        found = decode_objects(own, grid, everywhere, moving=True)
        found = found.select(found.are_vehicles)
        vehicles = np.isfinite(rows[:, KIND]) & ~np.isin(rows[:, KIND], _PEOPLE)
        true_m = rows[vehicles][:, XY].astype(np.float64)
        place = np.minimum((found.score * BINS).astype(int), BINS - 1)
        hit = _hits(found.centre_m[:, :2], true_m)
        near = np.linalg.norm(found.centre_m[:, :2], axis=1) <= _RANGE_M
        counts[0] += np.bincount(place[hit & near], minlength=BINS)
        counts[1] += np.bincount(place[~hit & near], minlength=BINS)
        counts[2, 0] += (np.linalg.norm(true_m, axis=1) <= _RANGE_M).sum()
    return torch.from_numpy(counts)


def _hits(found_m: FloatArray, true_m: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(N,) boxes, the best first, that find a vehicle which no better box has found."""
    free = np.ones(len(true_m), np.bool_)
    hit = np.zeros(len(found_m), np.bool_)
    for i, centre in enumerate(found_m):
        distance = np.where(free, np.linalg.norm(true_m - centre, axis=1), np.inf)
        if len(distance) and distance.min() < _GATE_M:
            hit[i], free[distance.argmin()] = True, False
    return hit


def best_score(counts: Tensor) -> tuple[float, float]:
    """Return the best F1, 0..1, and its score, of counts (3, BINS); 0 and 0.5 without true vehicles."""
    found, false = counts[:2].flip(-1).cumsum(-1).flip(-1).numpy()
    total = float(counts[2, 0])
    if not total:
        return 0.0, 0.5
    f1 = 2 * found / (found + false + total)
    best = int(f1.argmax())
    return float(f1[best]), best / BINS


def score_calibration(counts: Tensor) -> Calibration:
    """Return temperature and bias that fit the scores of boxes to the observed shares of found vehicles."""
    found, false = counts[:2].numpy()
    middle = (np.arange(BINS) + 0.5) / BINS
    return fit_temperature_and_bias(ProbabilityHistogram(found + false, (found + false) * middle, found))
