from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rig_texts import AHEAD, read_one

from appocc.errors import DataError
from appocc.geometry import inverse
from appocc.lenses import DistortedLens, FisheyeLens, Lens, kannala_brandt, ocamcalib, polynomial_fisheye
from appocc.rigs.poses import mounting_rotation

K = np.array([[461.6, 0, 363.0], [0, 460.3, 248.1], [0, 0, 1]])
CHAIN = """
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 2e-05]
  distortion_model: radtan
  intrinsics: [461.6, 460.3, 363.0, 248.1]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  T_cam_imu:
  - [1.0, 0.0, 0.0, 0.02]
  - [0.0, 1.0, 0.0, 0.03]
  - [0.0, 0.0, 1.0, 0.04]
  - [0.0, 0.0, 0.0, 1.0]
cam1:
  camera_model: pinhole
  distortion_coeffs: [-0.01, 0.07, -0.05, 0.02]
  distortion_model: equidistant
  intrinsics: [461.6, 460.3, 363.0, 248.1]
  resolution: [752, 480]
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
"""
ROS = """
image_width: 752
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [461.6, 0.0, 363.0,
         0.0, 460.3, 248.1,
         0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.28, 0.07, 0.0002, 2e-05, 0.0]
projection_matrix: {rows: 3, cols: 4, data: [400, 0, 370, 0, 0, 420, 250, 0, 0, 0, 1, 0]}
"""
COLMAP = """# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 3
1 OPENCV 752 480 461.6 460.3 363.5 248.6 -0.28 0.07 0.0002 2e-05
2 SIMPLE_RADIAL_FISHEYE 752 480 461.6 363.5 248.6 0.05
3 SIMPLE_PINHOLE 752 480 461.6 363.5 248.6
4 THIN_PRISM_FISHEYE 752 480 1 1 1 1 1 1 1 1 1 1 1 1
"""
# The numbers of WoodScape's example file.
WOODSCAPE = """{"extrinsic": {"quaternion": [0.5941767906169857, -0.5878843193897473, 0.3873184109007999,
-0.3890121040340926], "translation": [3.7484, 0.0, 0.66017]},
"intrinsic": {"aspect_ratio": 1.0, "cx_offset": 3.942, "cy_offset": -3.093,
"height": 966.0, "k1": 339.749, "k2": -31.988, "k3": 48.275, "k4": -7.201, "model": "radial_poly", "poly_order": 4,
"width": 1280.0}, "name": "FV"}"""
SCARAMUZZA = """#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB)

5 -2.000000e+02 0.000000e+00 1.700000e-03 -1.000000e-06 2.000000e-09

#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB)

3 300.0 160.0 -10.0

#center: "row" and "column", starting from 0 (C convention)

480.5 641.25

#affine parameters "c", "d", "e"

0.9999 0.0003 -0.0002

#image size: "height" and "width"

960 1280
"""
RADTAN = DistortedLens(K, np.array([-0.28, 0.07, 0.0002, 2e-05]))


def same(one: Lens, other: Lens) -> bool:
    points = np.random.default_rng(0).uniform([-1, -0.6, 1], [1, 0.6, 5], (50, 3))
    return bool(np.allclose(one.project(points), other.project(points), atol=1e-6, equal_nan=True))


def write_opencv(path: Path, **matrices: Any) -> None:
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in matrices.items():
        file.write(name, value)
    file.release()


def test_a_chain_of_kalibr(tmp_path: Path) -> None:
    (tmp_path / "chain.yaml").write_text(CHAIN)
    (one,) = read_one(tmp_path, "calibration: {file: chain.yaml, camera: cam0}", AHEAD).cameras
    assert (one.width_px, one.height_px) == (752, 480)
    assert same(one.lens, RADTAN)
    (two,) = read_one(tmp_path, "calibration: {file: chain.yaml, camera: cam1}", AHEAD).cameras
    assert same(two.lens, kannala_brandt(K, [-0.01, 0.07, -0.05, 0.02]))
    with pytest.raises(DataError, match=r"expected a camera of cam0, cam1, got several; such as calibration"):
        read_one(tmp_path, "calibration: chain.yaml", AHEAD)


def test_poses_of_a_chain_of_kalibr(tmp_path: Path) -> None:
    (tmp_path / "chain.yaml").write_text(CHAIN)
    ahead = np.eye(4)
    ahead[:3, :3], ahead[:3, 3] = mounting_rotation(0, 0, 0), [1.7, 0.0, 1.5]
    base = f"ego_from_cam0: {ahead.tolist()}"
    (first,) = read_one(tmp_path, f"calibration: {{file: chain.yaml, camera: cam0, {base}}}").cameras
    np.testing.assert_allclose(first.ego_from_cam, ahead, atol=1e-12)
    (second,) = read_one(tmp_path, f"calibration: {{file: chain.yaml, camera: cam1, {base}}}").cameras
    # The second camera is 11 cm to the right of the first.
    np.testing.assert_allclose(second.ego_from_cam[:3, 3], [1.7, -0.11, 1.5], atol=1e-12)
    imu = f"ego_from_imu: {ahead.tolist()}"
    (third,) = read_one(tmp_path, f"calibration: {{file: chain.yaml, camera: cam0, {imu}}}").cameras
    cam_from_imu = np.eye(4)
    cam_from_imu[:3, 3] = [0.02, 0.03, 0.04]
    np.testing.assert_allclose(third.ego_from_cam, ahead @ inverse(cam_from_imu), atol=1e-12)


@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_camera_info_of_ros(tmp_path: Path, model: str) -> None:
    (tmp_path / "left.yaml").write_text(ROS.replace("plumb_bob", model))
    (camera,) = read_one(tmp_path, "calibration: left.yaml", AHEAD).cameras
    assert (camera.width_px, camera.height_px) == (752, 480)
    assert same(camera.lens, RADTAN)


def test_messages_of_ros(tmp_path: Path) -> None:
    # `ros2 topic echo` writes lines between messages.
    message = "height: 480\nwidth: 752\ndistortion_model: plumb_bob\nd: [-0.28, 0.07, 0.0002, 2e-05, 0]\n"
    message += f"k: {K.ravel().tolist()}\n---\n"
    (tmp_path / "left.yaml").write_text(message + message)
    assert same(read_one(tmp_path, "calibration: left.yaml", AHEAD).cameras[0].lens, RADTAN)


def test_a_fisheye_of_ros(tmp_path: Path) -> None:
    four = ROS.replace("plumb_bob", "equidistant").replace("2e-05, 0.0]", "2e-05]")
    (tmp_path / "left.yaml").write_text(four)
    rig = read_one(tmp_path, "calibration: {file: left.yaml, circle_deg: 80}", AHEAD)
    assert same(rig.cameras[0].lens, kannala_brandt(K, [-0.28, 0.07, 0.0002, 2e-05], 80))


@pytest.mark.parametrize("ending", ["yml", "xml", "json"])
def test_formats_of_opencv(tmp_path: Path, ending: str) -> None:
    k = np.array([[-0.28, 0.07, 0.0002, 2e-05, 0.0]])
    size = {"image_width": 752, "image_height": 480}
    write_opencv(tmp_path / f"left.{ending}", **size, camera_matrix=K, distortion_coefficients=k)
    (camera,) = read_one(tmp_path, f"calibration: left.{ending}", AHEAD).cameras
    assert (camera.width_px, camera.height_px) == (752, 480)
    assert same(camera.lens, RADTAN)


def test_matrices_of_opencv(tmp_path: Path) -> None:
    path = tmp_path / "left.yml"
    k = np.array([[-0.28, 0.07, 0.0002, 2e-05]])
    write_opencv(path, image_width=752, image_height=480, camera_matrix=K, distortion_coefficients=k.T)
    pinhole = "calibration: {file: left.yml, model: pinhole}"
    assert same(read_one(tmp_path, pinhole, AHEAD).cameras[0].lens, RADTAN)
    # Four numbers are of a plumb bob or of a fisheye.
    with pytest.raises(
        DataError, match=r"expected model: pinhole or model: fisheye, such as calibration: {file: left"
    ):
        read_one(tmp_path, "calibration: left.yml", AHEAD)
    write_opencv(path, cameraMatrix=K, distCoeffs=np.pad(k, ((0, 0), (0, 10))))
    assert same(read_one(tmp_path, "size_px: [752, 480]", "calibration: left.yml", AHEAD).cameras[0].lens, RADTAN)
    with pytest.raises(
        DataError, match="size_px: expected the width and height of the picture, which the file lacks"
    ):
        read_one(tmp_path, "calibration: left.yml", AHEAD)
    write_opencv(path, image_size=np.array([[752, 480]]), M=K, D=np.pad(k, ((0, 0), (0, 1))))
    (camera,) = read_one(tmp_path, "calibration: left.yml", AHEAD).cameras
    assert (camera.width_px, camera.height_px) == (752, 480)
    assert same(camera.lens, RADTAN)
    write_opencv(path, K=K, D=np.array([[0.1, 0.02, 0.0, 0.0]]))
    keys = ("size_px: [752, 480]", "calibration: {file: left.yml, model: fisheye}", AHEAD)
    assert same(read_one(tmp_path, *keys).cameras[0].lens, kannala_brandt(K, [0.1, 0.02, 0, 0]))
    write_opencv(path, K=K, D=np.array([[0.1] * 12]))
    with pytest.raises(DataError, match=r"left.yml: D: expected no thin prism and no tilt"):
        read_one(tmp_path, "size_px: [752, 480]", "calibration: left.yml", AHEAD)


def test_cameras_of_colmap(tmp_path: Path) -> None:
    # Its pixels are counted from the corner of the first one.
    (tmp_path / "cameras.txt").write_text(COLMAP)
    found = [
        read_one(tmp_path, f"calibration: {{file: cameras.txt, camera: {i}}}", AHEAD).cameras[0] for i in (1, 2, 3)
    ]
    square = np.array([[461.6, 0, 363.0], [0, 461.6, 248.1], [0, 0, 1]])
    assert same(found[0].lens, RADTAN)
    assert same(found[1].lens, kannala_brandt(square, [0.05, 0, 0, 0]))
    assert found[2].pinhole is not None
    assert found[2].pinhole.intrinsic.tolist() == square.tolist()
    with pytest.raises(DataError, match=r"cameras.txt: camera 4: expected a model of SIMPLE_PINHOLE, PINHOLE"):
        read_one(tmp_path, "calibration: {file: cameras.txt, camera: 4}", AHEAD)


def test_the_poses_of_colmap_are_in_a_frame_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "images.txt").write_text("# Image list with two lines of data per image:\n1 1 0 0 0 0 0 0 1 a.jpg\n")
    with pytest.raises(DataError, match=r"images.txt: expected COLMAP's cameras.txt, got its images.txt: its poses"):
        read_one(tmp_path, "calibration: images.txt", AHEAD)


def test_a_refused_value_of_a_calibration_file_is_told_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "left.yaml").write_text(ROS.replace("461.6", "0.6138"))
    with pytest.raises(DataError, match=r"rig.yaml: cameras.front.intrinsic: expected focal .*file is left.yaml$"):
        read_one(tmp_path, "calibration: left.yaml", AHEAD)


def test_a_camera_of_ocamcalib(tmp_path: Path) -> None:
    (tmp_path / "calib_results.txt").write_text(SCARAMUZZA)
    (camera,) = read_one(tmp_path, "calibration: {file: calib_results.txt, circle_deg: 185}", AHEAD).cameras
    assert (camera.width_px, camera.height_px) == (1280, 960)
    polynomial, affine = [-200.0, 0.0, 1.7e-3, -1e-6, 2e-9], (0.9999, 0.0003, -0.0002)
    assert same(camera.lens, ocamcalib(polynomial, [641.25, 480.5], affine, 185))


def test_a_camera_of_woodscape_has_its_pose(tmp_path: Path) -> None:
    (tmp_path / "front.json").write_text(WOODSCAPE)
    (camera,) = read_one(tmp_path, "calibration: front.json").cameras
    assert isinstance(camera.lens, FisheyeLens)
    assert same(camera.lens, polynomial_fisheye([339.749, -31.988, 48.275, -7.201], [643.442, 479.407]))
    assert camera.ego_from_cam[:3, 3].tolist() == [3.7484, 0.0, 0.66017]
    assert camera.ego_from_cam[0, 2] > 0.9, "it looks ahead"
    (moved,) = read_one(tmp_path, "calibration: front.json", AHEAD).cameras
    assert moved.ego_from_cam[:3, 3].tolist() == [1.7, 0.0, 1.5]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "expected Kalibr's camchain, OpenCV's FileStorage"),
        ("{a: [1, 2}", "got no valid YAML"),
        ("{M1: [1], D1: [0]}", "got something else with the keys M1, D1"),
        (ROS.replace("plumb_bob", "double_sphere"), "distortion_model: expected plumb_bob, .*, got 'double_sphere'"),
        (ROS.replace("0.0, 0.0, 1.0]", "0.0]"), "camera_matrix: expected 3x3 numbers, got 7"),
        (ROS.replace("-0.28", "much"), "distortion_coefficients: expected coefficients, such as"),
        (
            ROS.replace("distortion_coefficients", "lens_terms"),
            "expected distortion_coefficients, got none; is it 'lens",
        ),
        (CHAIN.partition("cam1")[0].replace("pinhole", "omni"), "cam0.camera_model: expected pinhole, got 'omni'"),
        (
            CHAIN.partition("cam1")[0].replace("radtan", "fov"),
            "cam0.distortion_model: expected radtan or equi",
        ),
        (WOODSCAPE.replace("radial_poly", "scaramuzza"), "intrinsic.model: expected radial_poly"),
        (WOODSCAPE.replace("339.749", "null"), "intrinsic.k1: expected a coefficient"),
        (
            SCARAMUZZA.replace("480.5 641.25", "480.5"),
            r"front.yaml: center: expected row and column, such as 480 640",
        ),
        (SCARAMUZZA.replace("5 -2.0", "4 -2.0"), "expected 5 in front of 5 coefficients, got"),
        (SCARAMUZZA.partition("#image size")[0], "affine, image size, got 4 rows"),
    ],
)
def test_what_is_no_calibration_is_told_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "front.yaml").write_text(text)
    with pytest.raises(DataError, match=reason) as caught:
        read_one(tmp_path, "calibration: front.yaml", AHEAD)
    assert str(caught.value).startswith(str(tmp_path / "front.yaml"))
    assert "\n" not in str(caught.value)


def test_keys_that_the_calibration_file_has(tmp_path: Path) -> None:
    (tmp_path / "left.yaml").write_text(ROS)
    assert same(read_one(tmp_path, "calibration: left.yaml", "size_px: [752, 480]", AHEAD).cameras[0].lens, RADTAN)
    with pytest.raises(DataError, match=r"size_px: expected nothing, or the size in the calibration file, 752x480, "):
        read_one(tmp_path, "calibration: left.yaml", "size_px: [640, 480]", AHEAD)
    for key, value in (("fov_deg", 70), ("distortion", [0, 0, 0, 0])):
        with pytest.raises(DataError, match=rf"cameras.front.{key}: expected nothing, as the calibration"):
            read_one(tmp_path, "calibration: left.yaml", f"{key}: {value}", AHEAD)
    with pytest.raises(DataError, match=r"calibration.circle_deg: expected nothing for a lens that is no fisheye"):
        read_one(tmp_path, "calibration: {file: left.yaml, circle_deg: 100}", AHEAD)
    with pytest.raises(DataError, match=r"left.yaml: expected poses for ego_from_imu, got a file that has none"):
        read_one(tmp_path, f"calibration: {{file: left.yaml, ego_from_imu: {np.eye(4).tolist()}}}", AHEAD)
    with pytest.raises(DataError, match=r"none.yaml: cannot be read"):
        read_one(tmp_path, "calibration: none.yaml", AHEAD)
