from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_texts import AHEAD, PINHOLE, read_one
from scipy.spatial.transform import Rotation

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.geometry import inverse
from appocc.rigs import read_source_rig
from appocc.rigs.poses import BODY_FROM_OPTICAL, mounting_rotation

# A camera that looks 55 degrees to the left and 10 down, rolled by 3.
ROTATION = mounting_rotation(55, 10, 3)
PLACE = [1.52, 0.49, 1.51]
POSE = np.vstack([np.column_stack([ROTATION, PLACE]), [0.0, 0.0, 0.0, 1.0]])
BODY = POSE.copy()
BODY[:3, :3] = ROTATION @ BODY_FROM_OPTICAL.T


def turn(matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> dict[str, list[float]]:
    """The rotation of a transform in each form that has no angles."""
    rotation = Rotation.from_matrix(matrix[:3, :3])
    return {
        "quaternion_wxyz": rotation.as_quat(scalar_first=True).tolist(),
        "quaternion_xyzw": rotation.as_quat().tolist(),
        "rodrigues": rotation.as_rotvec().tolist(),
    }


@pytest.mark.parametrize("form", ["4x4", "3x4", "quaternion_wxyz", "quaternion_xyzw", "rodrigues"])
@pytest.mark.parametrize("axes", ["optical", "body", ""])
@pytest.mark.parametrize("key", ["ego_from_cam", "cam_from_ego"])
def test_the_same_pose_in_every_form(tmp_path: Path, form: str, axes: str, key: str) -> None:
    pose = BODY if axes == "body" else POSE
    matrix = pose if key == "ego_from_cam" else inverse(pose)
    if form in ("4x4", "3x4"):
        value: object = matrix[: int(form[0])].tolist()
    else:
        value = {form: turn(matrix)[form], "translation_m": matrix[:3, 3].tolist()}
    (camera,) = read_one(tmp_path, PINHOLE, f"{key}: {value}", *([f"axes: {axes}"] if axes else [])).cameras
    np.testing.assert_allclose(camera.ego_from_cam, POSE, atol=1e-9)


def test_angles_of_a_body_are_those_of_a_mounted_camera(tmp_path: Path) -> None:
    angles = "yaw_deg: 55, pitch_deg: 10, roll_deg: 3"
    body = f"ego_from_cam: {{{angles}, translation_m: {PLACE}}}\n    axes: body"
    (one,) = read_one(tmp_path, PINHOLE, body).cameras
    (other,) = read_one(tmp_path, PINHOLE, f"position_m: {PLACE}", *angles.split(", ")).cameras
    np.testing.assert_allclose(one.ego_from_cam, POSE, atol=1e-12)
    np.testing.assert_allclose(other.ego_from_cam, POSE, atol=1e-12)


def test_angles_of_optical_axes_are_those_of_robots(tmp_path: Path) -> None:
    # ROS' rotation of an optical frame that looks ahead: roll -90, pitch 0, yaw -90 degrees.
    ahead = "ego_from_cam: {yaw_deg: -90, roll_deg: -90, translation_m: [1.7, 0, 1.5]}\n    axes: optical"
    (one,) = read_one(tmp_path, PINHOLE, ahead).cameras
    (other,) = read_one(tmp_path, PINHOLE, AHEAD).cameras
    np.testing.assert_allclose(one.ego_from_cam, other.ego_from_cam, atol=1e-12)


@pytest.mark.parametrize(
    ("key", "matrix", "hint"),
    [
        ("ego_from_cam", inverse(POSE), "; is it cam_from_ego?"),
        ("cam_from_ego", POSE, "; is it ego_from_cam?"),
        ("ego_from_cam", BODY, "; is it axes: body?"),
        ("cam_from_ego", BODY, "; is it ego_from_cam with axes: body?"),
    ],
)
def test_a_pose_in_another_frame_is_told_with_what_it_may_be(
    tmp_path: Path, key: str, matrix: FloatArray, hint: str
) -> None:
    with pytest.raises(
        DataError, match=rf"cameras.front.{key}: expected .*such as position_m: .*, got one "
    ) as caught:
        read_one(tmp_path, PINHOLE, f"{key}: {matrix.tolist()}")
    assert str(caught.value).endswith(hint)


def test_a_quaternion_in_the_other_order_is_told(tmp_path: Path) -> None:
    numbers = turn(POSE)["quaternion_xyzw"]
    with pytest.raises(DataError, match="is it quaternion_xyzw"):
        read_one(tmp_path, PINHOLE, f"ego_from_cam: {{quaternion_wxyz: {numbers}, translation_m: {PLACE}}}")


@pytest.mark.parametrize(
    ("keys", "got"),
    [
        ("position_m: [1700, 0, 1500]\n    yaw_deg: 0", "got one at [1700.00, 0.00, 1500.00]"),
        ("position_m: [1.7, 0, -1.5]\n    yaw_deg: 0", "got one at [1.70, 0.00, -1.50]"),
        ("position_m: [1.7, 0, 1.5]\n    yaw_deg: 0\n    pitch_deg: -60", "got one that looks 60 degrees up"),
    ],
)
def test_a_pose_that_no_camera_of_a_vehicle_has_is_told(tmp_path: Path, keys: str, got: str) -> None:
    with pytest.raises(
        DataError, match=r"front.position_m: expected a camera 0.1 to 10 m above the ground"
    ) as caught:
        read_one(tmp_path, PINHOLE, keys)
    assert got in str(caught.value)


def test_a_camera_may_be_mounted_upside_down_by_angles(tmp_path: Path) -> None:
    (camera,) = read_one(tmp_path, PINHOLE, AHEAD, "roll_deg: 180").cameras
    with pytest.raises(DataError, match=r"expected an upright camera, .*, got one rolled by 180 degrees"):
        read_one(tmp_path, PINHOLE, f"ego_from_cam: {camera.ego_from_cam.tolist()}")


def test_yaws_in_radians_are_told(tmp_path: Path) -> None:
    one = "  {}: {{size_px: [320, 180], fov_deg: 70, position_m: [1.7, 0, 1.5], yaw_deg: {}}}\n"
    path = tmp_path / "rig.yaml"
    path.write_text("cameras:\n" + "".join(one.format(*each) for each in (("a", 0), ("b", 1.9), ("c", -1.9))))
    with pytest.raises(DataError, match=r"expected yaw_deg in degrees, such as 90, got 0, 1.9, -1.9, as of radians"):
        read_source_rig(path)
    # Three cameras that look ahead.
    path.write_text("cameras:\n" + "".join(one.format(*each) for each in (("a", 0), ("b", 1.5), ("c", -1.5))))
    assert len(read_source_rig(path).cameras) == 3
