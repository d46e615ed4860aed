"""Input that should not be there, or not so: the tracker says what is wrong or goes on as one would expect."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from made_detections import STEP_US, follow, ids, seen
from made_map import pose

from appocc.checks import FloatArray
from appocc.errors import AppoccError, DataError, ShapeError
from tracking.detections import Detections
from tracking.presets import MAPS
from tracking.tracker import Tracker, TrackerConfig

# Values -----------------------------------------------------------------------------------------------------------

NAN, INF = np.nan, np.inf
BAD_VALUES = [
    ("ground_m", [[NAN, 0, 0]], "detections ground_m: expected finite numbers, got 1 of 3 that are not"),
    ("ground_m", [[0, 0, INF]], "detections ground_m: expected finite numbers"),
    ("ground_m", [[0, -1e10, 0]], r"detections ground_m: expected at most 1e\+09 m, got 1e\+10"),
    ("ground_m", [[0, 0]], r"detections ground_m: expected shape \(1, 3\), got \(1, 2\)"),
    ("yaw_rad", [NAN], "detections yaw_rad: expected finite numbers"),
    ("yaw_rad", [-INF], "detections yaw_rad: expected finite numbers"),
    ("log_odds", [NAN], "detections log_odds: expected finite numbers"),
    ("log_odds", [INF], "detections log_odds: expected finite numbers"),
    ("log_odds", [1e300], r"detections log_odds: expected 1e\+09 at most, got 1e\+300"),
    ("size_m", [[NAN, 4, 1]], "detections width and length: expected finite numbers"),
    ("size_m", [[1, INF, 1]], "detections width and length: expected finite numbers"),
    ("size_m", [[1, 4, INF]], "detections: expected sizes up to 1000 m, got inf m"),
    ("size_m", [[1, 1001, 1]], "detections: expected sizes up to 1000 m, got 1001 m"),
    ("size_m", [[0, 4, 1]], "detections: expected positive sizes, got 0 m"),
    ("size_m", [[1, 4, -1]], "detections: expected positive sizes, got -1 m"),
    ("rgb", [[1, 2, INF]], "detections rgb: expected finite numbers, or NaN where unknown, got infinity"),
    ("lab", [[-INF, 2, 3]], "detections lab: expected finite numbers, or NaN where unknown, got infinity"),
    ("heading_known", [True, False], r"detections heading_known: expected shape \(1\), got \(2,\)"),
]


@pytest.mark.parametrize(("name", "value", "complaint"), BAD_VALUES)
def test_detections_with_values_that_cannot_be(name: str, value: Any, complaint: str) -> None:
    good = seen([[10, 0]])
    values = {field: getattr(good, field) for field in good.__dataclass_fields__}
    with pytest.raises(ShapeError, match=complaint):
        Detections(**(values | {name: np.array(value)}))


def test_unknown_values_are_allowed() -> None:
    # An unknown height stays unknown in the track table.
    result = follow(lambda _: seen([[10, 0]], size_m=(1.8, 4.5, NAN)), 3)
    assert ids(result) == [[1]] * 3
    assert np.isnan(result[-1][0].height_m)
    assert np.isnan(result[-1][0].rgb).all()


@pytest.mark.parametrize("sure", [-1e9, 1e9])
def test_very_sure_detections(sure: float) -> None:
    result = follow(lambda _: seen([[10, 0]], log_odds=sure), 5)
    assert ids(result) == ([[1]] * 5 if sure > 0 else [[]] * 5)
    assert all(0 <= track.score <= 1 for moment in result for track in moment)


@pytest.mark.parametrize("size_m", [(1e-6, 1e-6, 1e-6), (1e-6, 1000, 1), (1000, 1000, 1000), (1000, 1e-6, 1)])
def test_tiny_and_huge_sizes(size_m: tuple[float, float, float]) -> None:
    result = follow(lambda i: seen([[10 + i, 0]], size_m=size_m), 10)
    assert ids(result) == [[1]] * 10
    assert (result[-1][0].width_m, result[-1][0].length_m, result[-1][0].height_m) == size_m


@pytest.mark.parametrize("size_m", [(0.7, 0.5, 1.8), (0.5, 0.5, 1.8)])
def test_heading_of_a_detection_wider_than_long(size_m: tuple[float, float, float]) -> None:
    # Needs the change of tracking.track_table._axis that the size's sign must not turn the axis.
    result = follow(lambda _: seen([[10, 0]], size_m=size_m, kind="pedestrian", yaw_rad=1.0), 10)
    assert result[-1][0].yaw_world_rad == pytest.approx(1.0)
    assert result[-1][0].heading_known


# Time -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wrong_us", [5 * STEP_US, 5 * STEP_US - 1, 0, -1])
def test_non_increasing_time_is_rejected_without_side_effects(wrong_us: int) -> None:
    tracker = Tracker()
    before = follow(lambda i: seen([[10 + i, 0]]), 5, tracker=tracker)
    with pytest.raises(DataError, match=rf"tracker: expected a time after 500000 us, got {wrong_us} us"):
        tracker.update(seen([[99, 9]], kind="bus"), wrong_us, pose())
    after = [tuple(tracker.update(seen([[15 + i, 0]]), (6 + i) * STEP_US, pose())) for i in range(3)]
    assert [str(moment) for moment in (*before, *after)] == [
        str(moment) for moment in follow(lambda i: seen([[10 + i, 0]]), 8)
    ]


def test_nothing_to_be_seen_for_long() -> None:
    tracker = Tracker()
    assert ids(follow(lambda i: seen([[10, 0]] if i in (0, 1, 900) else []), 901, tracker=tracker))[::900] == [
        [1],
        [2],
    ]
    assert ids(follow(lambda _: seen([]), 3)) == [[]] * 3


@pytest.mark.parametrize("hours", [1, 24 * 365 * 1000])
@pytest.mark.parametrize("step_m", [0.0, 1.0])
def test_tracks_are_forgotten_after_hours(hours: int, step_m: float) -> None:
    # Needs the change of tracking.tracker that tracks do not outlive a long gap between two frames.
    tracker = Tracker()
    follow(lambda i: seen([[10 + step_m * i, 0]]), 10, tracker=tracker)
    later_us = hours * 3_600_000_000
    result = [tuple(tracker.update(seen([[10, 0]]), later_us + i * STEP_US, pose())) for i in range(3)]
    assert ids(result) == [[2]] * 3
    np.testing.assert_allclose(result[-1][0].position_world_m, [10, 0, 0], atol=1e-6)


def test_two_seconds_between_frames_are_no_long_gap() -> None:
    tracker = Tracker()
    result = [tuple(tracker.update(seen([[10, 0]]), 1 + i * 2_000_000, pose())) for i in range(5)]
    assert ids(result) == [[1]] * 5


def test_a_microsecond_between_frames() -> None:
    tracker, random = Tracker(), np.random.default_rng(0)
    places = random.normal([10, 0], 0.2, (200, 2))
    result = [tuple(tracker.update(seen([place]), i + 1, pose())) for i, place in enumerate(places)]
    assert ids(result) == [[1]] * 200
    np.testing.assert_allclose(result[-1][0].position_world_m[:2], [10, 0], atol=0.06)
    assert result[-1][0].speed_mps < 0.02


# Places -----------------------------------------------------------------------------------------------------------


def test_an_ego_that_is_elsewhere_at_once() -> None:
    """The ego jumps by 1 km between two frames: old tracks are forgotten, detections start new ones."""
    tracker = Tracker()
    places = [pose(), pose(), pose(1000, 0, 1.0), pose(1000, 0, 1.0), *[pose()] * 2]
    result = [
        tuple(tracker.update(seen([[10, 0], [20, 5]]), (i + 1) * STEP_US, here)) for i, here in enumerate(places)
    ]
    reported = [{track.id for track in moment if track.seen} for moment in result]
    assert reported[:4] == [{1, 2}, {1, 2}, {3, 4}, {3, 4}]
    assert reported[4] == reported[5]
    assert not reported[4] & {3, 4}  # the first ones, found again within a second, or new ones
    long_after = [tuple(tracker.update(seen([[10, 0]]), (100 + i) * STEP_US, pose(5000))) for i in range(2)]
    assert min(min(each) for each in ids(long_after)) > 4


def _scaled() -> FloatArray:
    return np.diag([2.0, 2.0, 2.0, 1.0])


def _with(value: float) -> FloatArray:
    harmed = pose()
    harmed[0, 3] = value
    return harmed


@pytest.mark.parametrize(
    "bad",
    [_scaled(), np.diag([1.0, -1.0, 1.0, 1.0]), _with(NAN), _with(INF), _with(1e12), np.eye(3), np.zeros((4, 4))],
)
def test_a_pose_that_is_none_is_refused_and_does_no_harm(bad: FloatArray) -> None:
    tracker = Tracker()
    before = follow(lambda i: seen([[10 + i, 0]]), 5, tracker=tracker)
    with pytest.raises(ShapeError, match="world_from_ego"):
        tracker.update(seen([[15, 0]]), 6 * STEP_US, bad)
    after = tuple(tracker.update(seen([[15, 0]]), 6 * STEP_US, pose()))
    assert [str(moment) for moment in (*before, after)] == [
        str(moment) for moment in follow(lambda i: seen([[10 + i, 0]]), 6)
    ]


@pytest.mark.parametrize("far_m", [(500_000.0, 5_400_000.0), (-1e7, 1e7)])
def test_map_coordinates_lose_no_millimetre(far_m: tuple[float, float]) -> None:
    def at(i: int) -> Detections:
        return seen([[10 + 1.5 * i, 0.01 * i], [30, 4 - 0.8 * i]])

    near, far = (follow(at, 20, pose(*place)) for place in ((0.0, 0.0), far_m))
    assert ids(far) == ids(near)
    for one, other in zip(near[-1], far[-1], strict=True):
        np.testing.assert_allclose(other.position_world_m[:2] - far_m, one.position_world_m[:2], atol=1e-6)
        np.testing.assert_allclose(other.velocity_world_mps, one.velocity_world_mps, atol=1e-6)


def test_five_thousand_vehicles() -> None:
    """A grid of vehicles 8 m apart, each of which goes its own way at up to 10 m/s."""
    random = np.random.default_rng(1)
    x, y = np.meshgrid(np.arange(100) * 8.0, np.arange(50) * 8.0)
    start, speed = np.stack([x.ravel(), y.ravel()], axis=1), random.uniform(-10, 10, 5000)
    order = [random.permutation(5000) for _ in range(4)]
    result = follow(lambda i: seen((start + 0.1 * i * np.stack([speed, 0 * speed], axis=1))[order[i]]), 4)
    assert [len(moment) for moment in result] == [5000] * 4
    whose = [{track.id: int(order[i][track.detection or 0]) for track in moment} for i, moment in enumerate(result)]
    assert whose[1] == whose[2] == whose[3] == whose[0]


# Anything -----------------------------------------------------------------------------------------------------------


def random_frame(random: np.random.Generator) -> tuple[Detections, FloatArray]:
    """Up to five detections, near or at the end of the world, and a pose, most often one.

    Raises:
        ShapeError: if they cannot be.
    """
    n = int(random.integers(0, 6))
    places = random.choice([0, 1, 1e3, 1e8], (n, 2)) * random.normal(0, 1, (n, 2)).round(1)
    size_m = 10.0 ** random.integers(-3, 3, 3)
    x, y = random.choice([0, 1e6, NAN], 2, p=[0.8, 0.15, 0.05])
    return seen(places, size_m, random.choice([-9, 0, 3, 1e6])), pose(x, y)


@pytest.mark.parametrize("config", [None, MAPS])
def test_random_input_is_rejected_or_tracked(config: TrackerConfig | None) -> None:
    random = np.random.default_rng(2)
    tracker, time_us, reported = Tracker(config), 0, 0
    for _ in range(300):
        time_us += int(random.choice([1, 1000, 100_000, 10_000_000, 0]))
        detections, here = random_frame(random)
        try:
            tracks = tracker.update(detections, time_us, here)
        except AppoccError:
            continue
        reported += len(tracks)
        for track in tracks:
            assert np.isfinite(track.position_world_m).all()
            assert np.isfinite(track.velocity_world_mps).all()
            assert 0 <= track.score <= 1
    assert reported > 300
