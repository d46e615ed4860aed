from __future__ import annotations

import numpy as np
import pytest

from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.frame import Frame
from appocc.rigs import read_rig
from appocc.visualization.canvas import GREEN, RED, YELLOW
from appocc.visualization.rig_check import camera_angles, rig_sheet

SIZE_PX = (640, 320)


def level(channel: str, yaw_deg: float, height_m: float = 1.6) -> Camera:
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    pose = np.eye(4)
    pose[:3, :3] = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    pose[2, 3] = height_m
    return Camera(channel, *SIZE_PX, np.array([[300.0, 0, 319.5], [0, 300, 100], [0, 0, 1]]), pose)


def sheet_of(*cameras: Camera) -> ByteArray:
    grey = np.full((SIZE_PX[1], SIZE_PX[0], 3), 128, np.uint8)
    images = {camera.channel: grey for camera in cameras}
    return rig_sheet(Frame("t", 0, np.eye(4), CameraRig(cameras), images))


def pixels(picture: ByteArray, colour: tuple[int, int, int]) -> FloatArray:
    """(N, 2) (row, column) of the pixels of nearly one colour."""
    return np.argwhere((np.abs(picture.astype(int) - colour) <= 30).all(axis=-1)).astype(np.float64)


def test_axes_and_horizon_of_a_camera_that_looks_ahead() -> None:
    picture = sheet_of(level("CAM_FRONT", 0))
    assert picture.shape == (320 + 26, 640, 3)  # with the legend
    horizon = pixels(picture, YELLOW)
    assert len(horizon) > 500
    assert horizon[:, 0].mean() == pytest.approx(100, abs=0.5)
    ahead = pixels(picture, RED)
    assert ahead[:, 1].mean() == pytest.approx(319.5, abs=1.5)
    assert ahead[:, 0].min() == pytest.approx(100 + 300 * 1.6 / 40, abs=2)  # the axis ends at 40 m
    assert len(pixels(picture, GREEN)) == 0


def test_the_left_camera_sees_the_y_axis() -> None:
    picture = sheet_of(level("CAM_LEFT", 90))
    assert pixels(picture, GREEN)[:, 1].mean() == pytest.approx(319.5, abs=1.5)
    assert len(pixels(picture, RED)) == 0


def test_cameras_stand_as_they_look_out_of_the_car() -> None:
    picture = sheet_of(level("CAM_BACK", 180), level("CAM_FRONT", 0), level("CAM_FRONT_LEFT", 60))
    assert picture.shape == (640 + 26, 1280, 3)
    red = pixels(picture, RED)
    # Front left has no x axis in sight; front and back have theirs in the middle of their panels, back below both.
    assert set((red // [320, 640]).astype(int).sum(axis=1)[(red[:, 0] < 320)].tolist()) == {1}
    assert red[red[:, 0] > 320, 1].mean() == pytest.approx(320 + 319.5, abs=1.5)


def test_a_wrong_convention_is_told() -> None:
    swapped = level("CAM_FRONT", 0)
    camera = Camera("CAM_FRONT", *SIZE_PX, swapped.intrinsic.copy(), np.eye(4))  # as if the ego were a camera
    assert camera_angles(camera).pitch_deg == pytest.approx(-90)
    assert camera_angles(camera).height_m == 0


@pytest.mark.parametrize("name", ["paper", "paper_full"])
def test_poses_are_those_of_the_rig_file(name: str) -> None:
    yaws = {camera.channel: camera_angles(camera).yaw_deg for camera in read_rig(name)}
    assert yaws["CAM_FRONT_LEFT"] == pytest.approx(55)
    assert abs(yaws["CAM_BACK"]) == pytest.approx(180)
    assert all(abs(camera_angles(camera).roll_deg) < 1e-6 for camera in read_rig(name))


def test_pitch_and_roll_have_the_signs_of_the_rig_file(tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("rig") / "rig.yaml"
    pose = "yaw_deg: 30, pitch_deg: 5, roll_deg: -3"
    path.write_text(f"cameras: {{CAM_A: {{size_px: [64, 32], fov_deg: 70, position_m: [0, 0, 1], {pose}}}}}")
    np.testing.assert_allclose(camera_angles(next(iter(read_rig(str(path))))), [30, 5, -3, 1], atol=1e-9)


def test_no_images() -> None:
    with pytest.raises(DataError, match="expected images"):
        rig_sheet(Frame("t", 0, np.eye(4), CameraRig((level("CAM_FRONT", 0),)), {}))
