"""Golden numbers: CARLA's left-handed axes in ours."""

from __future__ import annotations

import numpy as np
import pytest
from fake_carla import FakeCarla
from fake_carla_geometry import Location, Rotation, Transform

from appocc.carla.frames import carla_numbers, carla_transform, point_of, pose_of
from appocc.geometry import apply


@pytest.mark.parametrize(
    ("rotation", "ahead", "left", "up"),
    [
        (Rotation(), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        (Rotation(yaw=90), (0, -1, 0), (1, 0, 0), (0, 0, 1)),  # clockwise: to the right
        (Rotation(pitch=90), (0, 0, 1), (0, 1, 0), (-1, 0, 0)),  # the nose is lifted
        (Rotation(roll=90), (1, 0, 0), (0, 0, 1), (0, -1, 0)),  # the left side is lifted
        (Rotation(pitch=-90, yaw=90), (0, 0, -1), (1, 0, 0), (0, -1, 0)),
    ],
)
def test_axes(rotation: Rotation, ahead: tuple[int, ...], left: tuple[int, ...], up: tuple[int, ...]) -> None:
    pose = pose_of(Transform(Location(1, 2, 3), rotation))
    np.testing.assert_allclose(pose[:3, :3].T, [ahead, left, up], atol=1e-12)
    assert pose[:3, 3].tolist() == [1, -2, 3]
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_a_place_on_the_right_has_a_negative_y() -> None:
    assert point_of(Location(10, 3, 1)).tolist() == [10, -3, 1]
    seen = apply(pose_of(Transform(Location(0, 0, 0), Rotation(yaw=90))), np.array([[10.0, 3.0, 0.0]]))
    np.testing.assert_allclose(seen, [[3, -10, 0]], atol=1e-12)


@pytest.mark.parametrize("angles", [(0, 0, 0), (10, -130, 5), (-35, 179, -60), (90, 40, 0), (-90, -75, 0)])
def test_there_and_back(angles: tuple[float, float, float]) -> None:
    pitch, yaw, roll = angles
    given = Transform(Location(5, -6, 7), Rotation(pitch, yaw, roll))
    place, found = carla_numbers(pose_of(given))
    np.testing.assert_allclose([*place, *found], [5, -6, 7, *angles], atol=1e-5)
    again = carla_transform(FakeCarla(), pose_of(given))
    np.testing.assert_allclose(pose_of(again), pose_of(given), atol=1e-9)


def test_the_axes_are_those_of_a_turn_after_the_other() -> None:
    """The same as turning axis after axis in the left-handed frame, with y mirrored."""
    random = np.random.default_rng(0)
    for pitch, yaw, roll in random.uniform(-80, 80, (20, 3)):
        rotation = Rotation(pitch, yaw, roll)
        forward, right, up = rotation.axes() * [1, -1, 1]
        np.testing.assert_allclose(
            pose_of(Transform(Location(), rotation))[:3, :3].T, [forward, -right, up], atol=1e-12
        )
