"""Vehicles as one class: by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from appocc.colours import DAYLIGHT
from appocc.evaluation.detections.box_table import BoxTable
from appocc.evaluation.detections.vehicles import VehicleDetection, score_vehicle_detection

RED, BLUE = (190.0, 30.0, 30.0), (30.0, 60.0, 170.0)


def table(*places: tuple[float, float], **changes: Any) -> BoxTable:
    """Cars of key frame 0 at places in the ego frame; the ego stands at the origin."""
    n = len(places)
    centre_m = np.array([(x, y, 0.8) for x, y in places]).reshape(n, 3)
    fields: dict[str, Any] = {
        "sample": np.zeros(n, np.int64),
        "centre_m": centre_m,
        "size_wlh_m": np.tile([1.8, 4.5, 1.6], (n, 1)),
        "yaw_rad": np.zeros(n),
        "velocity_mps": np.zeros((n, 2)),
        "kind": np.full(n, "car"),
        "attribute": np.full(n, ""),
        "score": np.ones(n),
        "rgb": np.full((n, 3), np.nan),
        "distance_m": np.hypot(*centre_m[:, :2].T),
        "vehicle": np.ones(n, np.bool_),
        "left_out": np.zeros(n, np.bool_),
    }
    return BoxTable(**{**fields, **{name: np.array(value) for name, value in changes.items()}})


def scored(detected: BoxTable, truth: BoxTable) -> tuple[float, VehicleDetection, VehicleDetection]:
    score, (near, far) = score_vehicle_detection(detected, truth, [DAYLIGHT])
    return score, near, far


def test_the_score_with_the_best_f1_is_chosen() -> None:
    truth = table((10, 0), (15, 5), (30, 0))
    detected = table((10, 1), (15, 5), (30, 1), (5, 5), (6, 9), score=[0.9, 0.8, 0.6, 0.5, 0.4])
    score, near, far = scored(detected, truth)
    assert score == 0.6
    assert (near.vehicles, near.found, near.false) == (2, 2, 0)
    assert (far.vehicles, far.found, far.false) == (3, 3, 0)
    assert far.as_json()["F1"] == 1


def test_equal_scores_are_kept_together() -> None:
    truth = table((10, 0))
    score, _, far = scored(table((10, 0), (20, 0), (25, 0), score=[0.5, 0.5, 0.5]), truth)
    assert (score, far.found, far.false) == (0.5, 1, 2)
    assert far.as_json()["F1"] == pytest.approx(0.5)


def test_a_pair_counts_at_the_distance_of_its_vehicle() -> None:
    truth = table((20.5, 0), (19.5, 9), (39.5, -5))
    detected = table((19.5, 0), (20.5, 9), (40.5, -5), (41.0, 9.0))
    _, near, far = scored(detected, truth)
    # The first vehicle is beyond 20 m, the second too (21.5 m); the detection at 42 m is beyond 40 m.
    assert (near.vehicles, near.found, near.false) == (0, 0, 0)
    assert (far.vehicles, far.found, far.false) == (3, 3, 0)


def test_centres_two_metres_apart_are_no_pair() -> None:
    assert scored(table((12, 0)), table((10, 0)))[2].found == 0
    assert scored(table((11.99, 0)), table((10, 0)))[2].found == 1
    other_frame = table((10, 0), sample=[1])
    assert scored(other_frame, table((10, 0)))[2].found == 0


def test_people_are_no_vehicles() -> None:
    detected = table((10, 0), (5, 5), vehicle=[True, False], kind=["car", "pedestrian"])
    _, _, far = scored(detected, table((10, 0), (5, 5), vehicle=[True, False]))
    assert (far.vehicles, far.found, far.false) == (1, 1, 0)


def test_headings_and_paints_of_the_found_ones() -> None:
    places = ((10, 0), (15, 5), (20, 10), (30, 0))
    truth = table(*places, yaw_rad=np.pi * np.array([1, 0, 0, 0]), rgb=[RED, RED, BLUE, (np.nan,) * 3])
    turned = np.radians([-165.0, 19.0, 21.0, 180.0])
    _, _, far = scored(table(*places, yaw_rad=turned, rgb=[RED, BLUE, BLUE, BLUE]), truth)
    assert far.heading_right == 0.5
    assert far.ciede2000_median == pytest.approx(0, abs=1e-9)
    assert far.colour_word_right == pytest.approx(2 / 3)


def test_nothing_detected_and_nothing_to_detect() -> None:
    score, _, far = scored(table(), table((10, 0)))
    assert np.isnan(score)
    assert (far.vehicles, far.found, far.false) == (1, 0, 0)
    assert far.as_json()["F1"] == 0
    _, _, far = scored(table((10, 0)), table())
    assert (far.vehicles, far.found, far.false) == (0, 0, 1)
    assert np.isnan(far.heading_right)
    assert np.isnan(far.as_json()["recall"])
