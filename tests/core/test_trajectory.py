from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.geometry import inverse, quaternion_from_yaw, transform, yaw_of
from appocc.trajectory import Straight, Trajectory, headings_of_way

START_US = 1_700_000_000_000_000
EGO_FROM_CAM = transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [1.7, 0.1, 1.5])


def pose(x_m: float, yaw_rad: float = 0.0) -> FloatArray:
    return transform(quaternion_from_yaw(yaw_rad), [x_m, 0.0, 0.0])


def trajectory(*seconds: float) -> Trajectory:
    """10 m/s along x, turning by 0.1 rad a second."""
    times = START_US + np.round(np.array(seconds) * 1e6).astype(np.int64)
    return Trajectory(times, np.stack([pose(10 * s, 0.1 * s) for s in seconds]))


def test_poses_are_interpolated() -> None:
    found = trajectory(0, 1, 2).at(START_US + 1_250_000)
    assert found is not None
    np.testing.assert_allclose(found[:3, 3], [12.5, 0, 0], atol=1e-6)
    assert float(yaw_of(found)) == pytest.approx(0.125, abs=1e-9)


def test_there_is_no_pose_before_after_and_in_long_gaps() -> None:
    poses = trajectory(0, 1, 4, 5)
    assert [poses.at(START_US + ms * 1000) is None for ms in (-1, 0, 1000, 2000, 4000, 5000, 5001)] == [
        True,
        False,
        False,
        True,
        False,
        False,
        True,
    ]


def test_poses_of_a_camera_become_those_of_the_ego_in_a_world_with_z_up() -> None:
    ego = trajectory(0, 1, 2)
    # The world of visual odometry: the first camera.
    world = inverse(ego.world_from_ego[0] @ EGO_FROM_CAM)
    found = Trajectory(ego.times_us, world @ ego.world_from_ego @ EGO_FROM_CAM).of_ego(EGO_FROM_CAM)
    expected = inverse(ego.world_from_ego[0]) @ ego.world_from_ego
    np.testing.assert_allclose(found.world_from_ego, expected, atol=1e-9)


def test_poses_of_a_camera_are_not_taken_for_the_egos() -> None:
    ego = trajectory(0, 1)
    ego.check_upright("poses.txt")
    with pytest.raises(DataError, match=r"poses.txt: .* tilted by 90 degrees \(pose 0\).*--poses-of"):
        Trajectory(ego.times_us, ego.world_from_ego @ EGO_FROM_CAM).check_upright("poses.txt")


@pytest.mark.parametrize("reverse", [False, True])
def test_headings_lie_along_the_way(reverse: bool) -> None:
    seconds = np.arange(0.0, 3.0, 0.1)
    found = trajectory(*(seconds[::-1] if reverse else seconds))
    found.check_ahead("log.csv")
    # The pose is turned, not the way: degrees taken for radians, or swapped axes.
    turned = found.world_from_ego @ transform(quaternion_from_yaw(1.4), [0, 0, 0])
    with pytest.raises(
        DataError, match=r"log.csv: expected headings along the way, .*, got ones that are \d\d degrees"
    ):
        Trajectory(found.times_us, turned).check_ahead("log.csv")


def test_a_standing_vehicle_has_any_heading() -> None:
    places = np.random.default_rng(0).normal(0, 2, (200, 2))
    poses = np.stack([transform(quaternion_from_yaw(0.0), [0.0, y, 0.0]) for _, y in places])
    Trajectory(np.arange(200) * 100_000, poses).check_ahead("log.csv")


def test_straight_ahead() -> None:
    np.testing.assert_allclose(Straight(5.0, START_US).at(START_US + 500_000)[:3, 3], [2.5, 0, 0])
    np.testing.assert_array_equal(Straight(0.0, START_US).at(START_US + 500_000), np.eye(4))


def test_headings_follow_the_way() -> None:
    angle = np.linspace(0, np.pi, 61)  # a half circle to the left, 0.52 m a step
    places = 10 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1)
    found = headings_of_way(places, "gps")
    np.testing.assert_allclose(found[5:-5], angle[5:-5], atol=0.06)


def test_noise_while_standing_does_not_turn_the_heading() -> None:
    noise = np.random.default_rng(0).normal(0, 0.5, (30, 2))
    way = np.stack([np.arange(0.0, 30.0), np.zeros(30)], axis=1)
    places = np.concatenate([way, way[-1] + noise, np.add(way, [30, 0])])
    found = headings_of_way(places, "gps")
    assert abs(found[30:60]).max() < 0.3


def test_a_short_way_has_no_heading() -> None:
    with pytest.raises(DataError, match="the way is too short"):
        headings_of_way(np.zeros((5, 2)), "gps")
