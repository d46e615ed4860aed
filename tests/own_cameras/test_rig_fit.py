from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_boards import CORNERS, marked_points, write_boards, write_points

from appocc.checks import FloatArray
from appocc.errors import DataError, NotFoundError
from appocc.files import write_image
from appocc.geometry import inverse
from appocc.own_cameras.ground_points import MarkedPoints, fit_mounting, read_points
from appocc.own_cameras.rig_fit import FittedCamera, board_pictures, fit_rig, write_rig
from appocc.rigs import read_source_rig
from appocc.rigs.source_rig import SourceRig

RIG = """
cameras:
  front:
    size_px: [640, 360]
    intrinsic: [[420, 0, 315], [0, 425, 184], [0, 0, 1]]
    distortion: [-0.28, 0.08, 0.001, -0.001]
    position_m: [1.6, 0.1, 1.4]
    yaw_deg: 3
    pitch_deg: 8
    roll_deg: 1
  back:
    size_px: [480, 480]
    focal_px: 150
    fisheye: [0.03, -0.01, 0.002, -0.0005]
    position_m: [-0.6, 0.0, 1.2]
    yaw_deg: 180
    pitch_deg: 25
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> SourceRig:
    path = tmp_path_factory.mktemp("true") / "rig.yaml"
    path.write_text(RIG)
    return read_source_rig(path)


@pytest.fixture(scope="module")
def boards(rig: SourceRig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("boards")
    write_boards(folder, rig.cameras[0], 10)
    write_boards(folder, rig.cameras[1], 10, 1.8, 0.5)
    return folder


@pytest.fixture(scope="module")
def fitted(rig: SourceRig, boards: Path) -> dict[str, FittedCamera]:
    points = write_points(boards / "points.csv", rig.cameras, noise_px=0.3)
    return fit_rig(board_pictures(boards), CORNERS, points, ["back"])


def test_the_fitted_lenses_see_as_the_true_ones(rig: SourceRig, fitted: dict[str, FittedCamera]) -> None:
    for camera in rig.cameras:
        found = fitted[camera.name].intrinsics
        assert (found.boards >= 5, found.pictures) == (True, 10)
        assert found.error_px < 0.3
        # Over the middle of the picture, where the boards were.
        across, down = np.meshgrid(np.linspace(0.2, 0.8, 8), np.linspace(0.2, 0.8, 6))
        pixels = np.stack([across * camera.width_px, down * camera.height_px], axis=-1).reshape(-1, 2)
        np.testing.assert_allclose(found.lens.project(camera.lens.unproject(pixels)), pixels, atol=2.0)


def test_the_fitted_poses_are_the_true_ones(rig: SourceRig, fitted: dict[str, FittedCamera]) -> None:
    for camera in rig.cameras:
        found = fitted[camera.name].mounting
        off = inverse(camera.ego_from_cam) @ found.ego_from_cam
        assert np.linalg.norm(off[:3, 3]) < 0.06
        assert np.degrees(np.arccos((np.trace(off[:3, :3]) - 1) / 2)) < 0.7
        assert found.error_px < 1.0 <= found.worst_px * 10


def test_the_rig_file_is_read_back(tmp_path: Path, fitted: dict[str, FittedCamera]) -> None:
    write_rig(tmp_path / "rig.yaml", fitted)
    read = read_source_rig(tmp_path / "rig.yaml")
    assert read.names == ("back", "front")
    for camera in read.cameras:
        np.testing.assert_allclose(camera.ego_from_cam, fitted[camera.name].mounting.ego_from_cam, atol=1e-4)
        ray: FloatArray = np.array([[0.3, 0.1, 1.0]])
        np.testing.assert_allclose(
            camera.lens.project(ray), fitted[camera.name].intrinsics.lens.project(ray), atol=0.05
        )


def test_a_wrong_point_is_named(rig: SourceRig, tmp_path: Path) -> None:
    path = write_points(tmp_path / "points.csv", rig.cameras[:1])
    lines = path.read_text().split("\n")
    camera, u, *others = lines[4].split(",")
    lines[4] = ",".join([camera, str(float(u) + 40), *others])
    path.write_text("\n".join(lines))
    found = fit_mounting("front", rig.cameras[0].lens, read_points(path)["front"])
    assert (found.worst_line, found.worst_px > 5) == (5, True)


def test_points_that_fix_no_pose_are_refused(rig: SourceRig) -> None:
    camera = rig.cameras[0]
    uv = np.array([pixel for pixel, _ in marked_points(camera, 6)])
    places = np.array([place for _, place in marked_points(camera, 6)])
    with pytest.raises(DataError, match="expected at least 4 points, got 3"):
        fit_mounting("front", camera.lens, MarkedPoints(uv[:3], places[:3], (2, 3, 4)))
    line = np.stack([np.arange(6.0), np.zeros(6), np.zeros(6)], axis=1)
    with pytest.raises(DataError, match="the points are in a line"):
        fit_mounting("front", camera.lens, MarkedPoints(uv, line, tuple(range(6))))
    with pytest.raises(DataError, match=r"front: expected a camera 0.1 to 10 m .*; are x and y in metres\?"):
        fit_mounting("front", camera.lens, MarkedPoints(uv, 100 * places, tuple(range(6))))
    with pytest.raises(DataError, match=r"front: no pose above the ground fits the points; .* y to the left\?"):
        fit_mounting("front", camera.lens, MarkedPoints(uv, places * [1, -1, 1], tuple(range(6))))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "expected columns camera, u, v, x, y"),
        ("camera,u,v,x\n", r"expected columns .* got camera, u, v, x"),
        ("camera,u,v,x,y\nfront,1,2,3,a\n", ":2: expected a camera and numbers"),
        ("camera,u,v,x,y\nfront,1,2\n", ":2: expected a camera and numbers"),
        ("camera,u,v,x,y\nfront,1,2,3,nan\n", ":2: expected finite numbers"),
    ],
)
def test_damaged_points_are_refused(tmp_path: Path, text: str, match: str) -> None:
    (tmp_path / "points.csv").write_text(text)
    with pytest.raises(DataError, match=match):
        read_points(tmp_path / "points.csv")


def test_boards_that_are_not_seen_are_refused(tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    points.write_text("camera,u,v,x,y\nfront,1,2,3,4\n")
    with pytest.raises(DataError, match="no such folder"):
        board_pictures(tmp_path / "none")
    with pytest.raises(DataError, match="expected a folder of pictures"):
        board_pictures(tmp_path)
    write_image(tmp_path / "front" / "0.png", np.full((60, 80, 3), 90, np.uint8))
    boards = board_pictures(tmp_path)
    with pytest.raises(DataError, match="at least 4 pictures that show a board with 9x6 inner corners, got 0"):
        fit_rig(boards, CORNERS, points, [])
    with pytest.raises(NotFoundError, match="--fisheye: no pictures of camera 'left'; there are front"):
        fit_rig(boards, CORNERS, points, ["left"])
    write_image(tmp_path / "front" / "1.png", np.full((60, 60, 3), 90, np.uint8))
    with pytest.raises(DataError, match=r"1.png: expected 80x60 pixels"):
        fit_rig(boards | board_pictures(tmp_path), CORNERS, points, [])
    write_image(tmp_path / "back" / "0.png", np.full((60, 80, 3), 90, np.uint8))
    with pytest.raises(DataError, match="expected points of back, got none"):
        fit_rig(board_pictures(tmp_path), CORNERS, points, [])
