from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from import_checks import assert_balls_in_place, assert_devkit_loads
from kitti_twin import (
    CARS,
    FRAMES,
    IMU_M,
    ORIGIN_360,
    POINTS_IN_CAR,
    RAW,
    RED,
    SIZE,
    car,
    edges,
    save,
    vehicle,
    write_kitti360,
    write_raw,
    write_tracking,
)
from typer.testing import CliRunner

from appocc.camera import Camera
from appocc.errors import DataError
from appocc.geometry import apply
from appocc.importers import Summary, import_logs
from appocc.importers.kitti import find_logs
from appocc.kitti_files import read_labels
from appocc.nuscenes import Dataset
from appocc.nuscenes.validate import validate
from appocc.workers import worker_pool
from cli.convert import app

OTHER = "2011_09_26_drive_0009_sync"
# KITTI's world begins at the IMU of the first frame.
AT_IMU = -(vehicle(0)[:3, :3] @ IMU_M + vehicle(0)[:3, 3])


@dataclass(frozen=True)
class Twin:
    """A made recording and what becomes of it.

    Attributes:
        root: folder of the recording.
        dataset: the converted one.
        summary: counts.
        origin_m: place of the scene's origin in the converted world.
    """

    root: Path
    dataset: Dataset
    summary: Summary
    origin_m: np.ndarray


LAYOUTS: dict[str, tuple[Callable[[Path], Path], np.ndarray]] = {
    "raw": (write_raw, AT_IMU),
    "tracking": (write_tracking, AT_IMU),
    "kitti360": (write_kitti360, ORIGIN_360),
}


@pytest.fixture(scope="module", params=LAYOUTS)
def twin(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Twin:
    write, origin = LAYOUTS[request.param]
    root = tmp_path_factory.mktemp(request.param)
    write(root / "src")
    summary = import_logs(find_logs(root / "src", 5.0), root / "out", "kitti", {})
    return Twin(root / "src", Dataset(root / "out"), summary, origin)


def test_every_file_of_a_key_frame_is_written(twin: Twin) -> None:
    assert (twin.summary.samples, twin.summary.sweeps) == (FRAMES // 2, FRAMES // 2)
    assert not twin.summary.missing
    channels = {camera.channel for camera in twin.dataset.frame(twin.dataset.samples(twin.dataset.scenes[0])[0]).rig}
    assert "CAM_FRONT" in channels


def test_the_ego_frame_is_on_the_road_below_the_rear_axle(twin: Twin) -> None:
    for frame, sample in zip(range(0, FRAMES, 2), twin.dataset.samples(twin.dataset.scenes[0]), strict=True):
        expected = vehicle(frame)
        expected[:3, 3] += twin.origin_m
        np.testing.assert_allclose(twin.dataset.world_from_ego(sample), expected, atol=1e-4)


def test_balls_are_in_place_in_all_cameras(twin: Twin) -> None:
    assert_balls_in_place(twin.dataset, twin.origin_m, 9)


def test_box_edges_lie_on_the_cars_in_the_pictures(twin: Twin) -> None:
    seen = 0
    for sample in twin.dataset.samples(twin.dataset.scenes[0]):
        frame = twin.dataset.frame(sample)
        assert frame.boxes_ego is not None
        for index in range(len(frame.boxes_ego)):
            middles = np.array([(a + b) / 2 for a, b in edges()]) - [0, 0, SIZE[2] / 2]
            middles = apply(frame.boxes_ego.frame_from_box(index), middles)
            for camera in frame.rig:
                uv, depth = camera.project_ego(middles)
                inside = (uv > 5).all(axis=1) & (uv < [camera.width_px - 6, camera.height_px - 6]).all(axis=1)
                for u, v in uv[inside & (depth > 2)]:
                    around = frame.images[camera.channel][round(v) - 1 : round(v) + 2, round(u) - 1 : round(u) + 2]
                    on_edge = bool((np.abs(around.astype(int) - RED).max(axis=-1) < 120).any())
                    seen += on_edge
                    assert on_edge or np.ptp(around.reshape(-1, 3).mean(axis=0)) > 60, "neither an edge nor a ball"
    assert seen > 40


def test_boxes_hold_their_points_and_objects_keep_their_identity(twin: Twin) -> None:
    instances: dict[str, set[str]] = {}
    for frame, sample in zip(range(0, FRAMES, 2), twin.dataset.samples(twin.dataset.scenes[0]), strict=True):
        boxes = twin.dataset.boxes_world(sample)
        for name in CARS:
            if name == "driving" and frame == 0 and "raw" in str(twin.root):
                continue  # its tracklet begins in frame 1
            centre = car(name, frame)[:3, 3] + twin.origin_m + [0, 0, SIZE[2] / 2]
            index = int(np.linalg.norm(boxes.centre_m - centre, axis=1).argmin())
            # Boxes are upright in the frame of the sensor, which leans a little.
            np.testing.assert_allclose(boxes.centre_m[index], centre, atol=2e-2)
            np.testing.assert_allclose(boxes.rotation[index], car(name, frame)[:3, :3], atol=3e-2)
            np.testing.assert_allclose(boxes.size_wlh_m[index], np.array(SIZE)[[1, 0, 2]], atol=1e-6)
            assert boxes.lidar_points[index] >= 0.95 * POINTS_IN_CAR
            assert boxes.category[index] == "vehicle.car"
            instances.setdefault(name, set()).add(boxes.instance[index])
    assert all(len(found) == 1 for found in instances.values())
    assert len(set.union(*instances.values())) == len(CARS)


def test_the_result_is_healthy_and_the_devkit_loads_it(twin: Twin) -> None:
    assert list(validate(twin.dataset, images=True)) == []
    kit = assert_devkit_loads(twin.dataset.root, "v1.0-kitti")
    assert len(kit.scene) == 1


def test_things_without_a_category_are_left_out_and_told(tmp_path: Path) -> None:
    write_raw(tmp_path / "raw")
    summary = import_logs(find_logs(tmp_path / "raw", 2.0), tmp_path / "out", "kitti", {})
    assert "left out, without a class in nuScenes: boxes of Misc" in summary.notes
    assert summary.boxes == 3  # one object in both key frames, one from the second on


def test_the_command_takes_one_of_several_drives(tmp_path: Path) -> None:
    drive = write_raw(tmp_path / "raw")
    drive.with_name(OTHER).symlink_to(drive, target_is_directory=True)
    arguments = ["kitti", str(tmp_path / "raw"), str(tmp_path / "out"), "--log", RAW, "--hz", "10", "--workers", "2"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert [scene.name for scene in Dataset(tmp_path / "out").scenes] == [RAW]
    assert len(Dataset(tmp_path / "out").tables["sample"]) == FRAMES


def test_two_processes_write_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_tracking(tmp_path / name)
    (tmp_path / "src").mkdir()
    (tmp_path / "a/training").rename(tmp_path / "src/training")
    (tmp_path / "b/training").rename(tmp_path / "src/testing")
    logs = find_logs(tmp_path / "src", 5.0)
    assert [log.name for log in logs] == ["training-0003", "testing-0003"]
    import_logs(logs, tmp_path / "one", "kitti", {})
    with worker_pool(2) as pool:
        import_logs(logs, tmp_path / "two", "kitti", {}, pool)
    one, two = (
        {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        for out in (tmp_path / "one", tmp_path / "two")
    )
    assert one == two


@pytest.mark.parametrize("part", ["", "2011_09_26", f"2011_09_26/{RAW}"])
def test_a_drive_is_found_from_any_folder_above(tmp_path: Path, part: str) -> None:
    write_raw(tmp_path)
    assert [log.name for log in find_logs(tmp_path / part, 2.0)] == [RAW]


def test_missing_files_are_counted_and_the_rest_is_converted(tmp_path: Path) -> None:
    drive = write_raw(tmp_path / "raw")
    (drive / "image_03/data/0000000000.png").unlink()
    (drive / "velodyne_points/data/0000000000.bin").write_bytes(b"\0" * 30)
    (drive / "tracklet_labels.xml").unlink()
    for path in drive.glob("*/data/0000000004.[bp]*"):
        path.unlink()
    summary = import_logs(find_logs(tmp_path / "raw", 5.0), tmp_path / "out", "kitti", {})
    assert summary.samples == FRAMES // 2 - 1, "a frame without any file is left out"
    assert summary.missing == {"image_03": 1, "LIDAR_TOP": 1}
    assert "no tracklet_labels.xml: no boxes" in summary.notes
    assert "truncated" in summary.damaged[0]


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><x>&b;</x>'


@pytest.mark.parametrize(
    ("file", "content", "reason"),
    [
        (f"{RAW}/tracklet_labels.xml", BOMB, "without a document type"),
        (f"{RAW}/tracklet_labels.xml", "<a></a>", "expected KITTI's tracklets, got <a>"),
        (f"{RAW}/tracklet_labels.xml", "<a><tracklets><item><h>1</h></item></tracklets></a>", "expected h, w, l"),
        (f"{RAW}/oxts/data/0000000002.txt", "49 8", "expected at least 6 columns, got 2"),
        (f"{RAW}/oxts/data/0000000002.txt", "", "expected a row in each file"),
        (f"{RAW}/oxts/timestamps.txt", "2011-09-26 13:02:10.0\n", "expected 6 times, got 1"),
        (f"{RAW}/image_02/timestamps.txt", "yesterday\n", "line 1: expected a time"),
        ("calib_velo_to_cam.txt", "R: 1 0 0\nT: 0 0 0\n", "expected 9 numbers after R, got 3"),
        ("calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 2\nT: 0 0 0\n", "expected a rotation"),
        ("calib_cam_to_cam.txt", "R_rect_00: 1 0 0 0 1 0 0 0 1\n", "expected a line P_rect_02, got none"),
    ],
)
def test_a_damaged_raw_drive_is_one_clear_line(tmp_path: Path, file: str, content: str, reason: str) -> None:
    write_raw(tmp_path / "raw")
    (tmp_path / "raw/2011_09_26" / file).write_text(content)
    result = CliRunner().invoke(app, ["kitti", str(tmp_path / "raw"), str(tmp_path / "out")])
    assert isinstance(result.exception, DataError)
    assert reason in str(result.exception)
    assert len(str(result.exception).splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("file", "content", "reason"),
    [
        ("calibration/image_02.yaml", "%YAML:1.0\n---\nimage_width: 500\n", "expected a MEI model with xi, k1, k2"),
        ("calibration/calib_cam_to_velo.txt", "1 2 3", "expected 12 numbers, got 3"),
        ("calibration/calib_cam_to_pose.txt", "image_00: 1 2", "expected 12 numbers after image_00, got 2"),
        ("data_poses/2013_05_28_drive_0003_sync/poses.txt", "0 1 2\n", "expected a frame and 12 numbers"),
        ("data_poses/2013_05_28_drive_0003_sync/poses.txt", "9 1 0 0 0 0 1 0 0 0 0 1 0\n", "expected 10 times"),
        ("data_3d_bboxes/train/2013_05_28_drive_0003_sync.xml", "<a><b><transform/></b></a>", "object 0: expected"),
        ("data_3d_bboxes/train/2013_05_28_drive_0003_sync.xml", "<a>", "no valid XML"),
    ],
)
def test_a_damaged_kitti360_is_one_clear_line(tmp_path: Path, file: str, content: str, reason: str) -> None:
    write_kitti360(tmp_path / "src")
    (tmp_path / "src" / file).write_text(content)
    with pytest.raises(DataError, match=reason):
        import_logs(find_logs(tmp_path / "src", 2.0), tmp_path / "out", "kitti", {})
    assert not (tmp_path / "out").exists()


def test_a_folder_without_a_layout_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="expected a layout of KITTI"):
        find_logs(tmp_path, 2.0)


@pytest.mark.realdata
def test_real_labels_project_onto_their_image_boxes(data_root: Path, tmp_path: Path) -> None:
    """Labels and calibration of a real sequence; pictures and poses are not at hand: black, standing."""
    name, folder = "0003", tmp_path / "src/training"
    for kind, real in (("calib", "calib"), ("label_02", "label")):
        (folder / kind).mkdir(parents=True)
        (folder / kind / f"{name}.txt").write_bytes((data_root / "mot/kitti" / real / f"{name}.txt").read_bytes())
    rows = list(read_labels(folder / f"label_02/{name}.txt"))
    (folder / "oxts").mkdir()
    frames = 1 + max(frame for frame, _, _ in rows)
    (folder / f"oxts/{name}.txt").write_text("49 8.4 110 0 0 0\n" * frames)
    for frame in range(frames):
        save(folder / f"image_02/{name}/{frame:06d}.png", np.zeros((375, 1242, 3), np.uint8))
    summary = import_logs(find_logs(tmp_path / "src", 10.0), tmp_path / "out", "kitti", {})
    assert summary.boxes == sum(kind not in ("DontCare", "Misc") for _, kind, _ in rows)
    dataset = Dataset(tmp_path / "out")
    samples = dataset.samples(dataset.scenes[0])
    camera = dataset.frame(samples[0]).rig["CAM_FRONT"]
    off = []
    for number, kind, row in rows:
        if kind != "Car" or row[2:4] != [0, 0] or not 5 < row[5] < row[7] < 1236:
            continue
        boxes = dataset.frame(samples[number], images=False).boxes_ego
        assert boxes is not None
        sides = [_columns(camera, corners) for corners in boxes.corners()]
        off.append(min(np.abs(np.array(side) - [row[5], row[7]]).max() for side in sides))
    assert len(off) > 200
    assert np.median(off) < 0.5


def _columns(camera: Camera, corners: np.ndarray) -> tuple[float, float]:
    uv, depth = camera.project_ego(corners)
    return (float(uv[:, 0].min()), float(uv[:, 0].max())) if (depth > 1).all() else (np.inf, np.inf)
