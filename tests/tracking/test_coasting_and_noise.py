"""Tracks coast where it pays, and detections are as noisy as their scores say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_detections import follow, seen

from appocc.checks import FloatArray, IntArray
from tracking.class_models import CLASS_MODELS, ClassModel, ClassTable
from tracking.detections import Detections
from tracking.records import DETECTION
from tracking.track_table import LifecycleConfig
from tracking.tracker import Tracker, TrackerConfig
from tracking.world_detections import detections_in_world

NOWHERE = np.zeros((0, 2))
NOISE_M2 = 0.04 * np.eye(2)


# Places of cars that are all detected at once, and when none is detected.
ROW = [(x, y) for x in (-20, 0, 20) for y in (-10, 10)]
PERIOD, AWAY = 10, 4


def gaps(returning: bool, periods: int = 12) -> list[int]:
    """Numbers of coasted tracks in the frames of the last gap; the cars return after gaps, or others appear."""

    def at(i: int) -> Detections:
        period, frame = divmod(i, PERIOD)
        shift = 0.0 if returning or period % 2 == 0 else 5.0
        return seen(NOWHERE if frame >= PERIOD - AWAY else [(x + shift, y) for x, y in ROW])

    moments = follow(at, periods * PERIOD)
    return [sum(not track.seen for track in moment) for moment in moments[-AWAY:]]


def test_tracks_coast_where_tracks_of_the_recording_return() -> None:
    assert gaps(returning=True) == [len(ROW)] * AWAY


def test_tracks_end_with_their_detections_where_none_returns() -> None:
    assert gaps(returning=False)[0] < len(ROW)
    assert gaps(returning=False)[-1] == 0


def test_a_track_coasts_at_first_for_as_long_as_a_return_is_likely() -> None:
    moments = follow(lambda i: seen([(10, 0)] if i < 10 else NOWHERE), 30)
    assert 3 <= sum(not track.seen for moment in moments[10:] for track in moment) <= 12


def test_the_chance_at_which_a_track_stops_can_be_set() -> None:
    tracker = Tracker(TrackerConfig(lifecycle=LifecycleConfig(coast_chance=0.0, coast_s=0.6)))
    moments = follow(lambda i: seen([(10, 0)] if i < 10 else NOWHERE, log_odds=-1.5), 30, tracker=tracker)
    assert sum(not track.seen for moment in moments[10:] for track in moment) == 6


def test_hidden_tracks_coast_for_themselves() -> None:
    """Cars that a truck hides return, cars in the open end: the chances are learnt apart."""

    def at(i: int) -> Detections:
        period, frame = divmod(i, PERIOD)
        cars = [(25.0, y) for y in (-9.0, 0.0, 9.0)] + [(-20.0, 5 * (period % 2) + y) for y in (-15.0, 0.0, 15.0)]
        trucks = [(12.0, y / 2) for y in (-9.0, 0.0, 9.0)]
        return seen(trucks + cars * (frame < PERIOD - AWAY), size_m=(2.4, 2.4, 3.0))

    last = follow(at, 12 * PERIOD)[-1]
    assert sorted(round(float(track.position_world_m[0])) for track in last if not track.seen) == [25, 25, 25]


def test_a_car_that_was_detected_once_is_predicted_over_a_few_misses() -> None:
    assert [len(tracks) for tracks in follow(lambda i: seen([(10, 0)] if i == 0 else NOWHERE), 5)] == [1, 1, 1, 1, 0]


def test_the_box_of_a_hidden_car_is_less_exact() -> None:
    table = ClassTable(CLASS_MODELS, ClassModel())
    both = detections_in_world(seen([(10, 0), (20, 0)]), np.eye(4), table, np.array([0.0, 1.0]))
    whole, cut = both["noise_m2"]
    np.testing.assert_allclose(cut, 1.5 * whole)


def learn(table: ClassTable, log_odds: float, std_m: float, frames: int, seed: int = 0) -> None:
    """Let a table learn from innovations of a known spread, with exact predictions."""
    dice, car, found = np.random.default_rng(seed), table.numbers(["car"]), np.zeros(1, DETECTION)
    found["kind"], found["noise_level"], found["noise_m2"] = car, table.noise_level(np.array([log_odds])), NOISE_M2
    for _ in range(frames):
        found["surplus_noise_m2"] = (1 - factors(table, car, [log_odds])[:, None, None]) * NOISE_M2
        innovation_m, cov_m2 = dice.normal(0, std_m, (1, 2)), np.full((1, 2, 2), 1e-9)
        table.learn_noise(found, np.zeros(1, np.int64), innovation_m, cov_m2, np.ones(1, np.bool_))


def factors(table: ClassTable, kind: IntArray, log_odds: list[float]) -> FloatArray:
    """The learnt factors on the variances of positions."""
    return table.noise_factors[table.noise_level(np.array(log_odds)), kind]


def test_the_noise_is_learnt_for_each_score() -> None:
    table = ClassTable(CLASS_MODELS, ClassModel())
    learn(table, 5.0, 0.1, 1500)
    learn(table, -2.0, 0.3, 1500)
    kind = table.numbers(["car", "car"])
    sure, unsure = factors(table, kind, [5.0, -2.0])
    assert sure == pytest.approx(0.1**2 / 0.04, rel=0.25)
    assert unsure == pytest.approx(0.3**2 / 0.04, rel=0.25)


def test_scores_that_were_never_seen_have_the_noise_of_their_category() -> None:
    table = ClassTable(CLASS_MODELS, ClassModel())
    learn(table, 5.0, 0.05, 1500)
    kind = table.numbers(["car", "pedestrian"])
    other, unknown = factors(table, kind, [-2.0, -2.0])
    assert other < 0.5
    assert unknown == 1.0


def test_the_noise_of_unsure_detections_enters_the_covariance() -> None:
    table = ClassTable(CLASS_MODELS, ClassModel())
    learn(table, 5.0, 0.05, 1500)
    learn(table, -2.0, 0.4, 1500)
    sure, unsure = (
        detections_in_world(seen([(10, 0)], log_odds=each), np.eye(4), table, np.zeros(1)) for each in (5.0, -2.0)
    )
    assert np.array_equal(sure["noise_m2"], unsure["noise_m2"])  # association keeps the configured noise
    assert sure["surplus_noise_m2"][0, 0, 0] > unsure["surplus_noise_m2"][0, 0, 0]


def test_a_parked_car_is_surer_of_its_place_than_a_driving_one() -> None:
    """After the same number of detections, its steady state has less process noise."""
    assert std_m("car", 0.0) < 0.9 * std_m("car", 8.0)


def test_who_stands_may_walk_on() -> None:
    assert std_m("pedestrian", 0.0) == pytest.approx(std_m("pedestrian", 1.5), rel=0.01)


def std_m(kind: str, speed_mps: float) -> float:
    """Standard deviation of the position of an object after three seconds."""
    tracker = Tracker()
    follow(lambda i: seen([(-20 + speed_mps * i / 10, 0)], kind=[kind]), 30, tracker=tracker)
    return float(tracker._table.filters.position_std_m()[0])


def test_a_truncated_box_begins_a_track_of_unknown_direction() -> None:
    """Its heading is that of the visible part."""

    def speed_std_mps(truncated: bool) -> list[float]:
        tracker = Tracker()
        found = replace(seen([(10, 0)]), truncated=np.array([truncated]))
        tracker.update(found, 100_000, np.eye(4))
        return [float(each) for each in np.sqrt(np.diag(tracker._table.filters.cov[0])[2:])]

    assert speed_std_mps(False) == pytest.approx([8.0, 0.5])
    assert speed_std_mps(True) == pytest.approx([8.0, 8.0])
