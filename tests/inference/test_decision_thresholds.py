"""Decision thresholds of a map: the largest expected IoU, near the validated threshold."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.grid import BEVGrid
from appocc.inference.decision_thresholds import decision_thresholds

GRID = BEVGrid(0.0, 40.0, 0.0, 40.0, 0.4)
SEEN = np.ones(GRID.shape, np.bool_)
VALIDATED = {"road": 0.48, "vehicle": 0.32, "lane": 0.18}


def thresholds(layer: np.ndarray, seen: np.ndarray = SEEN) -> dict[str, float]:
    return decision_thresholds(np.stack([layer] * 3).astype(np.float32), seen, GRID, VALIDATED)


def expected_iou(layer: np.ndarray, threshold: float, validated: float) -> float:
    """Expected intersection over union, with the validated one for 40 square metres."""
    on, cells = layer >= threshold, 40 / 0.4**2
    prior = validated / (1 - validated)
    return float((prior * cells + layer[on].sum()) / (cells + on.sum() + layer[~on].sum()))


@pytest.mark.parametrize("sharpness", [0.3, 1.0, 3.0])
def test_no_other_threshold_promises_a_larger_iou(sharpness: float) -> None:
    draw = np.random.default_rng(5)
    layer = 1 / (1 + np.exp(sharpness * draw.normal(2.0, 1.5, GRID.shape))).astype(np.float32)
    for name, found in thresholds(layer).items():
        best = max(expected_iou(layer, each, VALIDATED[name]) for each in np.linspace(0.01, 0.99, 99))
        assert expected_iou(layer, found, VALIDATED[name]) >= best - 1e-3


def test_an_unsure_map_has_lower_thresholds_than_a_sure_one() -> None:
    sure, unsure = (np.full(GRID.shape, 0.01) for _ in range(2))
    sure[:40], unsure[:40] = 0.95, 0.35
    assert thresholds(unsure)["road"] < thresholds(sure)["road"]
    assert thresholds(unsure)["road"] < 0.3


def test_a_map_without_anything_keeps_the_validated_thresholds() -> None:
    assert thresholds(np.zeros(GRID.shape)) == pytest.approx(VALIDATED)
    assert thresholds(np.full(GRID.shape, 0.9), ~SEEN) == pytest.approx(VALIDATED)


def test_only_seen_cells_count() -> None:
    layer = np.full(GRID.shape, 0.02)
    layer[:50] = 0.6
    seen = SEEN.copy()
    seen[:50] = False
    guessed = layer.copy()
    guessed[:50] = 0.9
    assert thresholds(layer, seen) == thresholds(guessed, seen)
