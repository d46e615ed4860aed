from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from made_map import BLUE, RED, map_of, pose
from made_scene import with_maps
from made_tracks import track
from tiny_dataset import TinyDataset

from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.objects import KINDS
from appocc.visualization.cameras import camera_rows
from appocc.visualization.labels import LabelPlacer, draw_colour_chip
from tracking.pipeline import SceneTracks, track_scene
from tracking.tracks import Track
from tracking.visualization.panels import (
    corners_world,
    draw_bev_panel,
    draw_camera_panel,
    draw_list_panel,
    footprint_world,
    track_colour,
)
from tracking.visualization.video import check_video_path, collect_trails, write_video

INK = (255, 255, 255)


def looking(channel: str, yaw_rad: float, x_m: float = 0.0) -> Camera:
    """A level camera 1.5 m above ground that looks along a direction of the ego frame."""
    ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    ego_from_cam = np.eye(4)
    ego_from_cam[:3, :3] = np.stack([np.cross(down, ahead), down, ahead], axis=1)
    ego_from_cam[:3, 3] = x_m, 0, 1.5
    return Camera(channel, 640, 360, np.array([[400.0, 0, 319.5], [0, 400, 179.5], [0, 0, 1]]), ego_from_cam)


def at(x_m: float, y_m: float, number: int = 1, yaw_rad: float = 0.0, heading_known: bool = True) -> Track:
    place = np.array([x_m, y_m, 0.0])
    return track(number, position_world_m=place, yaw_world_rad=yaw_rad, heading_known=heading_known)


def ink_near(picture: ByteArray, ink: tuple[int, int, int]) -> FloatArray:
    """(column, row) mean of the pixels of one colour."""
    rows, columns = np.nonzero((np.abs(picture.astype(int) - ink) <= 2).all(axis=-1))
    assert len(rows)
    return np.array([columns.mean(), rows.mean()])


# Geometry ---------------------------------------------------------------------------------------------------------


def test_corners_surround_the_track_front_first() -> None:
    footprint = footprint_world(at(10, 20, yaw_rad=np.pi / 2))
    np.testing.assert_allclose(footprint[0], [10 - 0.9, 20 + 2.25, 0], atol=1e-9)
    np.testing.assert_allclose(footprint.mean(axis=0), [10, 20, 0], atol=1e-9)
    corners = corners_world(at(10, 20))
    np.testing.assert_allclose(corners[4:] - corners[:4], np.tile([0, 0, 1.6], (4, 1)))


def test_what_is_known_of_an_object_is_not_guessed_from_its_size() -> None:
    person = track(kind="pedestrian", length_m=0.6, width_m=0.6, height_m=1.9)
    np.testing.assert_allclose(np.ptp(corners_world(person)[:, 2]), 1.9)
    np.testing.assert_allclose(np.ptp(corners_world(track(kind="pedestrian", length_m=0.6, width_m=0.6))[:, 2]), 1.6)
    panels = [draw_list_panel([track(kind=kind, length_m=2.0, width_m=0.8)], pose(), (480, 44)) for kind in KINDS]
    assert len({panel.tobytes() for panel in panels}) == len(KINDS)


def test_cameras_are_arranged_as_they_look() -> None:
    yaws = {"BACK": 180, "RIGHT": -100, "FRONT": 0, "LEFT": 100, "FRONT_RIGHT": -55, "FRONT_LEFT": 55}
    rig = CameraRig(tuple(looking(name, np.radians(yaw)) for name, yaw in yaws.items()))
    names = [[camera.channel for camera in row] for row in camera_rows(rig)]
    assert names == [["FRONT_LEFT", "FRONT", "FRONT_RIGHT"], ["LEFT", "BACK", "RIGHT"]]
    assert camera_rows(CameraRig((looking("ONLY", np.pi),)))[0][0].channel == "ONLY"


def test_trails_are_short_and_only_of_tracks_that_are_there(tiny: TinyDataset) -> None:
    dataset = with_maps(tiny)
    result = track_scene(dataset, dataset.scenes[0], "groundtruth")
    moments = ((at(0, 0, 1), at(5, 5, 2)), (at(1, 0, 1),), (at(2, 0, 1),))
    made = SceneTracks(result.scene, result.source, result.samples, result.world_from_ego, moments)
    paths = collect_trails(made, 2)
    assert list(paths) == [1]
    np.testing.assert_allclose(paths[1][:, 0], [0, 1, 2])


# Pictures ---------------------------------------------------------------------------------------------------------


def test_the_map_shows_a_track_left_and_ahead_up_and_to_the_left() -> None:
    tracks = [at(20, 10, 3)]
    trail = {3: np.array([[18.0, 10.0, 0.0], [20.0, 10.0, 0.0]])}
    picture = draw_bev_panel(map_of([]), tracks, trail, pose(), EgoVehicle())
    assert picture.shape == (800, 800, 3)
    box = picture[160:240, 280:320]
    # 10 px a metre: (20, 10) lies 200 px above and 100 px left of the middle.
    np.testing.assert_allclose(ink_near(box, track_colour(3)), [20, 40], atol=4)


def test_the_front_mark_lies_ahead_of_the_centre() -> None:
    def marks(yaw_rad: float) -> FloatArray:
        both = [
            draw_bev_panel(map_of([]), [at(20, 0, 1, yaw_rad, known)], {1: np.zeros((1, 3))}, pose(), EgoVehicle())
            for known in (True, False)
        ]
        rows, columns = np.nonzero(np.abs(both[0].astype(int) - both[1]).sum(axis=-1))
        return np.array([columns.mean(), rows.mean()])

    np.testing.assert_allclose(marks(0.0), [400, 200 - 11], atol=3)
    np.testing.assert_allclose(marks(np.pi / 2), [400 - 11, 200], atol=3)


def test_the_map_follows_the_ego() -> None:
    tracks, trail = [at(120, 60, 3)], {3: np.array([[120.0, 60.0, 0.0]])}
    picture = draw_bev_panel(map_of([]), tracks, trail, pose(100, 50), EgoVehicle())
    np.testing.assert_allclose(ink_near(picture[160:240, 280:320], track_colour(3)), [20, 40], atol=4)


def test_a_camera_panel_shows_a_track_at_its_position() -> None:
    image = np.zeros((360, 640, 3), np.uint8)
    camera = looking("CAM_FRONT", 0.0)
    picture = draw_camera_panel(image, camera, [at(20, 5, 4)], pose(), (320, 180))
    assert picture.shape == (180, 320, 3)
    # Its middle, (20, 5, 0.8), projects to u = 319.5 - 400 * 5 / 20, v = 179.5 + 400 * 0.7 / 20; halved.
    np.testing.assert_allclose(ink_near(picture, track_colour(4)), [110, 97], atol=8)
    behind = draw_camera_panel(image, camera, [at(-20, 5, 4)], pose(), (320, 180))
    assert not (np.abs(behind.astype(int) - track_colour(4)) <= 2).all(axis=-1).any()


def test_the_list_shows_as_many_as_fit() -> None:
    tracks = [at(5.0 * i, 0, i) for i in range(1, 30)]
    picture = draw_list_panel(tracks, pose(), (480, 44))
    assert picture.shape == (44, 480, 3)
    assert picture[:, :240].max() > 200
    assert draw_list_panel([], pose(), (480, 0)).shape == (0, 480, 3)


def test_labels_do_not_cover_each_other() -> None:
    picture: ByteArray = np.zeros((60, 200, 3), np.uint8)
    labels = LabelPlacer(picture)
    placed = [labels.put((100, 30), "7: 12.3m", INK, np.array(RED, float), 10) for _ in range(5)]
    assert placed == [True, True, True, True, False]


def test_labels_keep_off_what_is_to_be_avoided() -> None:
    def middle(avoid: FloatArray) -> float:
        picture: ByteArray = np.zeros((60, 200, 3), np.uint8)
        assert LabelPlacer(picture, avoid).put((100, 30), "7", INK, np.array(RED, float), 5)
        return float(ink_near(picture, RED)[0])

    assert middle(np.zeros((0, 4))) > 100
    assert middle(np.array([[100.0, 0.0, 200.0, 60.0]])) < 100


def test_a_chip_has_the_colour_or_a_cross() -> None:
    picture: ByteArray = np.zeros((20, 20, 3), np.uint8)
    draw_colour_chip(picture, (2, 2), np.array(BLUE, float))
    assert tuple(picture[6, 9]) == BLUE
    draw_colour_chip(picture, (2, 2), np.full(3, np.nan))
    assert tuple(picture[6, 6]) == (0, 0, 0)
    assert tuple(picture[6, 9]) != BLUE


# Video ------------------------------------------------------------------------------------------------------------


def test_a_video_has_all_frames(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = with_maps(tiny)
    result = track_scene(dataset, dataset.scenes[0], "groundtruth")
    steps: list[int] = []
    path = tmp_path / "videos" / "t.webm"
    write_video(dataset, result, path, steps.append)
    assert steps == [1, 1, 1]
    assert [file.name for file in path.parent.iterdir()] == ["t.webm"]
    data = path.read_bytes()
    assert data[:4] == b"\x1a\x45\xdf\xa3"
    assert b"V_VP8" in data
    video = cv2.VideoCapture(str(path))
    frames = [video.read() for _ in range(4)]
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(2.0)
    assert [good for good, _ in frames] == [True, True, True, False]
    height, width = frames[0][1].shape[:2]
    assert (height % 2, width % 2) == (0, 0)
    assert width == 1440 + 800


def test_the_same_tracks_make_the_same_bytes(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = with_maps(tiny)
    result = track_scene(dataset, dataset.scenes[0], "groundtruth")
    for name in ("a.webm", "b.webm"):
        write_video(dataset, result, tmp_path / name)
    assert (tmp_path / "a.webm").read_bytes() == (tmp_path / "b.webm").read_bytes()
    assert [path.name for path in sorted(tmp_path.glob("*.webm"))] == ["a.webm", "b.webm"]


def test_a_broken_image_leaves_no_video(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = with_maps(tiny)
    result = track_scene(dataset, dataset.scenes[0], "groundtruth")
    last = dataset.data(result.samples[-1])["CAM_FRONT"]
    dataset.path(last).write_bytes(b"no image")
    with pytest.raises(DataError, match="not a readable image"):
        write_video(dataset, result, tmp_path / "out" / "t.webm")
    assert list(tmp_path.rglob("out/*")) == []


def test_without_cameras_the_map_alone_is_shown(tiny: TinyDataset, tmp_path: Path) -> None:
    tiny.tables["sample_data"] = [row for row in tiny.tables["sample_data"] if row["fileformat"] == "pcd"]
    tiny.write()
    dataset = with_maps(tiny)
    write_video(dataset, track_scene(dataset, dataset.scenes[0], "groundtruth"), tmp_path / "t.webm")
    assert cv2.VideoCapture(str(tmp_path / "t.webm")).get(cv2.CAP_PROP_FRAME_WIDTH) == 800


def test_the_name_is_checked_first() -> None:
    with pytest.raises(DataError, match=r"t.mp4: expected a name that ends in .webm"):
        check_video_path(Path("t.mp4"))
    check_video_path(Path("t.webm"))
