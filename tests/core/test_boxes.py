"""Boxes: corners, what lies inside, other frames, and what counts as a vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appocc.boxes import Boxes, is_person_or_bicycle, is_vehicle
from appocc.errors import ShapeError
from appocc.geometry import apply, inverse, quaternion_from_yaw, rotation_from_quaternion, transform

QUARTER = rotation_from_quaternion(quaternion_from_yaw(np.pi / 2))


def fields(**changes: Any) -> dict[str, Any]:
    """Two boxes: a car along x at the origin, a truck along y at (10, 0, 1)."""
    return {
        "centre_m": np.array([[0.0, 0, 0], [10, 0, 1]]),
        "size_wlh_m": np.array([[2.0, 4, 1], [2, 8, 3]]),
        "rotation": np.stack([np.eye(3), QUARTER]),
        "category": ("vehicle.car", "vehicle.truck"),
        "instance": ("a", "b"),
        "token": ("s", "t"),
        "velocity_mps": np.array([[1.0, 0], [np.nan, np.nan]]),
        "lidar_points": np.array([5, -1]),
        **changes,
    }


def two(**changes: Any) -> Boxes:
    return Boxes(**fields(**changes))


def test_corners_go_round_the_floor_from_front_left_and_then_the_roof() -> None:
    corners = two().corners()
    np.testing.assert_allclose(corners[0, :4], [[2, 1, -0.5], [-2, 1, -0.5], [-2, -1, -0.5], [2, -1, -0.5]])
    np.testing.assert_allclose(corners[0, 4:], corners[0, :4] + [0, 0, 1])
    np.testing.assert_allclose(corners[1, 0], [9, 4, -0.5], atol=1e-12)


def test_length_lies_along_the_heading() -> None:
    np.testing.assert_allclose(two().half_lwh_m(), [[2, 1, 0.5], [4, 1, 1.5]])
    np.testing.assert_allclose(two().yaw_rad, [0, np.pi / 2])


def test_inside_any_box_with_and_without_a_margin() -> None:
    points = np.array([[1.9, 0.9, 0.4], [2.1, 0, 0], [10, 3.9, 1], [13, 0, 1], [10, 0, 2.6]])
    assert two().inside(points).tolist() == [True, False, True, False, False]
    assert two().inside(points, margin_m=0.2).tolist() == [True, True, True, False, True]
    assert not Boxes.empty().inside(points).any()


def test_a_margin_counts_in_full_on_every_side() -> None:
    points = np.array([[2.19, 0, 0], [-2.19, 1.19, -0.69], [2.21, 0, 0], [0, 1.21, 0], [0, 0, 0.71]])
    assert two().inside(points, margin_m=0.2).tolist() == [True, True, False, False, False]


def test_a_corner_farther_along_x_than_half_the_length() -> None:
    """Of a box that is turned so that its diagonal lies along x."""
    turn = rotation_from_quaternion(quaternion_from_yaw(-np.arctan2(1, 2)))
    turned = two(rotation=np.stack([turn, QUARTER]))
    assert turned.inside(np.array([[2.2, 0.0, 0.0], [2.3, 0.0, 0.0]])).tolist() == [True, False]


def test_turns_of_a_frame_come_after_those_of_a_box() -> None:
    """A frame that is rolled about x, a box that is turned about z: they do not commute."""
    roll = rotation_from_quaternion([np.cos(0.3), np.sin(0.3), 0, 0])
    moved = two().transformed(transform(roll, [0, 0, 0]))
    np.testing.assert_allclose(moved.rotation[1] @ [1.0, 0, 0], roll @ [0.0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(moved.corners()[1], two().corners()[1] @ roll.T, atol=1e-12)


@given(st.floats(-4, 4), st.floats(-9, 9), st.floats(-3, 3), st.floats(-np.pi, np.pi))
def test_inside_does_not_depend_on_the_frame(x: float, y: float, z: float, yaw: float) -> None:
    point = np.array([[10.0 + x, y, 1 + z]])
    local = apply(inverse(two().frame_from_box(1)), point)[0]
    gaps = np.abs(np.abs(local) - two().half_lwh_m()[1])
    pose = transform(quaternion_from_yaw(yaw), [3, -2, 1])
    if gaps.min() > 1e-6:
        moved = two().transformed(pose).inside(apply(pose, point))
        assert moved.tolist() == two().inside(point).tolist()


def test_velocities_turn_with_the_frame_and_sizes_stay() -> None:
    moved = two().transformed(transform(quaternion_from_yaw(np.pi / 2), [100, 0, 0]))
    np.testing.assert_allclose(moved.velocity_mps[0], [0, 1], atol=1e-12)
    assert np.isnan(moved.velocity_mps[1]).all()
    np.testing.assert_allclose(moved.centre_m[1], [100, 10, 1], atol=1e-12)
    np.testing.assert_array_equal(moved.size_wlh_m, two().size_wlh_m)
    assert moved.token == two().token


def test_only_rigid_transforms() -> None:
    with pytest.raises(ShapeError, match="target_from_source"):
        two().transformed(np.diag([2.0, 2, 2, 1]))


def test_select_by_mask_and_by_index() -> None:
    assert two().select(np.array([False, True])).token == ("t",)
    assert two().select(np.array([1, 0])).category == ("vehicle.truck", "vehicle.car")
    assert len(two().select(np.array([], dtype=np.int64))) == 0


@pytest.mark.parametrize(
    "name", ["vehicle.car", "vehicle.bus.rigid", "vehicle.motorcycle", "car", "van", "trailer", "other_vehicle"]
)
def test_vehicles(name: str) -> None:
    assert is_vehicle(name)
    assert not is_person_or_bicycle(name)


@pytest.mark.parametrize("name", ["vehicle.bicycle", "bicycle", "human.pedestrian.adult", "pedestrian", "animal", ""])
def test_what_is_no_vehicle(name: str) -> None:
    assert not is_vehicle(name)
    assert is_person_or_bicycle(name) is (name not in ("animal", ""))


def test_vehicles_are_chosen() -> None:
    assert two(category=("vehicle.bicycle", "vehicle.car")).vehicles().token == ("t",)
    assert len(Boxes.empty().vehicles()) == 0


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"centre_m": np.zeros((3, 3))}, r"boxes centre_m: expected shape \(2, 3\), got \(3, 3\)"),
        ({"size_wlh_m": np.zeros((2, 2))}, "boxes size_wlh_m: expected shape"),
        ({"rotation": np.zeros((2, 4))}, "boxes rotation: expected shape"),
        ({"velocity_mps": np.zeros((2, 3))}, "boxes velocity_mps: expected shape"),
        ({"lidar_points": np.zeros(3, np.int64)}, "boxes lidar_points: expected shape"),
        ({"centre_m": np.full((2, 3), np.nan)}, "boxes centre_m: expected finite"),
        ({"centre_m": np.full((2, 3), 1e300)}, "boxes centre_m: expected at most"),
        ({"size_wlh_m": np.full((2, 3), 1e300)}, "box s: expected a positive size below 1000 m"),
        ({"rotation": np.full((2, 3, 3), np.nan)}, "boxes rotation: expected finite"),
        ({"instance": ("a",)}, "boxes: expected 2 tokens, got 1 and 2"),
        ({"token": ("a", "b", "c")}, "boxes: expected 2 tokens, got 2 and 3"),
        (
            {"size_wlh_m": np.array([[1.0, 1, 1], [0, 1, 1]])},
            r"box t: expected a positive size below 1000 m, got \[0.0, 1.0, 1.0\]",
        ),
        ({"size_wlh_m": np.full((2, 3), np.nan)}, "box s: expected a positive size"),
    ],
)
def test_what_are_no_boxes(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        two(**changes)


def test_boxes_are_frozen_through_and_through() -> None:
    with pytest.raises(ValueError, match="read-only"):
        two().centre_m[0] = 1
