from __future__ import annotations

import numpy as np
from made_tracks import track

from tracking.detections import Detections
from tracking.field_of_view import CircularView
from tracking.filtering.running_median import RunningMedian
from tracking.tracks import Tracks

ONE = np.zeros(1, np.int64)


def remembering(sightings: int, rows: list[list[float]]) -> RunningMedian:
    medians = RunningMedian(sightings, len(rows[0]))
    medians.add(np.array(rows[:1]))
    for row in rows[1:]:
        medians.update(ONE, np.array([row]))
    return medians


def test_the_median_ignores_outliers_and_old_values() -> None:
    medians = remembering(3, [[1.0], [9.0], [1.2]])
    np.testing.assert_allclose(medians.median, [[1.2]])
    medians.update(ONE, np.array([[8.0]]))
    np.testing.assert_allclose(medians.median, [[8.0]])


def test_unknown_values_do_not_count() -> None:
    medians = remembering(5, [[1.0, np.nan, np.nan], [3.0, 5.0, np.nan]])
    np.testing.assert_allclose(medians.median, [[2.0, 5.0, np.nan]])
    np.testing.assert_allclose(medians.known, [[2, 1, 0]])
    np.testing.assert_allclose(medians.squared_deviation, [[2.0, 0.0, 0.0]])


def test_a_value_that_was_never_seen_stays_unknown() -> None:
    medians = remembering(3, [[np.nan, 1.0], [np.nan, 2.0]])
    np.testing.assert_allclose(medians.median, [[np.nan, 1.5]])
    np.testing.assert_allclose(medians.squared_deviation, [[0.0, 0.5]])


def test_each_track_has_its_own_median() -> None:
    medians = remembering(3, [[1.0]])
    medians.add(np.array([[5.0], [7.0]]))
    medians.update(np.array([1]), np.array([[6.0]]))
    np.testing.assert_allclose(medians.median[:, 0], [1.0, 5.5, 7.0])
    medians.keep(np.array([False, True, True]))
    np.testing.assert_allclose(medians.median[:, 0], [5.5, 7.0])


def test_tracks_are_a_sequence_of_tracks() -> None:
    tracks = Tracks(
        id=np.array([3, 8]),
        position_world_m=np.array([[1.0, 2.0, 0.5], [4.0, 5.0, 0.5]]),
        velocity_world_mps=np.array([[3.0, 4.0], [0.0, 0.0]]),
        yaw_world_rad=np.array([0.1, 0.2]),
        heading_known=np.array([True, False]),
        size_m=np.array([[1.8, 4.5, np.nan], [2.5, 9.0, 3.2]]),
        rgb=np.full((2, 3), np.nan),
        score=np.array([0.9, 0.4]),
        kind=("car", "bus"),
        detection=np.array([5, -1]),
        moving=np.array([True, False]),
        velocity_known=np.array([True, False]),
    )
    one, other = tracks
    assert (len(tracks), one.id, one.kind, one.speed_mps, one.seen, one.detection) == (2, 3, "car", 5.0, True, 5)
    assert (one.width_m, one.length_m, one.moving, one.heading_known) == (1.8, 4.5, True, True)
    assert (one.velocity_known, other.velocity_known) == (True, False)
    assert (other.seen, other.detection, other.height_m, other.score) == (False, None, 3.2, 0.4)
    last = tracks[1:]
    assert isinstance(last, Tracks)
    assert [track.id for track in last] == [tracks[-1].id] == [8]
    assert last.kind == ("bus",)


def test_constructors_copy_the_arrays_of_the_caller() -> None:
    given = np.array([1.0, 2.0, 3.0])
    one = track(position_world_m=given)
    ground_m, ones = np.zeros((2, 3)), np.ones((2, 3))
    found = Detections.from_boxes(ground_m, np.zeros(2), ones, np.zeros(2), ("car",) * 2, CircularView())
    given[0] = ground_m[0, 0] = 9.0
    assert (one.position_world_m[0], found.ground_m[0, 0]) == (1.0, 0.0)
    assert not one.position_world_m.flags.writeable
    assert not found.ground_m.flags.writeable
    assert hash(one) != hash(track())
