from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.own_cameras.moments import Moment, MomentGrouper, key_moments, moments_of
from appocc.own_cameras.pictures import Picture

MS = 1000


def picture(camera: str, time_ms: float) -> Picture:
    return Picture(camera, round(time_ms * MS), lambda: np.zeros((2, 2, 3), np.uint8))


def stream(camera: str, times_ms: Sequence[float]) -> list[Picture]:
    return [picture(camera, time) for time in times_ms]


def told(moments: list[Moment]) -> list[dict[str, float]]:
    return [{camera: p.time_us / MS for camera, p in moment.pictures.items()} for moment in moments]


def grouped(*streams: list[Picture], tolerance_ms: float = 20) -> list[dict[str, float]]:
    cameras = [each[0].camera for each in streams]
    pictures = sorted((p for each in streams for p in each), key=lambda p: p.time_us)
    return told(list(moments_of(pictures, cameras, round(tolerance_ms * MS))))


def test_pictures_within_the_tolerance_are_a_moment() -> None:
    found = grouped(stream("A", [0, 100, 200]), stream("B", [12, 98, 203]))
    assert found == [{"A": 0, "B": 12}, {"A": 100, "B": 98}, {"A": 200, "B": 203}]


def test_a_dropped_picture_leaves_its_camera_missing() -> None:
    found = grouped(stream("A", [0, 200]), stream("B", [5, 105, 205]))
    assert found == [{"A": 0, "B": 5}, {"B": 105}, {"A": 200, "B": 205}]


def test_a_faster_camera_has_spare_pictures() -> None:
    found = grouped(stream("A", [0, 16, 33, 50, 66]), stream("B", [1, 34, 67]))
    assert found == [{"A": 0, "B": 1}, {"A": 33, "B": 34}, {"A": 66, "B": 67}]


def test_the_time_of_a_moment_is_that_of_one_of_its_pictures() -> None:
    moment = Moment({name: picture(name, time) for name, time in (("A", 5), ("B", 9), ("C", 4))})
    assert moment.time_us == 5 * MS


def test_key_frames_are_regular_and_prefer_all_cameras() -> None:
    moments = [Moment({"A": picture("A", t), "B": picture("B", t)}) for t in range(0, 2001, 100)]
    assert [m.time_us // MS for m in key_moments(moments, 2.0)] == [0, 500, 1000, 1500, 2000]
    for number in (5, 6):
        moments[number] = Moment({"A": picture("A", 100 * number)})
    assert [m.time_us // MS for m in key_moments(moments, 2.0)] == [0, 400, 1000, 1500, 2000]


def test_rarer_moments_are_all_key_frames() -> None:
    moments = [Moment({"A": picture("A", t)}) for t in (0, 1000, 2030, 2960)]
    assert list(key_moments(moments, 2.0)) == moments


def test_a_moment_ends_when_all_cameras_have_a_picture() -> None:
    grouper = MomentGrouper(("A", "B"), 20 * MS, 100 * MS)
    assert told(list(grouper.add(picture("A", 0)))) == []
    assert told(list(grouper.add(picture("B", 10)))) == [{"A": 0, "B": 10}]


def test_a_slow_camera_is_waited_for_within_the_patience() -> None:
    grouper = MomentGrouper(("A", "B"), 20 * MS, 100 * MS)
    for time in (0, 50, 100):
        assert list(grouper.add(picture("A", time))) == []
    assert told(list(grouper.add(picture("B", 1)))) == [{"A": 0, "B": 1}]
    # 150 is more than 100 ms after the end of the moment of 20 ms + 0 ms, but not after that of 50 ms.
    assert list(grouper.add(picture("A", 150))) == []
    assert told(list(grouper.add(picture("A", 200)))) == [{"A": 50}]


def test_a_camera_that_sent_a_later_picture_is_not_waited_for() -> None:
    grouper = MomentGrouper(("A", "B"), 20 * MS, 10_000 * MS)
    assert list(grouper.add(picture("A", 0))) == []
    assert told(list(grouper.add(picture("B", 100)))) == [{"A": 0}]
    assert told(list(grouper.rest())) == [{"B": 100}]


def test_late_spare_and_unordered_pictures_are_skipped_and_counted() -> None:
    grouper = MomentGrouper(("A", "B"), 20 * MS)
    assert list(grouper.add(picture("A", 0))) == []
    assert told(list(grouper.add(picture("A", 100)))) == [{"A": 0}]
    assert list(grouper.add(picture("B", 5))) == []  # its moment has ended
    assert list(grouper.add(picture("A", 90))) == []  # after 100
    assert told(list(grouper.add(picture("B", 101)))) == [{"A": 100, "B": 101}]
    assert list(grouper.add(picture("B", 110))) == []
    assert grouper.skipped == {"late": 1, "out of order": 1, "spare": 1}
