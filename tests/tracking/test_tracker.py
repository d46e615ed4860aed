from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pytest
from made_map import BLUE, RED, Car, map_of, pose

from appocc.checks import FloatArray
from appocc.errors import DataError, ShapeError
from appocc.geometry import apply, inverse, yaw_of
from tracking.detections import Detections
from tracking.instances.instances import find_instances
from tracking.presets import MAPS
from tracking.track_table import LifecycleConfig
from tracking.tracker import Tracker, TrackerConfig
from tracking.tracks import Track

START_US = 1_600_000_000_000_000
# A car at a time in the world frame, None where it cannot be seen.
Path = Callable[[float], Car | None]


def seen_from(world_from_ego: FloatArray, cars: Iterable[Car | None]) -> list[Car]:
    """Cars of the world in the ego frame."""
    turn = float(yaw_of(world_from_ego))
    seen = []
    for car in cars:
        if car is not None:
            x, y, _ = apply(inverse(world_from_ego), np.array([[car.x_m, car.y_m, 0.0]]))[0]
            seen.append(car._replace(x_m=float(x), y_m=float(y), yaw_rad=car.yaw_rad - turn))
    return seen


def follow(
    paths: Sequence[Path],
    times_s: Sequence[float],
    ego: Callable[[float], FloatArray] = lambda _: pose(),
    probability: float = 1.0,
    config: TrackerConfig | None = None,
) -> list[tuple[Track, ...]]:
    """Tracks at each time."""
    tracker = Tracker(config or MAPS)
    result = []
    for t in times_s:
        here = ego(t)
        blobs = find_instances(map_of(seen_from(here, (path(t) for path in paths)), probability))
        result.append(tuple(tracker.update(Detections.from_instances(blobs), START_US + round(t * 1e6), here)))
    return result


def ids(moment: Iterable[Track]) -> list[int]:
    return [track.id for track in moment]


def every(step_s: float, until_s: float) -> list[float]:
    return [float(t) for t in np.arange(0, until_s + 1e-9, step_s)]


# Place and motion -------------------------------------------------------------------------------------------------


def test_a_moving_car_is_followed_at_irregular_times_from_a_moving_turning_ego() -> None:
    def ego(t: float) -> FloatArray:
        return pose(100 + 5 * t, 50, 0.4 * t)

    times = [0.0, 0.2, 0.4, 0.9, 1.1, 1.2, 1.7, 2.0]
    result = follow([lambda t: Car(110 + 8 * t, 55, 0.0, RED)], times, ego)
    assert [ids(moment) for moment in result] == [[1]] * len(times)
    last = result[-1][0]
    np.testing.assert_allclose(last.position_world_m, [126, 55, 0], atol=0.25)
    np.testing.assert_allclose(last.velocity_world_mps, [8, 0], atol=0.6)
    assert last.speed_mps == pytest.approx(8, abs=0.6)
    assert last.heading_known
    assert last.yaw_world_rad == pytest.approx(0.0, abs=0.06)
    np.testing.assert_allclose([last.length_m, last.width_m], [4.5, 1.8], atol=0.25)
    np.testing.assert_allclose(last.rgb, RED, atol=1)
    assert (last.seen, last.moving, last.kind) == (True, True, "vehicle")
    assert last.score > 0.99


def test_a_parked_car_is_stationary_while_the_ego_drives_by() -> None:
    result = follow([lambda _: Car(20, 4, 0.3)], every(0.2, 3), lambda t: pose(6 * t, 0, 0.1 * t))
    assert {track.id for moment in result for track in moment} == {1}
    for track in result[-1]:
        assert track.speed_mps < 0.3
        assert not track.heading_known
        assert np.cos(2 * (track.yaw_world_rad - 0.3)) > 0.99


def test_the_ground_height_follows_the_ego() -> None:
    def hill(_: float) -> FloatArray:
        raised = pose()
        raised[2, 3] = 7.5
        return raised

    assert follow([lambda _: Car(10, 0)], [0.0], hill)[0][0].position_world_m[2] == pytest.approx(7.5)


@pytest.mark.parametrize("speed_mps", [6.0, -6.0])
def test_motion_distinguishes_front_and_rear(speed_mps: float) -> None:
    result = follow([lambda t: Car(10 + speed_mps * t, 3)], every(0.2, 2))
    assert not result[0][0].heading_known
    last = result[-1][0]
    assert last.heading_known
    assert np.cos(last.yaw_world_rad) * np.sign(speed_mps) > 0.99


def test_a_heading_once_known_is_kept_when_the_car_stops() -> None:
    result = follow([lambda t: Car(30 - 6 * min(t, 2.0), 3)], every(0.2, 5))
    last = result[-1][0]
    assert last.speed_mps < 0.5
    assert last.heading_known
    assert np.cos(last.yaw_world_rad) < -0.99


# Identity ---------------------------------------------------------------------------------------------------------


def test_passing_cars_keep_their_ids() -> None:
    paths: list[Path] = [lambda t: Car(-20 + 10 * t, 1.5, 0.0, RED), lambda t: Car(20 - 10 * t, -1.5, 0.0, BLUE)]
    result = follow(paths, every(0.1, 4))
    last = {track.id: track for track in result[-1]}
    first = {track.id: track for track in result[0]}
    assert set(last) == set(first) == {1, 2}
    for name, track in last.items():
        np.testing.assert_allclose(track.rgb, first[name].rgb, atol=2)


def test_fast_cars_are_followed_at_two_key_frames_a_second() -> None:
    result = follow([lambda t: Car(-35 + 15 * t, 3, 0.0, RED)], every(0.5, 4))
    assert [ids(moment) for moment in result] == [[1]] * 9


def test_the_same_input_gives_the_same_tracks() -> None:
    paths: list[Path] = [lambda t, k=k: Car(-20 + 9 * k + t, 3.0 * (k % 3)) for k in range(5)]  # type: ignore[misc]
    once, again = (follow(paths, every(0.5, 2)) for _ in range(2))
    assert [[str(track) for track in moment] for moment in once] == [
        [str(track) for track in moment] for moment in again
    ]


def test_two_cars_that_merge_for_a_moment_keep_their_ids() -> None:
    """A van stops close behind another: both merge into one truck-shaped instance for a second."""
    van = Car(0, 3, length_m=5.0, width_m=2.5)
    paths: list[Path] = [
        lambda _: van._replace(x_m=20.0),
        lambda t: van._replace(x_m=8 + (6.9 if 2 <= t < 3 else min(3 * t, 5.5))),
    ]
    result = follow(paths, every(0.2, 4))
    assert ids(result[-1]) == ids(result[0]) == [1, 2]
    assert all(ids(moment) == [1, 2] for moment in result)


# Life cycle -------------------------------------------------------------------------------------------------------


def gap(start_s: float, end_s: float) -> Path:
    """A parked car that cannot be seen for a while."""
    return lambda t: None if start_s <= t < end_s else Car(10, 3)


def test_high_confidence_confirms_immediately_low_confidence_after_a_while() -> None:
    times = every(0.1, 0.5)
    assert [len(moment) for moment in follow([gap(9, 9)], times)] == [1] * 6
    assert [len(moment) for moment in follow([gap(9, 9)], times, probability=0.7)] == [0, 0, 1, 1, 1, 1]


def test_a_flickering_low_confidence_instance_never_makes_a_track() -> None:
    flicker: Path = lambda t: Car(10, 3) if round(t * 10) % 3 == 0 else None  # noqa: E731
    assert all(not moment for moment in follow([flicker], every(0.1, 3), probability=0.7))


def test_a_track_coasts_then_is_hidden_then_returns_under_its_id() -> None:
    result = follow([gap(1.0, 2.0)], every(0.1, 3))
    reported = [[(track.id, track.seen) for track in moment] for moment in result]
    assert reported[9] == [(1, True)]
    assert reported[10:13] == [[(1, False)]] * 3
    assert reported[13:20] == [[]] * 7
    assert reported[20] == [(1, True)]


def test_stationary_tracks_are_remembered_for_a_limited_time() -> None:
    assert ids(follow([gap(1.0, 20.0)], every(0.5, 21))[-1]) == [1]
    assert ids(follow([gap(1.0, 35.0)], every(0.5, 36))[-1]) == [2]


def test_a_car_that_drove_on_while_hidden_is_new() -> None:
    def waits(t: float) -> Car | None:
        return Car(10, 3) if t < 1.2 else Car(22, 3) if t > 6 else None

    assert ids(follow([waits], every(0.5, 8))[-1]) == [2]


def test_a_long_break_deletes_all_tracks() -> None:
    assert ids(follow([lambda _: Car(10, 3)], [*every(0.5, 2), 3600.0])[-1]) == [2]


def test_a_car_that_turns_a_corner_keeps_its_id() -> None:
    """A quarter of a circle of 6 m radius at 6 m/s, seen twice a second."""

    def turning(t: float) -> Car:
        angle = np.clip(t - 1.5, 0, np.pi / 2)
        before, after = min(t, 1.5) * 6, max(t - 1.5 - np.pi / 2, 0) * 6
        x, y = -5 + before + 6 * np.sin(angle), 6 * (1 - np.cos(angle)) + after
        return Car(float(x), float(y), float(angle))

    assert {name for moment in follow([turning], every(0.5, 5)) for name in ids(moment)} == {1}


def test_the_life_cycle_is_in_seconds_not_frames() -> None:
    for step in (0.1, 0.5):
        assert ids(follow([gap(1.0, 2.5)], every(step, 3))[-1]) == [1]


def test_a_car_that_enters_where_another_left_is_new() -> None:
    def passing(t: float) -> Car | None:
        return Car(32 + 10 * t, 3) if t < 1 else Car(37 - 10 * (t - 1.6), 3) if t >= 1.6 else None

    result = follow([passing], every(0.2, 3))
    assert ids(result[0]) == [1]
    assert ids(result[-1]) == [2]


def test_the_life_cycle_can_be_set() -> None:
    config = TrackerConfig(lifecycle=LifecycleConfig(coast_s=1.0, coast_std_m=5.0, coast_chance=0.0))
    assert [ids(moment) for moment in follow([gap(1.0, 2.0)], every(0.2, 2), config=config)] == [[1]] * 11


def test_a_cut_off_car_does_not_shrink() -> None:
    result = follow([lambda t: Car(34 + 4 * t, 0)], every(0.2, 1.4))
    assert result[-1][0].length_m == pytest.approx(4.5, abs=0.35)


def test_a_car_that_is_only_ever_seen_cut_off_has_a_size() -> None:
    result = follow([lambda _: Car(40, 0)], every(0.2, 4))
    assert result[-1][0].length_m > 1.5


# Bad input --------------------------------------------------------------------------------------------------------


def test_time_must_move_forward() -> None:
    tracker, blobs = Tracker(), Detections.from_instances(find_instances(map_of([])))
    tracker.update(blobs, START_US, pose())
    with pytest.raises(DataError, match=f"expected a time after {START_US} us, got {START_US} us"):
        tracker.update(blobs, START_US, pose())


def test_the_pose_must_be_rigid() -> None:
    with pytest.raises(ShapeError, match="world_from_ego"):
        Tracker().update(Detections.from_instances(find_instances(map_of([]))), START_US, np.eye(4) * 2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position_world_m": np.zeros(2)}, "track position_world_m"),
        ({"velocity_world_mps": np.full(2, np.nan)}, "track velocity_world_mps"),
        ({"length_m": 0.0}, "track 1: expected a positive size"),
        ({"width_m": float("nan")}, "track 1: expected a positive size"),
    ],
)
def test_tracks_are_checked(changes: dict[str, FloatArray | float], message: str) -> None:
    good = {"position_world_m": np.zeros(3), "velocity_world_mps": np.zeros(2), "rgb": np.zeros(3)}
    size = {"length_m": 4.5, "width_m": 1.8}
    values = {"id": 1, "yaw_world_rad": 0.0, "heading_known": False, "score": 1.0, "seen": True} | good | size
    with pytest.raises(ShapeError, match=message):
        Track(**(values | changes))  # type: ignore[arg-type]
