from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError, NotFoundError
from appocc.geometry import inverse
from appocc.rigs import read_rig, read_source_rig, rig_names
from appocc.rigs.variation import field_of_view_deg

ONE = "cameras:\n  CAM_FRONT:\n    size_px: [64, 32]\n    fov_deg: 90\n    position_m: [1, 0, 1.5]\n    yaw_deg: 0\n"
MATRIX = ONE.partition("    position_m")[0] + "    ego_from_cam: "


@pytest.mark.parametrize("name", ["paper", "paper_full"])
def test_the_papers_rig_is_shipped_in_two_sizes(name: str) -> None:
    rig = read_rig(name)
    assert len(rig) == 6
    width = {"paper": 352, "paper_full": 1920}[name]
    for camera in rig:
        yaw, fov = {
            "CAM_FRONT_LEFT": (55, 70),
            "CAM_FRONT": (0, 70),
            "CAM_FRONT_RIGHT": (-55, 70),
            "CAM_BACK_LEFT": (110, 70),
            "CAM_BACK": (180, 110),
            "CAM_BACK_RIGHT": (-110, 70),
        }[camera.channel]
        assert camera.width_px == width
        assert np.degrees(2 * np.arctan(width / 2 / camera.intrinsic[0, 0])) == pytest.approx(fov)
        ahead = camera.ego_from_cam[:3, 2]
        np.testing.assert_allclose(ahead, [np.cos(np.radians(yaw)), np.sin(np.radians(yaw)), 0], atol=1e-12)
        np.testing.assert_allclose(camera.ego_from_cam[:3, 1], [0, 0, -1], atol=1e-12)


def test_four_fisheyes_are_shipped_and_cut_into_views_like_those_of_the_training() -> None:
    assert rig_names() == ("fisheye", "paper", "paper_full")
    rig = read_source_rig("fisheye")
    assert rig.names == ("front", "left", "back", "right")
    assert len(rig.rig) == 8
    for camera in rig.rig:
        assert 70 < field_of_view_deg(camera) < 110
        # The network's input needs no more pixels than the view has.
        assert camera.width_px > 352


def test_the_small_rig_is_the_large_one_reduced_and_cut() -> None:
    large, small = read_rig("paper_full"), read_rig("paper")
    for camera in large:
        cut = camera.resized(352, 198).cropped(0, 48, 352, 128)
        np.testing.assert_allclose(cut.intrinsic, small[camera.channel].intrinsic, atol=1e-9)


def test_pitch_looks_down_and_roll_turns_clockwise(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(ONE + "    pitch_deg: 10\n")
    assert read_rig(str(path))["CAM_FRONT"].ego_from_cam[2, 2] == pytest.approx(-np.sin(np.radians(10)))
    path.write_text(ONE + "    roll_deg: 10\n")
    camera = read_rig(str(path))["CAM_FRONT"]
    # To a camera that is rolled clockwise, what lies level on its left appears lower.
    left_far = (inverse(camera.ego_from_cam) @ [101.0, 50.0, 1.5, 1.0])[:3]
    assert left_far[1] > 0


def test_an_intrinsic_may_be_given(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    lens = "    intrinsic: [[50, 0, 31], [0, 51, 15], [0, 0, 1]]\n"
    path.write_text(ONE.replace("    fov_deg: 90\n", lens))
    assert read_rig(str(path))["CAM_FRONT"].intrinsic.tolist() == [[50, 0, 31], [0, 51, 15], [0, 0, 1]]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[1, 2", "no valid YAML"),
        ("", "the file"),
        ("cameras: {}", "cameras"),
        ("cameras:\n  ../x: {}", "cameras: expected a name that its pictures can have, such as front, got '../x'"),
        (ONE.replace("fov_deg: 90", "fov_deg: .nan"), "fov_deg"),
        (ONE.replace("fov_deg: 90", "fov_deg: 190"), "fov_deg"),
        (
            ONE.replace("fov_deg: 90", "fov_deg: 1.57"),
            "field of view in degrees, from 5 to 175, such as 70, got 1.57",
        ),
        (ONE.replace("fov_deg: 90", "focal_px: 0.6"), "focal_px: expected focal lengths in pixels, 1 to 768 for"),
        (
            ONE.replace("fov_deg: 90", "focal_px: 32\n    centre_px: [310, 12]"),
            "expected a principal point in pixels",
        ),
        (
            ONE.replace("fov_deg: 90", "focal_px: 32\n    distortion: [-4, 0, 0, 0]"),
            "distortion: expected k1, k2, p1, p2, ... of OpenCV, with which the lens sees its whole picture",
        ),
        (ONE.replace("    fov_deg: 90\n", ""), "either fov_deg, focal_px or intrinsic, such as fov_deg: 70"),
        (ONE + "    intrinsic: [[50, 0, 31], [0, 51, 15], [0, 0, 1]]\n", "got fov_deg and intrinsic"),
        (
            ONE.replace("fov_deg: 90", "intrinsic: [[0, 0, 31], [0, 51, 15], [0, 0, 1]]"),
            "positive focal lengths",
        ),
        (ONE + "    zoom: 3\n", "cameras.CAM_FRONT: expected the keys role, size_px"),
        (ONE + ONE.removeprefix("cameras:\n"), "'CAM_FRONT' occurs twice"),
        (ONE + "    yaw_deg: 90\n", "'yaw_deg' occurs twice"),
        (ONE.replace("yaw_deg: 0", "yaw_deg: 2020-99-99"), "no valid YAML"),
        (ONE.replace("[64, 32]", f"[{'9' * 5000}, 32]"), "no valid YAML"),
        (ONE.replace("[64, 32]", "[64, 0]"), "size_px: expected width and height of a picture, 8 to 8192 pixels"),
        (ONE.replace("[64, 32]", "[99999, 32]"), "size_px"),
        (ONE.replace("[1, 0, 1.5]", "[1, .inf, 1.5]"), "position_m"),
        (ONE.replace("[1, 0, 1.5]", "[1, 0, 1.0e+12]"), "CAM_FRONT: translation: expected at most 1e+09 m"),
        (ONE + "ego_vehicle: 4.6\n", "ego_vehicle"),
        (ONE + "    role: nose\n", "role: expected front or front_left or"),
        (
            ONE + ONE.replace("cameras:\n  CAM_", "  ").lower(),
            "role or name of its own for each camera, got CAM_FRONT and",
        ),
        (ONE + "    axes: body\n", "axes: expected nothing, as yaw_deg"),
        (ONE + "    distortion: [0.1, 0.2]\n", "distortion: expected 4, 5 or 8 coefficients of OpenCV: k1, k2"),
        (ONE + "    distortion: [0, 0, 0, 0]\n    fisheye: [0, 0, 0, 0]\n", "either distortion or fisheye"),
        (ONE + "    distortion: [-0.5, 0, 0, 0]\n", "reaches before its distortion folds the picture, got 90"),
        (ONE + "    fisheye: [0.1]\n", "fisheye.coefficients: expected k1, k2, k3, k4 of cv2.fisheye, such as [0.05"),
        (ONE + "    fisheye: {model: kb}\n", "fisheye.model: expected kannala_brandt or polynomial or ocamcalib"),
        (ONE + "    fisheye: {model: polynomial, coefficients: [50]}\n", "fov_deg: expected nothing beside fisheye"),
        (ONE + "    fisheye: {coefficients: [0, 0, 0, 0], aspect: 1}\n", "aspect: expected nothing for the model"),
        (ONE + "    ego_from_cam: [[1, 0, 0, 0]]\n", "got position_m and ego_from_cam"),
        (
            MATRIX + "[[1, 0, 0, 0]]",
            "ego_from_cam: expected 3 or 4 rows of 4 numbers, or a rotation and translation_m",
        ),
        (MATRIX + "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 2, 0]]", "ego_from_cam: expected a rotation matrix"),
        (MATRIX + "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]]", "got a mirror: one axis is reversed"),
        (
            MATRIX + "{rodrigues: [-70, 69, -69], translation_m: [0, 0, 1]}",
            "rodrigues: expected a rotation vector in",
        ),
        (MATRIX + "{translation_m: [0, 0, 0]}", "either quaternion_wxyz, quaternion_xyzw, rodrigues or yaw_deg"),
        (MATRIX + "{quaternion_wxyz: [1, 2, 3, 4], translation_m: [0, 0, 0]}", "expected a unit quaternion"),
        (MATRIX + "{rodrigues: [0, 0, 1]}", "translation_m: expected three coordinates in metres"),
        (MATRIX + "{yaw_deg: 3, translation_m: [0, 0, 0]}", "axes: expected optical or body beside the angles"),
        (
            MATRIX + "{rodrigues: [0, 0, 1], translation_m: [0, 0, 0]}\n    yaw_deg: 3",
            "yaw_deg: expected nothing beside",
        ),
        (
            ONE.replace("fov_deg: 90", "fov_deg: 150\n    pitch_deg: 90\n    fisheye: [0, 0, 0, 0]"),
            "view of the horizon",
        ),
        (ONE + "ego_vehicle: {height_m: 1.5}\n", "ego_vehicle: expected the keys length_m"),
        (ONE + "ego_vehicle: {length_m: .nan}\n", "ego_vehicle.length_m"),
        (ONE + "ego_vehicle: {width_m: 0}\n", "ego_vehicle.width_m: expected metres above 0"),
        (ONE + "ego_vehicle: {rear_overhang_m: 5}\n", "rear_overhang_m: expected less than length_m"),
    ],
)
def test_what_is_no_rig_is_told_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    with pytest.raises(DataError) as caught:
        read_rig(str(path))
    assert reason in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_rig_file_gives_the_size_of_the_ego_vehicle(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(ONE)
    assert read_rig(path).ego_vehicle == EgoVehicle()
    path.write_text(ONE + "ego_vehicle:\n  length_m: 12\n  rear_overhang_m: 3.5\n")
    rig = read_rig(path)
    assert rig.ego_vehicle == EgoVehicle(length_m=12.0, rear_overhang_m=3.5)
    assert rig.with_cameras(()).ego_vehicle == rig.select(["CAM_FRONT"]).ego_vehicle == rig.ego_vehicle


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(NotFoundError, match="fisheye, paper, paper_full"):
        read_rig("carla")


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(DataError, match="cannot be read as text"):
        read_rig(str(path))
