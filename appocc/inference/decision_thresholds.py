"""Decision thresholds of a map: those at which the IoU that its probabilities promise is largest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from appocc.bevmap import CLASSES
from appocc.checks import BoolArray, Float32Array
from appocc.grid import BEVGrid

# Area of cells that the validation data counts for beside the map; a map of few vehicles says little about them.
_VALIDATION_M2 = 40.0
_MOST_STEPS, _TOLERANCE = 20, 1e-4


def decision_thresholds(
    occupancy: Float32Array, seen: BoolArray, grid: BEVGrid, validated: Mapping[str, float]
) -> dict[str, float]:
    """Return the threshold of each class for one map.

    With calibrated probabilities, the threshold of the largest expected IoU is IoU / (1 + IoU) (Nowozin, "Optimal
    decisions from probabilistic models: the intersection-over-union case", CVPR 2014). Where a network is less sure
    than on its validation data, as on real streets, the threshold is lower.

    Args:
        occupancy: (3, X, Y) probabilities of road, vehicle, lane.
        seen: (X, Y) cells that a camera sees.
        grid: grid of the map.
        validated: threshold of each class chosen on validation data.
    """
    cells = _VALIDATION_M2 / grid.cell_m**2
    pairs = zip(CLASSES, occupancy, strict=True)
    return {name: _best(layer[seen].astype(np.float64), validated[name], cells) for name, layer in pairs}


def _best(shares: np.ndarray, validated: float, cells: float) -> float:
    """Return the best threshold of some probabilities (N,), by Dinkelbach's iteration on the ratio of sums."""
    prior = iou = validated / max(1 - validated, _TOLERANCE)
    for _ in range(_MOST_STEPS):
        on = shares >= iou / (1 + iou)
        sure = shares[on].sum()
        previous, iou = iou, (prior * cells + sure) / (cells + on.sum() + shares.sum() - sure)
        if abs(iou - previous) < _TOLERANCE:
            break
    return float(iou / (1 + iou))
