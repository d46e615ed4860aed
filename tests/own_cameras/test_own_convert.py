from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from made_own_recording import write_cameras, write_tum

from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError, NotFoundError
from appocc.files import write_image
from appocc.geometry import inverse, quaternion_from_yaw, transform
from appocc.nuscenes import Dataset
from appocc.nuscenes.validate import validate
from appocc.own_cameras.convert import Drive, Summary, convert_drives, ego_trajectory
from appocc.own_cameras.pictures import Clock, find_streams
from appocc.rigs import read_source_rig
from appocc.rigs.source_rig import SourceRig
from appocc.trajectory import Trajectory

START_S = 1_700_000_000
SIZE = (48, 32)
RIG = """
cameras:
  CAM_FRONT: {size_px: [48, 32], fov_deg: 90, position_m: [1.7, 0, 1.5], yaw_deg: 0}
  CAM_BACK: {size_px: [48, 32], fov_deg: 90, position_m: [0, 0, 1.5], yaw_deg: 180}
"""
EGO = np.eye(4)


def picture(camera: str, number: int) -> ByteArray:
    """An image of noise, another one for each camera and number."""
    rng = np.random.default_rng([len(camera), number])
    return np.asarray(cv2.resize(rng.integers(0, 255, (4, 6, 3), np.uint8), SIZE), np.uint8)


def pose(seconds: float) -> FloatArray:
    """5 m/s straight on, while the heading sways."""
    place = [5 * seconds * np.cos(0.5), 7.0 + 5 * seconds * np.sin(0.5), 0.0]
    return transform(quaternion_from_yaw(0.5 + 0.05 * np.sin(seconds)), place)


@pytest.fixture
def rig(tmp_path: Path) -> SourceRig:
    (tmp_path / "rig.yaml").write_text(RIG)
    return read_source_rig(tmp_path / "rig.yaml")


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Two seconds at 10 Hz; the rear camera is 20 ms later."""
    folder = tmp_path / "drive"
    for camera, later_us in (("CAM_FRONT", 0), ("CAM_BACK", 20_000)):
        times = [str(START_S * 1_000_000 + n * 100_000 + later_us) for n in range(21)]
        write_cameras(folder, [camera], times, picture)
    return folder


def poses(folder: Path, begin: float = -1.0, end: float = 4.0, mount: FloatArray = EGO) -> Path:
    seconds = np.arange(begin, end, 0.1)
    times = [round((START_S + s) * 1e6) for s in seconds]
    return write_tum(folder / "poses.txt", times, [pose(s) @ mount for s in seconds])


def converted(drive: Path, rig: SourceRig, trajectory: Trajectory | None, speed_mps: float = 0.0) -> Summary:
    streams = find_streams(drive, rig.names, Clock(), None)
    (summary,) = convert_drives(
        [Drive("mine", streams, trajectory)], rig, drive.parent / "out", {}, speed_mps=speed_mps
    )
    return summary


def measured(drive: Path, rig: SourceRig, channel: str | None = None, **span: float) -> Trajectory:
    streams = find_streams(drive, rig.names, Clock(), None)
    mount = rig.rig[channel].ego_from_cam if channel in rig.rig.channels else EGO
    return ego_trajectory(poses(drive.parent, **span, mount=mount), streams, rig, channel)


def test_a_recording_becomes_a_valid_scene_of_key_frames(drive: Path, rig: SourceRig) -> None:
    summary = converted(drive, rig, measured(drive, rig))
    assert (summary.samples, summary.images, summary.missing, dict(summary.left_out)) == (5, 10, {}, {})
    dataset = Dataset(drive.parent / "out")
    assert validate(dataset) == ()
    samples = dataset.samples(dataset.scene("mine"))
    assert [s.timestamp_us - START_S * 10**6 for s in samples] == [500_000 * i + 20_000 for i in range(5)]


def test_the_devkit_loads_a_recording_without_a_map(drive: Path, rig: SourceRig) -> None:
    nuscenes = pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    converted(drive, rig, None)
    kit = nuscenes.NuScenes("v1.0-own", str(drive.parent / "out"), verbose=False)
    assert len(kit.sample) == 5
    dataset = Dataset(drive.parent / "out")
    assert dataset.map_record(dataset.scene("mine")) is None


def test_every_image_keeps_its_time_its_pose_and_its_pixels(drive: Path, rig: SourceRig) -> None:
    converted(drive, rig, measured(drive, rig))
    dataset = Dataset(drive.parent / "out")
    sample = dataset.samples(dataset.scene("mine"))[2]
    frame = dataset.frame(sample)
    np.testing.assert_allclose(frame.world_from_ego, pose(1.02), atol=1e-4)
    for channel, seconds in (("CAM_FRONT", 1.0), ("CAM_BACK", 1.02)):
        camera = frame.rig[channel]
        np.testing.assert_allclose(camera.intrinsic, rig.rig[channel].intrinsic)
        expected = pose(seconds) @ rig.rig[channel].ego_from_cam
        np.testing.assert_allclose(frame.world_from_ego @ camera.ego_from_cam, expected, atol=1e-4)
        difference = frame.images[channel].astype(int) - picture(channel, 10)
        assert abs(difference).mean() < 5  # JPEG


def test_jpeg_files_are_copied_as_they_are(drive: Path, rig: SourceRig) -> None:
    for path in list((drive / "CAM_FRONT").iterdir()):
        write_image(path.with_suffix(".jpg"), picture("CAM_FRONT", 0))
        path.unlink()
    converted(drive, rig, None)
    first = min((drive.parent / "out" / "samples" / "CAM_FRONT").iterdir())
    assert first.read_bytes() == min((drive / "CAM_FRONT").iterdir()).read_bytes()


def test_missing_and_damaged_pictures_leave_their_camera_out(drive: Path, rig: SourceRig) -> None:
    rear = sorted((drive / "CAM_BACK").iterdir())
    for path in rear[8:13]:
        path.unlink()
    rear[0].write_bytes(b"\x89PNG")
    for path in rear[4:7]:
        path.write_bytes(path.read_bytes()[:100])
    summary = converted(drive, rig, None)
    count, reason = summary.missing["CAM_BACK"]
    assert (summary.samples, summary.images, count) == (5, 7, 3)
    assert "not a readable image" in reason
    dataset = Dataset(drive.parent / "out")
    assert [(problem.severity, problem.kind) for problem in validate(dataset)] == [
        ("note", "samples without a channel")
    ]
    frames = [dataset.frame(sample) for sample in dataset.samples(dataset.scene("mine"))]
    assert [frame.rig.channels for frame in frames[1:3]] == [("CAM_FRONT",), ("CAM_FRONT",)]


def test_without_poses_the_ego_drives_straight_ahead(drive: Path, rig: SourceRig) -> None:
    converted(drive, rig, None, speed_mps=8.0)
    dataset = Dataset(drive.parent / "out")
    places = [dataset.world_from_ego(s)[:3, 3] for s in dataset.samples(dataset.scene("mine"))]
    np.testing.assert_allclose(np.diff(places, axis=0), [[4.0, 0, 0]] * 4, atol=1e-6)


def test_poses_of_a_camera(drive: Path, rig: SourceRig) -> None:
    converted(drive, rig, measured(drive, rig, "CAM_FRONT"))
    dataset = Dataset(drive.parent / "out")
    frames = [dataset.frame(s, images=False) for s in dataset.samples(dataset.scene("mine"))]
    ways = [inverse(frames[0].world_from_ego) @ frame.world_from_ego for frame in frames]
    expected = [inverse(pose(0.02)) @ pose(0.02 + 0.5 * i) for i in range(5)]
    np.testing.assert_allclose(ways, expected, atol=1e-4)
    with pytest.raises(DataError, match=r"poses.txt of CAM_FRONT: expected headings along the way"):
        ego_trajectory(poses(drive.parent), find_streams(drive, rig.names, Clock(), None), rig, "CAM_FRONT")
    with pytest.raises(NotFoundError, match="--poses-of: the rig has no camera 'CAM_TOP'"):
        measured(drive, rig, "CAM_TOP")


def test_key_frames_without_a_pose_are_left_out_and_counted(drive: Path, rig: SourceRig) -> None:
    summary = converted(drive, rig, measured(drive, rig, begin=0.8))
    assert (summary.samples, dict(summary.left_out)) == (3, {"no pose": 2})


def test_poses_of_another_time_are_refused_and_nothing_is_written(drive: Path, rig: SourceRig) -> None:
    with pytest.raises(DataError, match=r"the poses do not cover the pictures: poses from 1700000050.00 s"):
        converted(drive, rig, measured(drive, rig, begin=50, end=60))
    assert sorted(path.name for path in drive.parent.iterdir()) == ["drive", "poses.txt", "rig.yaml"]


def test_a_picture_of_another_aspect_is_refused(drive: Path, rig: SourceRig) -> None:
    path = sorted((drive / "CAM_BACK").iterdir())[5]
    write_image(path, np.zeros((32, 32, 3), np.uint8))
    with pytest.raises(DataError, match=f"{path}: CAM_BACK: expected 48x32 pixels, .*, got 32x32"):
        converted(drive, rig, None)
    assert not (drive.parent / "out").exists()
