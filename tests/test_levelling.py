"""Levelling: the rotation to a level frame follows the ground, and nothing that is no ground."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from appocc.checks import FloatArray
from appocc.errors import ShapeError
from appocc.geometry import apply, inverse
from appocc.levelling import ego_from_level, is_level, lowest_points

BELOW_M = np.array([0.0, 0.0, -0.4])


def ground(count: int = 200, spread_m: float = 15.0) -> FloatArray:
    """Points of a level ground that is not quite even."""
    rng = np.random.default_rng(3)
    return np.column_stack([rng.normal(0, spread_m, (count, 2)), rng.normal(0, 0.05, count)])


def tilted(points_m: FloatArray, roll_deg: float, pitch_deg: float) -> FloatArray:
    return points_m @ Rotation.from_euler("xy", [roll_deg, pitch_deg], degrees=True).as_matrix().T


def levelled(points_m: FloatArray) -> FloatArray:
    pose = ego_from_level(points_m)
    assert pose is not None
    return apply(inverse(pose), points_m)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0, 0), (2, 0), (0, -3), (-2.5, 1)])
def test_the_ground_is_level_and_below_the_frame(roll_deg: float, pitch_deg: float) -> None:
    level = levelled(tilted(ground(), roll_deg, pitch_deg) + BELOW_M)
    for axis in (0, 1):
        np.testing.assert_allclose(np.polyfit(level[:, axis], level[:, 2], 1), 0, atol=0.01)


def test_the_origin_stays_above_its_place_and_the_heading_is_kept() -> None:
    pose = ego_from_level(tilted(ground(), 2, -1) + BELOW_M)
    assert pose is not None
    np.testing.assert_allclose(pose[:3, 3], [0, 0, -0.4], atol=0.02)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    assert pose[1, 0] == pytest.approx(0, abs=1e-12)
    assert pose[0, 0] > 0.99


def test_points_beside_the_ground_do_not_count() -> None:
    points = tilted(ground(), 2, 0)
    points[::6, 2] += 4.0 * (points[::6, 1] > 0)  # on a car park deck, on one side only
    even = np.arange(len(points)) % 6 > 0
    assert np.abs(levelled(points)[even, 2]).max() < 0.25


@pytest.mark.parametrize(
    "points_m",
    [
        np.zeros((0, 3)),
        tilted(ground(count=9), 2, 0),
        tilted(ground(), 2, 0) * [1, 0.05, 1],  # a single row of cars says nothing about the roll
        tilted(ground(), 8, 0),  # no road
    ],
)
def test_without_a_ground_there_is_no_level_frame(points_m: FloatArray) -> None:
    assert ego_from_level(points_m) is None


def test_points_have_three_coordinates() -> None:
    with pytest.raises(ShapeError, match="ground points"):
        ego_from_level(np.zeros((30, 2)))
    with pytest.raises(ShapeError, match="points"):
        lowest_points(np.zeros((30, 2)))


def street() -> FloatArray:
    """LiDAR points of a street: ground with a hole, a row of cars, a wall, reflections below, and the ego's roof."""
    rng = np.random.default_rng(5)
    plane = np.column_stack([rng.uniform(-35, 35, (6000, 2)), rng.normal(0, 0.03, 6000)])
    plane = plane[np.abs(plane[:, 1] - 5) > 1]  # below the cars
    cars = np.column_stack([rng.uniform(-30, 30, 1500), rng.uniform(4, 6, 1500), rng.uniform(0.3, 1.6, 1500)])
    wall = np.column_stack([rng.uniform(-30, 30, 1500), np.full(1500, -9.5), rng.uniform(0, 8, 1500)])
    below = np.column_stack([rng.uniform(-20, 20, (40, 2)), rng.uniform(-20, -8, 40)])
    roof = np.column_stack([rng.uniform(-1, 2, (400, 2)), np.full(400, 1.7)])
    return np.concatenate([plane, cars, wall, below, roof])


def test_the_lowest_points_are_one_a_square_metre_and_hold_the_ground() -> None:
    points = lowest_points(street())
    cells = np.floor(points[:, :2])
    assert len(np.unique(cells, axis=0)) == len(points)
    assert (np.abs(points[:, 2]) < 0.15).mean() > 0.8
    assert np.hypot(*points[:, :2].T).min() > 2.9


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0, 0), (2, 0), (-1, 3), (4, -2)])
def test_a_lidar_sees_the_tilt_of_the_street(roll_deg: float, pitch_deg: float) -> None:
    pose = ego_from_level(lowest_points(tilted(street(), roll_deg, pitch_deg) - BELOW_M))
    assert pose is not None
    wanted = Rotation.from_euler("xy", [roll_deg, pitch_deg], degrees=True).as_matrix()[:, 2]
    assert np.degrees(np.arccos(min(1.0, float(pose[:3, 2] @ wanted)))) < 0.2
    assert pose[2, 3] == pytest.approx(0.4, abs=0.06)


def test_what_no_map_shows_is_level() -> None:
    assert is_level(np.eye(4))
    for roll_deg, height_m, expected in ((0.1, 0.0, True), (0.4, 0.0, False), (0.0, 0.02, True), (0.0, -0.05, False)):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("x", roll_deg, degrees=True).as_matrix()
        pose[2, 3] = height_m
        assert is_level(pose) is expected
