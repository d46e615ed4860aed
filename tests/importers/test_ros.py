from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from import_checks import assert_balls_in_place, assert_devkit_loads

pytest.importorskip("rosbags", reason="rosbags is not installed")

from ros_twin import (
    CAMERAS,
    HEIGHT,
    PINHOLE,
    POINT,
    SIZE,
    START_NS,
    Messages,
    TwinCamera,
    camera_info,
    cloud,
    compressed,
    drive,
    image,
    jpeg,
    mounted,
    odometry,
    transforms,
)
from rosbags.rosbag2 import StoragePlugin
from typer.testing import CliRunner

from appocc.doctor import contents_of
from appocc.errors import DataError
from appocc.geometry import apply
from appocc.importers import Summary, import_logs
from appocc.importers.ros import Choice, find_logs
from appocc.nuscenes import Dataset
from appocc.nuscenes.validate import validate
from cli.convert import app

GROUND = Choice(height_m=HEIGHT)


def imported(bag: Path, out: Path, choice: Choice = GROUND, hz: float = 5.0) -> tuple[Summary, Dataset]:
    summary = import_logs(find_logs(bag, hz, choice), out, "ros", {})
    return summary, Dataset(out)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drive(cameras=CAMERAS).write(tmp_path_factory.mktemp("bags") / "drive_0")


@pytest.fixture(scope="module")
def converted(bag: Path, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    summary, dataset = imported(bag, tmp_path_factory.mktemp("out") / "ros")
    assert (summary.samples, summary.images, summary.sweeps, summary.boxes) == (6, 18, 6, 0)
    assert not summary.missing
    return dataset


def test_pictures_of_all_lenses_are_rectified_and_in_place(converted: Dataset) -> None:
    assert_balls_in_place(converted, np.zeros(3), 12)
    rig = converted.frame(converted.samples(converted.scenes[0])[0]).rig
    assert {camera.channel for camera in rig} == {"CAM_FRONT", "CAM_REAR_LEFT", "CAM_SIDE"}


def test_the_ego_frame_is_on_the_road_and_points_are_in_place(converted: Dataset) -> None:
    for sample in converted.samples(converted.scenes[0]):
        assert converted.world_from_ego(sample)[2, 3] == pytest.approx(0, abs=1e-6)
        lidar = converted.data(sample)["LIDAR_TOP"]
        points = converted.lidar(lidar).astype(np.float64)
        place = apply(converted.world_from_ego(sample) @ converted.ego_from_sensor(lidar), points[:, :3])
        np.testing.assert_allclose(place, [POINT], atol=1e-4)
        assert points[:, 3:].tolist() == [[77, 3]]


def test_pictures_have_their_own_times_and_poses(converted: Dataset) -> None:
    sample = converted.samples(converted.scenes[0])[1]
    times = {channel: row.timestamp_us - sample.timestamp_us for channel, row in converted.data(sample).items()}
    assert times == {"CAM_FRONT": 0, "CAM_REAR_LEFT": 7000, "CAM_SIDE": 14000, "LIDAR_TOP": 0}


def test_the_result_is_healthy_and_the_devkit_loads_it(converted: Dataset) -> None:
    assert list(validate(converted, images=True)) == []
    assert_devkit_loads(converted.root, "v1.0-ros")
    contents = contents_of(converted)
    assert (contents.annotations, contents.masks, contents.vector_maps) == (0, 0, 0)


def test_mcap_in_a_folder_and_as_a_file_is_the_same_dataset(converted: Dataset, tmp_path: Path) -> None:
    folder = drive(cameras=CAMERAS).write(tmp_path / "drive_0", StoragePlugin.MCAP)
    for source in (folder, next(folder.glob("*.mcap"))):
        imported(source, tmp_path / source.suffix / "out")
        for path in converted.root.rglob("*"):
            if path.is_file() and path.name != "import.json":
                same = tmp_path / source.suffix / "out" / path.relative_to(converted.root)
                assert same.read_bytes() == path.read_bytes()


def test_the_order_of_recording_does_not_matter(converted: Dataset, tmp_path: Path) -> None:
    made = drive(cameras=CAMERAS)
    order = np.random.default_rng(0).uniform(0, 600_000_000, len(made.found)).astype(int)
    late = [(time + int(more), topic, each) for (time, topic, each), more in zip(made.found, order, strict=True)]
    made.found = sorted(late, key=lambda row: row[0])
    summary, _ = imported(made.write(tmp_path / "drive_0"), tmp_path / "out")
    assert (summary.samples, summary.images, summary.sweeps) == (6, 18, 6)
    for path in converted.root.glob("samples/*/*"):
        assert (tmp_path / "out" / path.relative_to(converted.root)).read_bytes() == path.read_bytes()


def test_messages_that_come_far_too_late_are_missing(tmp_path: Path) -> None:
    made = drive(3.0)
    late = START_NS + 203_000_000
    made.found = [
        (time + 2_000_000_000 * (topic == "/points" and time == late), topic, each)
        for time, topic, each in made.found
    ]
    summary, _ = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    assert summary.samples == 16
    assert summary.missing["LIDAR_TOP"] == 1


def test_dropped_pictures_and_a_lost_camera_are_missing(tmp_path: Path) -> None:
    made = drive()
    made.found = [row for row in made.found if "front" not in row[1] or row[0] < START_NS + 500_000_000]
    summary, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    assert summary.missing["front"] == 3
    assert "CAM_FRONT" not in dataset.data(dataset.samples(dataset.scenes[0])[4])


def test_poses_by_tf(converted: Dataset, tmp_path: Path) -> None:
    """From map over odom; the same without odometry, and where it is chosen."""
    bare = drive(with_odometry=False).write(tmp_path / "bare")
    both = drive().write(tmp_path / "both")
    for source, choice in ((bare, GROUND), (both, Choice(height_m=HEIGHT, odometry="/map"))):
        summary, dataset = imported(source, tmp_path / f"{source.name}-out", choice)
        assert "ego poses: tf from map to base_link" in summary.notes
        sample, same = (each.samples(each.scenes[0])[2] for each in (dataset, converted))
        moved = dataset.world_from_ego(sample)[:3, 3] - converted.world_from_ego(same)[:3, 3]
        np.testing.assert_allclose(moved, [100, 50, 0], atol=1e-6)


def test_without_any_poses_the_vehicle_stands(tmp_path: Path) -> None:
    made = drive(0.2)
    made.found = [row for row in made.found if row[1] not in ("/tf", "/odom")]
    summary, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    assert "no odometry, and no frame above the base frame: the ego vehicle is taken for standing" in summary.notes
    assert len(dataset.samples(dataset.scenes[0])) == 2


def test_frames_without_a_pose_are_left_out_and_told(tmp_path: Path) -> None:
    made = drive()
    made.found = [row for row in made.found if row[1] != "/odom" or row[0] < START_NS + 450_000_000]
    summary, _ = imported(made.write(tmp_path / "drive_7"), tmp_path / "out")
    assert summary.samples == 3
    assert "drive_7: left out, without a pose: 3 of 6 key frames" in summary.notes


def one_camera(topic: str, made_image: object, frame: str = "front_optical") -> Messages:
    """A standing vehicle with one picture."""
    made = Messages()
    pose = CAMERAS["front"].base_from_optical
    made.add("/tf_static", START_NS, transforms(START_NS, ("base_link", frame, pose)))
    made.add("/front/camera_info", START_NS, camera_info(START_NS, frame, TwinCamera(0, (0, 0, 0))))
    made.add(topic, START_NS, made_image)
    return made


RED = (200, 30, 60)
FLAT = np.tile(np.array(RED, np.uint8), (SIZE[1], SIZE[0], 1))


def bayer(pattern: str) -> np.ndarray:
    pixels = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    for number, colour in enumerate(pattern):
        pixels[number // 2 :: 2, number % 2 :: 2] = RED["rgb".index(colour)]
    return pixels


@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("rgb8", FLAT),
        ("bgr8", FLAT[:, :, ::-1]),
        ("rgba8", np.dstack([FLAT, FLAT[:, :, :1]])),
        *[(f"bayer_{pattern}8", bayer(pattern)) for pattern in ("rggb", "bggr", "gbrg", "grbg")],
    ],
)
def test_raw_pictures_keep_their_colours(tmp_path: Path, encoding: str, pixels: np.ndarray) -> None:
    made = one_camera("/front/image_raw", image(START_NS, "front_optical", pixels, encoding, pad=5))
    _, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    found = dataset.frame(dataset.samples(dataset.scenes[0])[0]).images["CAM_FRONT"]
    assert np.abs(found[20:-20, 20:-20].astype(int) - RED).max() <= 1


def test_grey_and_yuv_pictures(tmp_path: Path) -> None:
    yuyv = np.full((SIZE[1], SIZE[0], 2), 128, np.uint8)
    for number, (encoding, pixels) in enumerate({"mono8": yuyv[:, :, 0], "yuv422_yuy2": yuyv}.items()):
        made = one_camera("/front/image_raw", image(START_NS, "front_optical", pixels, encoding))
        _, dataset = imported(made.write(tmp_path / f"bag{number}"), tmp_path / f"out{number}")
        found = dataset.frame(dataset.samples(dataset.scenes[0])[0]).images["CAM_FRONT"]
        assert np.abs(found.astype(int) - 129).max() <= 2


def test_pictures_that_cannot_be_read_are_told(tmp_path: Path) -> None:
    made = one_camera("/front/image_raw/compressed", compressed(START_NS, "front_optical", b"\0" * 40, "h264"))
    with pytest.raises(DataError, match="expected pictures with CameraInfo and a transform to base_link, got none"):
        imported(made.write(tmp_path / "bag"), tmp_path / "out")
    made = drive(0.2)
    depth = image(START_NS, "front_optical", np.zeros((4, 4, 2), np.uint8), "16UC1")
    made.add("/sensing/front/depth", START_NS, depth)
    summary, _ = imported(made.write(tmp_path / "bag2"), tmp_path / "out2")
    assert any("/sensing/front/depth (16UC1: expected bgr8" in note for note in summary.notes)


def test_a_body_frame_is_recognised(converted: Dataset, tmp_path: Path) -> None:
    camera = CAMERAS["front"]
    made = one_camera("/front/image_raw/compressed", compressed(START_NS, "camera_link", jpeg(camera, START_NS)))
    body = mounted(np.eye(3), camera.place)
    made.found[0] = (START_NS, "/tf_static", transforms(START_NS, ("base_link", "camera_link", body)))
    summary, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    assert any("taken for a body frame" in note for note in summary.notes)
    poses = [
        each.frame(each.samples(each.scenes[0])[0]).rig["CAM_FRONT"].ego_from_cam for each in (dataset, converted)
    ]
    np.testing.assert_allclose(poses[0], poses[1], atol=1e-6)


def test_rectified_pictures_have_the_projection_as_lens(tmp_path: Path) -> None:
    picture = jpeg(TwinCamera(0, CAMERAS["front"].place), START_NS)
    made = one_camera("/front/image_rect/compressed", compressed(START_NS, "front_optical", picture))
    info = camera_info(START_NS, "front_optical", CAMERAS["front"])
    made.found[1] = (START_NS, "/front/camera_info", info)
    _, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    assert next((tmp_path / "out/samples/CAM_FRONT").iterdir()).read_bytes() == picture
    camera = dataset.frame(dataset.samples(dataset.scenes[0])[0]).rig["CAM_FRONT"]
    assert camera.intrinsic.ravel().tolist() == info.k.tolist()


def test_an_uncalibrated_camera_is_left_out(tmp_path: Path) -> None:
    made = drive(0.2, cameras={**PINHOLE, "top": PINHOLE["front"]})
    for _, topic, each in made.found:
        if topic == "/sensing/top/camera_info":
            each.k = np.zeros(9)
    summary, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    assert "left out, with K = 0: /sensing/top/image_raw/compressed" in summary.notes
    assert [camera.channel for camera in dataset.frame(dataset.samples(dataset.scenes[0])[0]).rig] == ["CAM_FRONT"]


def test_a_region_of_interest_moves_the_axis(tmp_path: Path) -> None:
    part = np.ascontiguousarray(FLAT[:100, :200])
    made = one_camera("/front/image_raw", image(START_NS, "front_optical", part, "rgb8"))
    region = made.found[1][2].roi
    region.x_offset, region.y_offset, region.width, region.height = 50, 70, 200, 100
    _, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    camera = dataset.frame(dataset.samples(dataset.scenes[0])[0]).rig["CAM_FRONT"]
    assert (camera.width_px, camera.height_px) == (200, 100)
    assert camera.intrinsic[:2, 2].tolist() == [158.5 - 50, 121 - 70]


def test_odometry_of_another_frame_of_the_vehicle(converted: Dataset, tmp_path: Path) -> None:
    made = drive(0.4)
    from_base = mounted(np.eye(3), [2.0, 0, 1.0])
    poses = [row for row in made.found if row[1] == "/odom"]
    made.found = [row for row in made.found if row[1] != "/odom"]
    made.add("/tf_static", START_NS, transforms(START_NS, ("base_link", "imu", from_base)))
    for time, _, each in poses:
        stamp = each.header.stamp.sec * 10**9 + each.header.stamp.nanosec
        place = each.pose.pose.position
        pose = mounted(np.eye(3), [place.x, place.y, place.z]) @ from_base
        made.add("/imu_odom", stamp, odometry(stamp, pose, "imu"), time - stamp)
    _, dataset = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    sample, same = (each.samples(each.scenes[0])[1] for each in (dataset, converted))
    np.testing.assert_allclose(dataset.world_from_ego(sample), converted.world_from_ego(same), atol=1e-9)


def two_lidars() -> Messages:
    made = drive(0.2)
    made.add("/rear_points", START_NS, cloud(START_NS, "lidar", np.ones((1, 5))))
    return made


def two_odometries() -> Messages:
    made = drive(0.2)
    made.add("/odom2", START_NS, odometry(START_NS, np.eye(4)))
    return made


def no_tf() -> Messages:
    made = drive(0.2)
    made.found = [row for row in made.found if "tf" not in row[1]]
    return made


@pytest.mark.parametrize(
    ("made", "words", "reason"),
    [
        (two_lidars, [], "expected --lidar, one of /points, /rear_points, got none"),
        (two_odometries, [], "expected --odometry, one of /odom, /odom2, got none"),
        (no_tf, [], "expected --base-frame, one of none: the bag has no transforms in tf or tf_static; got none"),
        (drive, ["--base-frame", "robot"], "expected --base-frame, one of base_link, front_optical"),
        (
            drive,
            ["--odometry", "earth"],
            "expected --odometry, a topic or a frame above base_link (odom, map), got earth",
        ),
        (drive, ["--camera", "top"], "expected --camera, one of front, got top"),
        (drive, ["--lidar", "/top"], "expected --lidar, one of /points, got /top"),
    ],
)
def test_what_is_not_unique_must_be_chosen(tmp_path: Path, made: object, words: list[str], reason: str) -> None:
    folder = made().write(tmp_path / "bag")  # type: ignore[operator]
    result = CliRunner().invoke(app, ["ros", str(folder), str(tmp_path / "out"), *words])
    assert isinstance(result.exception, DataError)
    assert reason in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_chosen_cameras_and_lidar(tmp_path: Path) -> None:
    made = two_lidars()
    made.found += drive(0.2, cameras={"left": PINHOLE["front"], "side": PINHOLE["front"]}).found
    folder = made.write(tmp_path / "bag")
    words = ["--camera", "front", "--camera", "side", "--lidar", "/points", "--height", str(HEIGHT)]
    result = CliRunner().invoke(app, ["ros", str(folder), str(tmp_path / "out"), *words])
    assert result.exit_code == 0, result.output
    assert {path.name for path in (tmp_path / "out/samples").iterdir()} == {"CAM_FRONT", "CAM_SIDE", "LIDAR_TOP"}


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_truncated_bag_is_one_clear_line(tmp_path: Path, plugin: StoragePlugin, share: float) -> None:
    folder = drive(0.2).write(tmp_path / "bag", plugin)
    file = next(path for path in folder.iterdir() if path.suffix != ".yaml")
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * share)])
    result = CliRunner().invoke(app, ["ros", str(folder), str(tmp_path / "out")])
    assert isinstance(result.exception, DataError)
    assert str(folder) in str(result.exception)
    assert "\n" not in str(result.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_damaged_pictures_and_sweeps_are_counted(tmp_path: Path) -> None:
    made = drive(0.4)
    for time, topic, each in made.found:
        if topic == "/points":
            each.row_step *= 2
        if "front/image" in topic and time > START_NS + 50_000_000:
            each.data = each.data[:100]
    summary, _ = imported(made.write(tmp_path / "bag"), tmp_path / "out")
    assert summary.missing["LIDAR_TOP"] == 3
    assert summary.missing["front"] == 2
    assert summary.damaged


def test_folders_without_bags_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"expected a ROS 2 bag \(a folder with metadata\.yaml"):
        find_logs(tmp_path, 2.0, GROUND)
    (tmp_path / "old.bag").touch()
    with pytest.raises(DataError, match="got one of ROS 1"):
        find_logs(tmp_path, 2.0, GROUND)
    (tmp_path / "fox.mcap").write_bytes(cv2.imencode(".png", FLAT)[1].tobytes())
    with pytest.raises(DataError, match=r"fox\.mcap: expected a ROS 2 bag, got a damaged or another file"):
        import_logs(find_logs(tmp_path, 2.0, GROUND), tmp_path / "out", "ros", {})
