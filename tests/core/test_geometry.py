"""Rigid transforms and rotations, against numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appocc import geometry as g
from appocc.checks import FloatArray
from appocc.errors import ShapeError

HALF = 0.5**0.5
angles = st.floats(-10, 10)
metres = st.floats(-1e3, 1e3)


@st.composite
def poses(draw: st.DrawFn) -> FloatArray:
    part = st.floats(-1, 1)
    quaternion = [draw(st.floats(0.1, 1)), draw(part), draw(part), draw(part)]
    return g.transform(quaternion, draw(st.tuples(metres, metres, metres)))


def test_quaternion_is_wxyz_and_turns_counter_clockwise() -> None:
    turned = g.rotation_from_quaternion([HALF, 0, 0, HALF]) @ [1.0, 0, 0]
    np.testing.assert_allclose(turned, [0, 1, 0], atol=1e-15)


def test_quaternions_are_normalised_and_may_come_many_at_once() -> None:
    many = g.rotation_from_quaternion([[[2.0, 0, 0, 0], [0, 3.0, 0, 0]]])
    assert many.shape == (1, 2, 3, 3)
    np.testing.assert_allclose(many[0, 1], np.diag([1, -1, -1]), atol=1e-15)
    assert g.rotation_from_quaternion(np.zeros((0, 4))).shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("quaternion", "reason"),
    [
        ([1.0, 0, 0], r"expected shape \(\.\.\., 4\), got \(3,\)"),
        (1.0, r"got \(\)"),
        ([], r"got \(0,\)"),
        ([np.nan, 0, 0, 0], "finite"),
        ([0.0, 0, 0, 0], "expected a length of 1, got 0"),
        ([[1.0, 0, 0, 0], [1e300, 0, 0, 0]], r"expected a length of 1, got 1 \.\. 1e\+300"),
    ],
)
def test_what_is_no_quaternion(quaternion: object, reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        g.rotation_from_quaternion(quaternion)  # type: ignore[arg-type]


def test_footprints_of_boxes_one_or_many() -> None:
    lying, standing = [[5, 0], [1, 0], [1, -2], [5, -2]], [[2, 1], [2, -3], [4, -3], [4, 1]]
    np.testing.assert_allclose(g.footprints([3.0, -1.0], np.pi / 2, [4.0, 2.0]), standing)
    many = g.footprints([[[3.0, -1.0], [3.0, -1.0]]], [[0.0, np.pi / 2]], [4.0, 2.0])
    np.testing.assert_allclose(many, [[lying, standing]])
    assert g.footprints(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2))).shape == (0, 4, 2)


def test_turns_may_come_many_at_once() -> None:
    many = g.quaternion_from_yaw([[0.3, -2.0]])
    np.testing.assert_array_equal(many, [[g.quaternion_from_yaw(0.3), g.quaternion_from_yaw(-2.0)]])
    assert g.quaternion_from_yaw([]).shape == (0, 4)


@given(angles)
def test_yaw_there_and_back(yaw: float) -> None:
    rotation = g.rotation_from_quaternion(g.quaternion_from_yaw(yaw))
    np.testing.assert_allclose(np.exp(1j * g.yaw_of(rotation)), np.exp(1j * yaw), atol=1e-9)


def test_unit_quaternions_may_be_rounded() -> None:
    good = [[1.0, 0, 0, 0], [0, 0.6, -0.8, 0], [0.707, 0, 0, 0.707]]
    wrong = [[1.01, 0, 0, 0], [0, 0.99, 0, 0], [0, 0, 0, 0], [np.nan, 0, 0, 1], [1e200, 0, 0, 1e200]]
    assert g.is_unit(np.array(good + wrong)).tolist() == [True] * 3 + [False] * 5


@given(poses())
def test_quaternion_there_and_back(pose: FloatArray) -> None:
    quaternion = g.quaternion_from_rotation(pose[:3, :3])
    assert quaternion[0] >= 0
    np.testing.assert_allclose(g.rotation_from_quaternion(quaternion), pose[:3, :3], atol=1e-9)


@given(poses(), st.tuples(metres, metres, metres))
def test_inverse_undoes_a_transform(pose: FloatArray, point: tuple[float, float, float]) -> None:
    there = g.apply(pose, np.array([point]))
    np.testing.assert_allclose(g.apply(g.inverse(pose), there), [point], atol=1e-8)
    np.testing.assert_allclose(g.inverse(pose) @ pose, np.eye(4), atol=1e-9)


def test_apply_turns_first_and_moves_then() -> None:
    world_from_ego = g.transform(g.quaternion_from_yaw(np.pi / 2), [100, 200, 0])
    np.testing.assert_allclose(g.apply(world_from_ego, np.array([10.0, 1, 2])), [99, 210, 2], atol=1e-12)


@pytest.mark.parametrize(
    ("rotation", "translation", "reason"),
    [
        (np.eye(3), [0, 0], r"translation: expected shape \(3\), got \(2,\)"),
        (np.eye(3), [0, 0, np.inf], "translation: expected finite"),
        ([0.1, 0.2, 0.3], [0, 0, 0], r"rotation: expected shape \(3, 3\), got \(3,\)"),
        (np.full((3, 3), np.nan), [0, 0, 0], "rotation: expected finite"),
    ],
)
def test_what_makes_no_transform(rotation: object, translation: object, reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        g.transform(rotation, translation)  # type: ignore[arg-type]


def test_nearest_rigid_mends_rounding() -> None:
    pose = g.transform(g.quaternion_from_yaw(0.3), [1, 2, 3])
    mended = g.nearest_rigid(pose.round(3))
    np.testing.assert_allclose(mended[:3, :3] @ mended[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(mended, pose, atol=1e-3)


@given(angles)
def test_wrapped_angles_lie_in_the_half_open_circle_and_mean_the_same(angle: float) -> None:
    wrapped = g.wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angle), atol=1e-12)


def test_wrap_angle_at_its_ends() -> None:
    np.testing.assert_allclose(g.wrap_angle([np.pi, -np.pi, 3 * np.pi / 2]), [-np.pi, -np.pi, -np.pi / 2])


def _drive() -> tuple[FloatArray, FloatArray]:
    """A metre and a tenth of a radian each second."""
    turns = [g.transform(g.quaternion_from_yaw(0.1 * i), [i, 0, 0]) for i in range(3)]
    return np.arange(3.0), np.stack(turns)


@pytest.mark.parametrize(("at", "x", "yaw"), [(0.0, 0.0, 0.0), (1.5, 1.5, 0.15), (2.0, 2.0, 0.2), (2.5, 2.5, 0.25)])
def test_poses_between_and_a_step_beyond(at: float, x: float, yaw: float) -> None:
    pose = g.interpolate_pose(*_drive(), at)
    assert pose[0, 3] == pytest.approx(x)
    assert g.yaw_of(pose) == pytest.approx(yaw)


def test_poses_are_carried_on_by_one_step_at_most() -> None:
    assert g.interpolate_pose(*_drive(), 100.0)[0, 3] == pytest.approx(3.0)
    assert g.interpolate_pose(*_drive(), -100.0)[0, 3] == pytest.approx(-1.0)


def test_one_pose_stands_for_all_times_and_none_is_an_error() -> None:
    times, poses = _drive()
    np.testing.assert_array_equal(g.interpolate_pose(times[:1], poses[:1], 9.0), poses[0])
    with pytest.raises(ShapeError, match="expected at least one, got none"):
        g.interpolate_pose(times[:0], poses[:0], 0.0)


def test_two_poses_of_one_time_do_not_divide_by_zero() -> None:
    _, poses = _drive()
    pose = g.interpolate_pose(np.array([1.0, 1.0]), np.stack([poses[0], poses[0]]), 1.0)
    np.testing.assert_allclose(pose, poses[0])


def test_mean_pose_is_not_moved_by_an_outlier() -> None:
    one = g.transform(g.quaternion_from_yaw(0.2), [1, 2, 3])
    far = g.transform(g.quaternion_from_yaw(0.2), [50, 2, 3])
    np.testing.assert_allclose(g.mean_pose(np.stack([one, one, one, far])), one, atol=1e-12)
