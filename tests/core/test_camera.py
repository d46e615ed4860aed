"""Pinhole cameras: what a pixel sees, and how K follows a picture that is resized or cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray
from appocc.errors import NotFoundError, ShapeError
from appocc.geometry import transform

K = np.array([[1000.0, 0, 799.5], [0, 1000.0, 449.5], [0, 0, 1]])
AHEAD = transform([0.5, -0.5, 0.5, -0.5], [1.5, 0.0, 1.6])


def camera(channel: str = "CAM_FRONT") -> Camera:
    return Camera(channel, 1600, 900, K.copy(), AHEAD.copy())


def test_points_ahead_left_and_high_land_where_they_should() -> None:
    uv, depth = camera().project_ego(np.array([[11.5, 0, 1.6], [11.5, 1, 1.6], [11.5, 0, 2.6]]))
    np.testing.assert_allclose(uv, [[799.5, 449.5], [699.5, 449.5], [799.5, 349.5]])
    np.testing.assert_allclose(depth, [10, 10, 10])


def test_points_behind_have_no_pixel() -> None:
    uv, depth = camera().project(np.array([[0.0, 0, -1], [1, 1, 0]]))
    assert np.isnan(uv).all()
    assert depth.tolist() == [-1, 0]
    assert not camera().sees(uv, depth).any()


def test_the_picture_reaches_half_a_pixel_beyond_the_outer_centres() -> None:
    uv = np.array([[-0.5, -0.5], [1599.49, 899.49], [1599.5, 10], [10, 899.5], [-0.51, 10]])
    assert camera().sees(uv, np.full(5, 5.0)).tolist() == [True, True, False, False, False]
    assert not camera().sees(np.array([[10.0, 10]]), np.array([0.05])).any()


@given(st.floats(-5, 5), st.floats(-3, 3), st.floats(1, 50), st.integers(100, 3000), st.integers(100, 3000))
def test_resizing_moves_pixels_as_it_moves_the_picture(x: float, y: float, z: float, width: int, height: int) -> None:
    before, after = camera(), camera().resized(width, height)
    point = np.array([[x, y, z]])
    scale = np.array([width / 1600, height / 900])
    np.testing.assert_allclose(after.project(point)[0] + 0.5, (before.project(point)[0] + 0.5) * scale, rtol=1e-9)


def test_the_models_picture() -> None:
    """16:9 to 352x198, then 48 rows cut above and 22 below."""
    small = camera().resized(352, 198).cropped(0, 48, 352, 128)
    np.testing.assert_allclose(small.intrinsic, np.array([[220, 0, 175.5], [0, 220, 98.5 - 48], [0, 0, 1]]))
    assert (small.width_px, small.height_px) == (352, 128)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"width_px": 0}, "CAM: expected an image size, got 0x900"),
        ({"height_px": -1}, "expected an image size"),
        ({"intrinsic": np.eye(4)}, "CAM intrinsic: expected shape"),
        ({"intrinsic": np.full((3, 3), np.nan)}, "CAM intrinsic: expected finite"),
        ({"intrinsic": np.diag([1.0, -2, 1])}, "expected positive focal lengths, got 1 and -2"),
        ({"intrinsic": np.diag([0.0, 1, 1])}, "expected positive focal lengths, got 0 and 1"),
        ({"ego_from_cam": np.diag([1.0, 1, 1, 2])}, "CAM ego_from_cam: expected last row"),
    ],
)
def test_what_is_no_camera(change: dict[str, object], reason: str) -> None:
    fields: dict[str, object] = {"width_px": 1600, "height_px": 900, "intrinsic": K.copy(), "ego_from_cam": np.eye(4)}
    with pytest.raises(ShapeError, match=reason):
        Camera("CAM", **{**fields, **change})  # type: ignore[arg-type]


def test_a_camera_is_frozen_through_and_through() -> None:
    arrays: tuple[FloatArray, ...] = (camera().intrinsic, camera().ego_from_cam)
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 5


def test_a_rig_is_asked_by_channel() -> None:
    rig = CameraRig((camera("A"), camera("B")))
    assert rig.channels == ("A", "B")
    assert len(rig) == 2
    assert rig["B"] is rig.cameras[1]
    assert [one.channel for one in rig] == ["A", "B"]


def test_a_rig_names_what_it_lacks_and_what_comes_twice() -> None:
    with pytest.raises(NotFoundError, match="rig has no camera 'C'; it has A, B"):
        CameraRig((camera("A"), camera("B")))["C"]
    with pytest.raises(NotFoundError, match="it has none"):
        CameraRig(())["C"]
    with pytest.raises(ShapeError, match="expected unique channels, got A, A"):
        CameraRig((camera("A"), camera("A")))
