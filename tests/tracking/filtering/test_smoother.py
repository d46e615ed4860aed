from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from numpy.typing import ArrayLike

from appocc.checks import FloatArray
from appocc.errors import ShapeError
from tracking.detections import Detections
from tracking.evaluation.kitti import prepare_evaluation
from tracking.field_of_view import CircularView
from tracking.filtering.kalman import MotionConfig, oriented_covariance
from tracking.filtering.smoother import SmoothingConfig, smooth
from tracking.io.kitti import read_sequences
from tracking.io.kitti_results import kitti_results
from tracking.pipeline import track_sequence
from tracking.tracker import Tracker
from tracking.tracks import Track, group_by_track

STEP_US = 100_000


def track(number: int = 1, x_m: float = 0.0, y_m: float = 0.0, **changes: Any) -> Track:
    values: dict[str, Any] = {
        "position_world_m": np.array([x_m, y_m, 0.0]),
        "velocity_world_mps": np.zeros(2),
        "yaw_world_rad": 0.0,
        "heading_known": True,
        "length_m": 4.5,
        "width_m": 1.8,
        "rgb": np.full(3, np.nan),
        "score": 0.9,
        "seen": True,
        "detection": 0,
    }
    return Track(id=number, **(values | changes))


def coasted(one: Track) -> Track:
    return replace(one, seen=False, detection=None)


def driving(x_m: float, speed_mps: float, **changes: Any) -> Track:
    return track(x_m=x_m, velocity_world_mps=np.array([speed_mps, 0.0]), **changes)


def times(count: int) -> list[int]:
    return [1_600_000_000_000_000 + i * STEP_US for i in range(count)]


def alone(tracks: Sequence[Sequence[Track]]) -> list[Track]:
    return [one for moment in tracks for one in moment]


def followed(
    times_us: Sequence[int], places_m: FloatArray, yaw_rad: ArrayLike, unseen: set[int]
) -> list[list[Track]]:
    """Tracks of one vehicle detected at positions (T, 2) with headings, except in some frames."""
    tracker, frames = Tracker(), []
    yaw = np.broadcast_to(yaw_rad, len(times_us))
    for i, (time_us, place) in enumerate(zip(times_us, places_m, strict=True)):
        n = int(i not in unseen)
        boxes = np.append(place, 1.0)[None][:n], np.full(n, yaw[i]), np.array([[1.8, 4.5, 1.5]])[:n], np.full(n, 3.0)
        frames.append(
            list(tracker.update(Detections.from_boxes(*boxes, ("car",) * n, CircularView()), time_us, np.eye(4)))
        )
    return frames


def seen_by_hand(times_us: Sequence[int], places_m: FloatArray, yaw_rad: float, unseen: set[int]) -> FloatArray:
    """States (T, 4) by filterpy's filter and smoother over the detections."""
    config, yaw = MotionConfig(), np.array([yaw_rad])
    kalman = KalmanFilter(dim_x=4, dim_z=2)
    kalman.x, kalman.H, kalman.P = np.append(places_m[0], [0.0, 0.0]), np.eye(2, 4), np.zeros((4, 4))
    kalman.R = oriented_covariance(yaw, config.along_std_m**2, config.across_std_m**2)[0]
    kalman.P[:2, :2], kalman.P[2:, 2:] = (
        kalman.R,
        oriented_covariance(yaw, config.along_speed_std_mps**2, config.across_speed_std_mps**2)[0],
    )
    kept = []
    for i, seconds in enumerate(np.diff(times_us, prepend=times_us[0]) * 1e-6):
        across = config.across_accel_psd_m2ps3 + config.heading_psd_rad2ps * float(kalman.x[2:] @ kalman.x[2:])
        push = oriented_covariance(yaw, config.along_accel_psd_m2ps3, across)[0]
        moved = np.eye(4) + seconds * np.eye(4, k=2)
        pushed = np.kron([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]], push)
        kalman.predict(F=moved, Q=pushed)
        kalman.update(None if i in {0, *unseen} else places_m[i])
        kept.append((kalman.x.copy(), kalman.P.copy(), moved, pushed))
    states: FloatArray = kalman.rts_smoother(*map(np.array, zip(*kept, strict=True)))[0]
    return states


def test_smoothing_equals_a_smoother_over_the_detections() -> None:
    """Though it knows only what the tracker made of them; time steps differ, and three moments are unseen."""
    random = np.random.default_rng(2)
    times_us = np.cumsum(random.integers(60_000, 200_000, 40)).tolist()
    yaw, unseen = 0.4, {11, 20, 21}
    ahead = (np.array(times_us) - times_us[0]) * 1e-6 * 5.0
    places = ahead[:, None] * [np.cos(yaw), np.sin(yaw)] + random.normal(0, 0.2, (40, 2))
    smoothed = alone(smooth(times_us, followed(times_us, places, yaw, unseen)))
    states = [np.append(one.position_world_m[:2], one.velocity_world_mps) for one in smoothed]
    # The tracker learns the noise of the detections on the way; the smoother has the configured one.
    np.testing.assert_allclose(states, seen_by_hand(times_us, places, yaw, unseen), atol=2e-2)
    assert [i for i, one in enumerate(smoothed) if not one.seen] == sorted(unseen)
    assert {one.id for one in smoothed} == {1}


def test_places_and_velocities_come_nearer_to_the_truth() -> None:
    random = np.random.default_rng(5)
    path = np.stack([np.linspace(0, 40, 50), np.zeros(50)], axis=1)
    times_us = times(50)
    online = followed(times_us, path + random.normal(0, 0.25, path.shape), 0.0, set())
    errors = []
    for tracks in (alone(online), alone(smooth(times_us, online))):
        places = np.array([one.position_world_m[:2] for one in tracks]) - path
        speeds = np.array([one.velocity_world_mps for one in tracks]) - [40 / 4.9, 0]
        errors.append((np.sqrt((places**2).mean()), np.sqrt((speeds**2).mean())))
    assert errors[1][0] < 0.7 * errors[0][0]
    assert errors[1][1] < 0.5 * errors[0][1]


def test_nothing_is_lost_far_from_the_origin_and_all_is_the_same_again() -> None:
    near = [[driving(0.9 * i, 9.0)] for i in range(12)]
    far = [[driving(0.9 * i + 4e6, 9.0)] for i in range(12)]
    results = [
        np.array([one.position_world_m for one in alone(smooth(times(12), each))]) for each in (near, far, far)
    ]
    np.testing.assert_allclose(results[1] - [4e6, 0, 0], results[0], atol=1e-6)
    assert results[1].tolist() == results[2].tolist()


def test_gaps_are_filled_and_what_follows_the_last_sighting_is_dropped() -> None:
    moments = [[driving(1.0 * i, 10.0, detection=i)] for i in range(20)]
    moments[5], moments[6], moments[7] = [coasted(moments[5][0])], [], []
    moments[18], moments[19] = [coasted(moments[18][0])], [coasted(moments[19][0])]
    smoothed = smooth(times(20), moments)
    assert [len(moment) for moment in smoothed] == [1] * 18 + [0, 0]
    tracks = alone(smoothed)
    assert [i for i, one in enumerate(tracks) if not one.seen] == [5, 6, 7]
    assert [one.detection for one in tracks] == [None if i in (5, 6, 7) else i for i in range(18)]
    np.testing.assert_allclose([one.position_world_m for one in tracks], [[i, 0, 0] for i in range(18)], atol=1e-6)
    np.testing.assert_allclose([one.velocity_world_mps for one in tracks], [[10, 0]] * 18, atol=1e-6)
    assert all(one.moving for one in tracks)


def test_long_gaps_stay_but_the_path_goes_on() -> None:
    moments = [[driving(1.0 * i, 10.0)] if not 4 <= i < 9 else [] for i in range(14)]
    moments[4] = [coasted(driving(4.0, 10.0))]
    lengths = [
        [len(moment) for moment in smooth(times(14), moments, SmoothingConfig(max_gap_s=gap_s))]
        for gap_s in (0.5, 0.7)
    ]
    assert lengths == [[1] * 4 + [0] * 5 + [1] * 5, [1] * 14]


def test_one_size_colour_and_score_of_all_sightings() -> None:
    lengths, heights = [4.0, 4.6, 9.0, 4.4], [np.nan, 1.5, 1.7, np.nan]
    reds = [np.nan, 100.0, 120.0, 30.0]
    moments = [
        [track(length_m=length, height_m=height, rgb=np.array([red, 20.0, 30.0]), score=0.5 + 0.1 * i, kind="car")]
        for i, (length, height, red) in enumerate(zip(lengths, heights, reds, strict=True))
    ]
    moments[2] = [coasted(moments[2][0])]
    for one in alone(smooth(times(4), moments)):
        assert (one.length_m, one.width_m, one.height_m, one.kind) == (4.4, 1.8, 1.5, "car")
        assert one.rgb.tolist() == [65.0, 20.0, 30.0]
        assert one.score == 0.8
    unknown = alone(smooth(times(2), [[track()], [track()]]))[0]
    assert np.isnan([*unknown.rgb, unknown.height_m]).all()


def test_a_parked_vehicle_has_one_heading_and_one_height() -> None:
    """Some headings are off, one is across, and some point to the rear, but not the last one."""
    turns = np.array([0.02, -0.02, np.pi, 0.01, np.pi / 2, -0.01, np.pi - 0.01, 0.0, np.pi + 0.01, 0.0])
    heights = np.array([0.1, -0.1] * 5)
    moments = [
        [track(yaw_world_rad=3.0 + turn, position_world_m=np.array([0.0, 0.0, height]))]
        for turn, height in zip(turns, heights, strict=True)
    ]
    tracks = alone(smooth(times(10), moments))
    np.testing.assert_allclose([one.yaw_world_rad for one in tracks], [3.0] * 10, atol=5e-3)
    np.testing.assert_allclose([one.position_world_m[2] for one in tracks], [0.0] * 10, atol=1e-9)
    assert not any(one.moving for one in tracks)


def test_a_vehicle_that_drives_points_where_it_goes() -> None:
    """A bend to the left at 10 m/s, through the heading of pi; its headings are seen badly."""
    random = np.random.default_rng(0)
    angle = np.pi - 0.6 + np.arange(60) * 0.02
    places = 50 * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    online = followed(times(60), places, angle + random.normal(0, 0.1, 60), set())
    worst = []  # the motion at the ends is known from one side only
    for tracks in (online, smooth(times(60), online)):
        yaw = np.array([one.yaw_world_rad for one in alone(tracks)])
        assert (np.abs(yaw) <= np.pi).all()
        worst.append(np.abs(np.angle(np.exp(1j * (yaw - angle))))[8:-8].max())
    assert worst[1] < 0.02 < 0.1 < worst[0]


def test_a_stop_has_one_heading() -> None:
    """However its headings flicker in the five seconds after it came."""
    go = [driving(1.0 * i, 10.0) for i in range(10)]
    stand = [track(x_m=10.0, yaw_world_rad=0.02 * (-1) ** i) for i in range(50)]
    tracks = alone(smooth(times(60), [[one] for one in [*go, *stand]]))
    np.testing.assert_allclose([one.yaw_world_rad for one in tracks], 0.0, atol=0.02)
    assert np.ptp([one.yaw_world_rad for one in tracks[20:]]) < 1e-3


def test_tracks_are_ordered_by_id() -> None:
    moments = [[track(7, 50.0), track(2)], [track(2), track(9, 90.0)], [coasted(track(4)), track(7, 50.0)]]
    assert list(group_by_track(moments)) == [2, 4, 7, 9]
    assert [[one.id for one in moment] for moment in smooth(times(3), moments)] == [[2, 7], [2, 7, 9], [7]]


def test_nothing_gives_nothing() -> None:
    assert smooth([], []) == ()
    assert smooth(times(2), [[], [coasted(track())]]) == ((), ())
    assert len(alone(smooth(times(1), [[track()]]))) == 1


def test_times_must_fit_and_rise() -> None:
    with pytest.raises(ShapeError, match="expected a time for each of 1 frames, got 2"):
        smooth(times(2), [[track()]])
    with pytest.raises(ShapeError, match="expected times that rise"):
        smooth([5, 5], [[track()], [track()]])


@pytest.mark.realdata
def test_smoothing_of_recorded_traffic(data_root: Path) -> None:
    """A KITTI drive: what flickered is whole, and places are nearer to the truth."""
    root = data_root / "mot" / "kitti"
    if not root.is_dir():
        pytest.skip(f"no KITTI sequences at {root}")
    sequence = next(one for one in read_sequences(root) if one.name == "0003")
    online = track_sequence(sequence, Tracker())
    both = online, smooth([frame.timestamp_us for frame in sequence.frames], online)
    before, after = (
        prepare_evaluation([(sequence, kitti_results(sequence, tracks))]).by_track().metrics(0.75) for tracks in both
    )
    assert after.HOTA > before.HOTA + 0.01
    assert after.MOTP < before.MOTP
    assert (after.FRAG, after.IDS) == (0, 0)
