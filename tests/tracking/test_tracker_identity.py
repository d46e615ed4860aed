"""What the tracker takes for one and the same vehicle, and what it remembers of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_detections import CAR_M, STEP_US, follow, ids, seen
from made_map import pose

from tracking.class_models import ClassModel, ClassTable
from tracking.detections import Detections, probability_from_log_odds
from tracking.track_table import LifecycleConfig, TrackTable
from tracking.tracker import Tracker, TrackerConfig
from tracking.world_detections import detections_in_world

# Twins ------------------------------------------------------------------------------------------------------------


def test_duplicate_detections_are_suppressed() -> None:
    # Needs the change of tracking.tracker that only distinct detections are taken.
    result = follow(lambda i: seen([[10 + i, 0]] * 2), 20)
    assert ids(result) == [[1]] * 20
    assert [track.detection for moment in result for track in moment] == [0] * 20
    alone = follow(lambda i: seen([[10 + i, 0]]), 20)
    assert [str(moment) for moment in result] == [str(moment) for moment in alone]


def test_a_twin_that_comes_and_goes_leaves_no_trace() -> None:
    # Needs the change of tracking.tracker that only distinct detections are taken.
    def at(i: int) -> Detections:
        places, sure = np.array([[10 + i, 0], [10.4 + i, 0.3]]), [3.0, 1.0]
        return seen(places, log_odds=sure) if i % 3 else seen(places[:1], log_odds=sure[:1])

    assert ids(follow(at, 20)) == [[1]] * 20


def test_the_surer_of_two_stays_and_of_equals_the_first() -> None:
    places = np.array([[0, 0], [0.5, 0], [20, 0], [20, 0], [20, 0], [40, 0]])
    assert seen(places, log_odds=[1, 2, 3, 3, 3, 0]).resolve_duplicates()[0].tolist() == [
        False,
        True,
        True,
        False,
        False,
        True,
    ]


def test_a_chain_is_thinned_not_swallowed() -> None:
    """The last is a twin of the middle one alone, which is left out itself."""
    assert seen([[0.0, 0], [0.8, 0], [1.6, 0]], log_odds=[3, 2, 1]).resolve_duplicates()[0].tolist() == [
        True,
        False,
        True,
    ]


def test_half_a_width_of_the_narrower_decides() -> None:
    size = np.array([[2, 5, 1], [1, 5, 1]], dtype=np.float64)
    for apart, expected in ((0.49, [True, False]), (0.51, [True, True])):
        two = seen([[0, 0], [apart, 0]])
        two = Detections.from_boxes(two.ground_m, two.yaw_rad, size, two.log_odds, two.kind, two.view)
        assert two.resolve_duplicates()[0].tolist() == expected


def test_others_are_no_twins() -> None:
    assert seen([[0, 0], [0, 0]], kind=["car", "truck"]).resolve_duplicates()[0].all()
    assert seen([[0, 0], [0, 2.0]]).resolve_duplicates()[0].all()
    assert seen([[0, 0], [0.3, 0]], size_m=(0.5, 0.5, 1.7)).resolve_duplicates()[0].all()
    assert seen([]).resolve_duplicates()[0].shape == (0,)


# Kinds ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["7", "never seen", "Straßenbahn", "x" * 10_000])
def test_kinds_that_come_later(kind: str) -> None:
    result = follow(lambda i: seen([[10, 0], [20, 0]][: 1 + (i > 2)], kind=["car", kind][: 1 + (i > 2)]), 6)
    assert ids(result) == [[1]] * 3 + [[1, 2]] * 3
    assert result[-1][1].kind == kind


def test_a_vehicle_of_another_kind_is_another() -> None:
    """It begins at once, whatever unseen track of another kind it covers."""
    result = follow(lambda i: seen([[10, 0]], kind="car" if i < 5 else "truck"), 30)
    assert ids(result[:5]) == [[1]] * 5
    assert {track.kind: track.id for track in result[5]}["truck"] == 2
    assert [(track.id, track.kind) for track in result[-1]] == [(2, "truck")]


def test_the_less_likely_of_two_kinds_of_one_object_is_doubted() -> None:
    both = seen([[0, 0], [0.1, 0], [30, 0]], log_odds=[3.0, 0.0, 1.0], kind=["car", "truck", "truck"])
    kept, log_odds = both.resolve_duplicates()
    assert kept.all()
    assert log_odds.tolist() == pytest.approx([3 - np.log(2), -np.log(1 + np.exp(3)), 1.0])


# What is remembered -----------------------------------------------------------------------------------------------


def test_a_score_is_the_mean_of_what_was_seen_and_some_doubt() -> None:
    (track,) = Tracker().update(seen([[0, 0]], log_odds=3.0), STEP_US, pose())
    assert track.score == pytest.approx(probability_from_log_odds((3.0 - 1.5 * 2.0) / (1 + 1.5)))


def test_misses_lower_the_score_and_do_not_delete_a_sure_track() -> None:
    tracker = Tracker(TrackerConfig(lifecycle=LifecycleConfig(coast_s=3.0, coast_std_m=np.inf, coast_chance=0.0)))
    result = follow(lambda i: seen([[10, 0]] if i < 20 or i == 40 else []), 41, tracker=tracker)
    scores = [states[0].score for states in result]
    assert (np.diff(scores[19:40]) < 0).all()
    assert scores[19] > 0.85 > 0.5 > scores[39]
    # It is found again after `lost_s`, as a sure track is.
    assert scores[40] > scores[39]
    assert ids(result)[40] == [1]


@pytest.mark.parametrize(("log_odds", "again"), [(3.0, 1), (-1.0, 2)])
def test_unlikely_vehicles_are_deleted_once_lost(log_odds: float, again: int) -> None:
    def at(i: int) -> Detections:
        return seen([[10, 0]], log_odds=log_odds) if i < 10 else seen([[10, 0]] if i == 35 else [])

    assert follow(at, 36)[-1][0].id == again


def test_a_break_longer_than_anything_is_remembered_ends_all_tracks() -> None:
    parked = seen([[10, 0]])
    for seconds, number in ((2.9, 1), (3.1, 2)):
        tracker = Tracker(TrackerConfig(lifecycle=LifecycleConfig(forget_stationary_s=3.0)))
        follow(lambda _: parked, 20, tracker=tracker)
        (track,) = tracker.update(parked, 20 * STEP_US + round(seconds * 1e6), pose())
        assert track.id == number


def test_stationary_tracks_keep_their_position_while_hidden() -> None:
    classes = ClassTable({}, ClassModel())
    followed = TrackTable(LifecycleConfig(), classes)
    for i in range(20):
        sight = detections_in_world(seen([[0.05 * i, 0]]), pose(), classes, np.zeros(1))
        if i == 0:
            followed.add(sight, np.zeros(1, np.int64), np.ones(1, np.int64))
            continue
        followed.predict(0.1)
        followed.update(np.zeros(1, np.int64), sight, np.zeros(1, np.int64), sight["noise_m2"], np.zeros(1))
    assert followed.state["stationary"].all()
    for _ in range(3):
        followed.predict(1.0)
    np.testing.assert_allclose(followed.predictions()["displacement_m"][0], [0.5, 0], atol=0.1)


def test_a_vehicle_that_is_cut_off_for_long_keeps_its_size() -> None:
    def at(i: int) -> Detections:
        short = seen([[10, 0]], size_m=(1.8, 2.0, 1.5))
        return seen([[10, 0]]) if i < 5 else replace(short, truncated=np.ones(1, np.bool_))

    assert follow(at, 30)[-1][0].length_m == pytest.approx(CAR_M[1])


def test_little_seen_of_a_colour_says_little_of_the_next_one() -> None:
    """Variance about a median: three times that of a detection for one detection, hardly more for many."""
    config = LifecycleConfig()
    classes = ClassTable({}, ClassModel())
    followed = TrackTable(config, classes)
    coloured = replace(seen([[0, 0]]), lab=np.array([[50.0, 40.0, 10.0]]), rgb=np.full((1, 3), 100.0))
    both = [detections_in_world(each, pose(), classes, np.zeros(1)) for each in (coloured, seen([[9, 0]]))]
    for number, sight in enumerate(both):
        followed.add(sight, np.zeros(1, np.int64), np.array([number]))
    expected, share = np.square(config.lab_std), config.lab_prior_weight / (config.lab_prior_weight + 1)
    np.testing.assert_allclose(followed.predictions()["lab_variance"], [3 * share * expected, 3 * expected])


def test_a_vehicle_without_a_colour_is_not_found_again_far_astray() -> None:
    """At any cost: without a colour there is no evidence for the same vehicle."""
    rule = TrackerConfig()
    tracker = Tracker(replace(rule, drifted=replace(rule.drifted, max_cost=1000.0)))

    def at(i: int) -> Detections:
        return seen([[1.0 * i, 0]] if i < 20 else [] if i < 40 else [[1.0 * i, 9]])

    assert follow(at, 41, tracker=tracker)[-1][0].id == 2
