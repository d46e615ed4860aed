"""Each trap of PandaSet has a test here, on a small recording made by hand."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from panda_twin import CAMERAS, START_S, PandaTwin, world_from_cam, world_from_ego

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import read_image
from appocc.geometry import apply
from appocc.nuscenes import Dataset
from appocc.nuscenes.lidar import read_labels, read_lidar
from appocc.nuscenes.maps import mask_window
from appocc.nuscenes.point_labels import point_labels
from appocc.nuscenes.writer import Writer, token_of
from appocc.pandaset import convert_folder
from appocc.pandaset.convert import convert, road_mask
from appocc.pandaset.plain import read_plain
from appocc.pandaset.recording import CHANNELS, RoadRaster

LOWERED_M = 0.40


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> PandaTwin:
    return PandaTwin(tmp_path_factory.mktemp("twin"))


def converted(twin: PandaTwin, out: Path, lidar: bool = True) -> Dataset:
    convert_folder(twin.source, out, twin.lidar if lidar else None, False, lambda _: None)
    return Dataset(out)


@pytest.fixture(scope="module")
def dataset(twin: PandaTwin, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return converted(twin, tmp_path_factory.mktemp("converted") / "out")


def track_boxes(dataset: Dataset, frame: int) -> dict[str, tuple[FloatArray, FloatArray, float]]:
    """Place, size (w, l, h) and heading of each object of the hand-made recording in a sample."""
    scene = token_of("scene", "002")
    boxes = dataset.boxes_world(dataset.samples(dataset.scenes[0])[frame])
    names = {token_of("instance", scene, name): name for name in ("car", "mover", "mover-twin", "walker", "cycle")}
    rows = zip(boxes.instance, boxes.centre_m, boxes.size_wlh_m, boxes.yaw_rad, strict=True)
    return {names[instance]: (centre, size, float(yaw)) for instance, centre, size, yaw in rows}


def test_counts_and_names(twin: PandaTwin, tmp_path: Path) -> None:
    steps: list[int] = []
    summary = convert_folder(twin.source, tmp_path / "out", twin.lidar, False, steps.append)
    assert summary == {"scenes": ["002"], "samples": 3, "images": 18, "sweeps": 2, "annotations": 12}
    assert steps == [1, 1, 1]
    dataset = Dataset(tmp_path / "out")
    assert dataset.scenes[0].name == "002"
    assert dataset.scenes[0].description == "made by hand"
    samples = dataset.samples(dataset.scenes[0])
    assert [round(s.timestamp_us - START_S * 1e6) for s in samples] == [0, 200_000, 400_000]
    assert [s.prev for s in samples] == ["", samples[0].token, samples[1].token]
    assert set(dataset.data(samples[0])) == {*CHANNELS.values(), "LIDAR_TOP"}
    assert dataset.location(dataset.scenes[0]) == "san-francisco"


def test_the_same_bytes_on_every_run(twin: PandaTwin, dataset: Dataset, tmp_path: Path) -> None:
    again = converted(twin, tmp_path / "again")
    files = sorted(path.relative_to(dataset.root) for path in dataset.root.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(again.root) for path in again.root.rglob("*") if path.is_file())
    assert all((dataset.root / name).read_bytes() == (again.root / name).read_bytes() for name in files)


def test_images_are_copied_as_they_are(twin: PandaTwin, dataset: Dataset) -> None:
    """They are rectified already: the same bytes, and an intrinsic matrix without distortion."""
    for k, sample in enumerate(dataset.samples(dataset.scenes[0])):
        for channel, data in dataset.data(sample).items():
            if channel != "LIDAR_TOP":
                name = next(old for old, new in CHANNELS.items() if new == channel)
                original = twin.source / "002" / "camera" / name / f"{2 * k:02d}.jpg"
                assert dataset.path(data).read_bytes() == original.read_bytes()
                assert (data.width_px, data.height_px) == (64, 36)
                np.testing.assert_array_equal(
                    dataset.camera(data).intrinsic, [[30.5, 0, 31], [0, 30.25, 17.5], [0, 0, 1]]
                )
    rows = json.loads((dataset.tables.folder / "calibrated_sensor.json").read_text())
    assert all("distortion" not in key for row in rows for key in row)


def test_one_calibration_a_camera(dataset: Dataset) -> None:
    assert len(dataset.tables["calibrated_sensor"]) == 7
    assert len(dataset.tables["sensor"]) == 7


def test_every_image_has_its_own_time_and_pose(dataset: Dataset) -> None:
    """Cameras fire up to 0.1 s before the LiDAR: world_from_ego @ ego_from_cam is the camera's pose to 1 mm."""
    for k, sample in enumerate(dataset.samples(dataset.scenes[0])):
        for name, (_, before_s) in CAMERAS.items():
            data = dataset.data(sample)[CHANNELS[name]]
            assert data.timestamp_us == round((START_S + 0.2 * k - before_s) * 1e6)
            pose = dataset.world_from_ego_at(data) @ dataset.ego_from_sensor(data)
            assert np.abs(pose - world_from_cam(name, 2 * k)).max() < 1e-5


def test_the_ego_origin_is_on_the_road(dataset: Dataset) -> None:
    """NuScenes' ego is PandaSet's lowered by 0.40 m along its own z; x and y stay."""
    for k, sample in enumerate(dataset.samples(dataset.scenes[0])[:2]):
        expected = world_from_ego(0.2 * k)
        expected[:3, 3] -= LOWERED_M * expected[:3, 2]
        np.testing.assert_allclose(dataset.world_from_ego(sample), expected, atol=1e-5)
        data = dataset.data(sample)["LIDAR_TOP"]
        ego = apply(dataset.ego_from_sensor(data), read_lidar(dataset.path(data))[:, :3])
        assert abs(np.median(ego[:300, 2])) < 0.01  # the road


def test_cameras_are_mounted_where_they_are(dataset: Dataset) -> None:
    sample = dataset.samples(dataset.scenes[0])[0]
    for name, (yaw, _) in CAMERAS.items():
        mounted = dataset.ego_from_sensor(dataset.data(sample)[CHANNELS[name]])
        np.testing.assert_allclose(mounted[:3, 3], [0.7, 0.5 * math.sin(yaw), 1.5 + LOWERED_M], atol=0.03)
        np.testing.assert_allclose(mounted[:3, 2], [math.cos(yaw), math.sin(yaw), 0], atol=0.02)


def test_images_of_a_frame_without_lidar_are_there_all_the_same(dataset: Dataset) -> None:
    last = dataset.samples(dataset.scenes[0])[2]
    assert set(dataset.data(last)) == set(CHANNELS.values())
    assert len(dataset.frame(last).images) == 6
    expected = world_from_ego(0.4)
    expected[:3, 3] -= LOWERED_M * expected[:3, 2]
    np.testing.assert_allclose(dataset.world_from_ego(last), expected, atol=0.03)  # carried on from the images


def test_boxes_head_along_their_length(dataset: Dataset) -> None:
    for frame in range(3):
        boxes = track_boxes(dataset, frame)
        centre, size, yaw = boxes["car"]
        assert centre.tolist() == [12.0, 3.0, 0.9]
        assert size.tolist() == [1.8, 4.6, 1.5]  # width, length, height
        assert yaw == pytest.approx(0.4)
        way = 6.0 * 0.2 * frame
        np.testing.assert_allclose(
            boxes["mover"][0][:2], [-8 + way * math.cos(0.2), -3 + way * math.sin(0.2)], atol=1e-9
        )


def test_a_moving_box_moves_along_its_heading(dataset: Dataset) -> None:
    first, second = track_boxes(dataset, 0)["mover"], track_boxes(dataset, 1)["mover"]
    motion = second[0] - first[0]
    assert math.atan2(motion[1], motion[0]) == pytest.approx(first[2], abs=1e-6)


def test_duplicates_are_dropped_if_their_sibling_is_in_the_frame(dataset: Dataset) -> None:
    assert set(track_boxes(dataset, 0)) == {"car", "mover", "walker", "cycle"}


def test_categories_attributes_and_points(dataset: Dataset) -> None:
    tables = dataset.tables.folder
    rows: dict[str, list[dict[str, Any]]] = {
        name: json.loads((tables / f"{name}.json").read_text())
        for name in ("sample_annotation", "instance", "category", "attribute")
    }
    category = {row["token"]: row["name"] for row in rows["category"]}
    instance = {row["token"]: category[row["category_token"]] for row in rows["instance"]}
    assert sorted(instance.values()) == [
        "human.pedestrian.adult",
        "vehicle.car",
        "vehicle.motorcycle",
        "vehicle.truck",
    ]
    attribute = {row["token"]: row["name"] for row in rows["attribute"]}
    found: dict[str, set[str]] = {}
    points: dict[str, list[int]] = {}
    for row in rows["sample_annotation"]:
        name = instance[row["instance_token"]]
        found.setdefault(name, set()).update(attribute[token] for token in row["attribute_tokens"])
        points.setdefault(name, []).append(row["num_lidar_pts"])
    assert found["vehicle.car"] == {"vehicle.parked"}
    assert found["vehicle.truck"] == {"vehicle.moving"}
    assert found["vehicle.motorcycle"] == found["human.pedestrian.adult"] == set()
    assert points["vehicle.car"] == [25, 25, -1]  # not known in the frame without LiDAR, which is not none


def test_points_and_labels(twin: PandaTwin, dataset: Dataset) -> None:
    sample = dataset.samples(dataset.scenes[0])[1]
    data = dataset.data(sample)["LIDAR_TOP"]
    raw = read_lidar(dataset.path(data))
    pose = dataset.world_from_ego_at(data) @ dataset.ego_from_sensor(data)
    original = twin.sweeps[2]
    expected = apply(world_from_ego(0.2), original["xyz_cm_ego"] / 100)
    np.testing.assert_allclose(apply(pose, raw[:, :3]), expected, atol=1e-4)
    assert np.array_equal(raw[:, 3], original["intensity"])
    assert (raw[:, 4] == -1).all()  # the ring is not published
    labels = point_labels(dataset, data)
    assert labels is not None
    assert labels.source == "pointlabels"
    own = read_labels(labels.path, len(raw))
    assert np.array_equal(own, original["semseg"])
    assert np.array_equal(labels.is_road[own], np.isin(original["semseg"], [7, 8]))
    assert labels.is_lane is not None
    assert np.array_equal(labels.is_lane[own], original["semseg"] == 8)


def test_lidarseg_has_the_layout_of_nuscenes(twin: PandaTwin, dataset: Dataset) -> None:
    sample = dataset.samples(dataset.scenes[0])[0]
    data = dataset.data(sample)["LIDAR_TOP"]
    path = dataset.label_path(data, "lidarseg")
    assert path == dataset.root / "lidarseg" / "v1.0-pandaset" / f"{data.token}_lidarseg.bin"
    names = [dataset.label_names("lidarseg")[int(label)] for label in read_labels(path, 325)]
    wanted = {
        6: "flat.terrain",
        7: "flat.driveable_surface",
        8: "flat.driveable_surface",
        11: "flat.sidewalk",
        13: "vehicle.car",
    }
    assert names == [wanted[int(label)] for label in twin.sweeps[0]["semseg"]]


def test_the_road_mask_has_its_corner_and_its_north(dataset: Dataset) -> None:
    """Road is x in [-4, 0), y in [-5, 1); north of it is other ground; beyond x = 6 nothing is known."""
    window = mask_window(dataset, dataset.scenes[0], np.array([-50.0, -50.0]), np.array([50.0, 50.0]))
    assert window is not None
    assert window.source.startswith("derived from the semantic labels")
    places = np.array(
        [[-3.9, -4.9], [-0.1, 0.9], [-3.9, 1.1], [-0.1, 6.9], [0.1, -4.9], [5.9, 0.9], [6.1, 0], [-4.1, 0], [0, 7.1]]
    )
    drivable, known = window.sample(places)
    assert drivable.tolist() == [True, True, False, False, False, False, False, False, False]
    assert known.tolist() == [True, True, True, True, True, True, False, False, False]
    record = dataset.map_record(dataset.scenes[0])
    assert record is not None
    picture = read_image(dataset.root / record.filename)
    assert picture.shape == (120, 160, 3)  # 10 px a metre
    assert record.origin_m == (-4.0, -5.0)


def test_road_masks_of_other_cells() -> None:
    label = np.array([[0, 1], [2, 1]], np.uint8)
    np.testing.assert_array_equal(road_mask(RoadRaster(label, (0, 0), 0.1)), [[0, 255], [127, 255]])
    assert road_mask(RoadRaster(label, (0, 0), 0.5)).shape == (10, 10)


def test_without_lidar(twin: PandaTwin, tmp_path: Path) -> None:
    dataset = converted(twin, tmp_path / "out", lidar=False)
    sample = dataset.samples(dataset.scenes[0])[0]
    assert "LIDAR_TOP" not in dataset.data(sample)
    assert (dataset.boxes_world(sample).lidar_points == -1).all()
    assert not (tmp_path / "out" / "lidarseg").exists()


def test_without_road_and_class_names(tmp_path: Path) -> None:
    twin = PandaTwin(tmp_path)
    (twin.source / "road_world.npz").unlink()
    (twin.source / "002/annotations/semseg/classes.json").unlink()
    dataset = converted(twin, tmp_path / "out")
    assert dataset.map_record(dataset.scenes[0]) is None
    data = dataset.data(dataset.samples(dataset.scenes[0])[0])["LIDAR_TOP"]
    assert point_labels(dataset, data) is None


def test_a_camera_without_images_is_skipped(tmp_path: Path) -> None:
    twin = PandaTwin(tmp_path)
    for frame in twin.data["frames"]:
        del frame["cameras"]["back_camera"]
    twin.write()
    dataset = converted(twin, tmp_path / "out")
    assert set(dataset.data(dataset.samples(dataset.scenes[0])[0])) == {*CHANNELS.values(), "LIDAR_TOP"} - {
        "CAM_BACK"
    }


def test_several_recordings_make_one_dataset(twin: PandaTwin, tmp_path: Path) -> None:
    first = read_plain(twin.source, twin.lidar)
    writer = Writer(tmp_path, "v1.0-pandaset")
    for recording in (first, replace(first, name="003")):
        convert(recording, writer, lambda _: None)
    writer.save()
    dataset = Dataset(tmp_path)
    assert [scene.name for scene in dataset.scenes] == ["002", "003"]
    assert all(len(dataset.samples(scene)) == 3 for scene in dataset.scenes)
    assert len(dataset.tables["sensor"]) == 7
    labels = json.loads((dataset.tables.folder / "pointlabels_category.json").read_text())
    assert len(labels) == len({row["index"] for row in labels}) == 6


def test_truncated_images_are_refused(tmp_path: Path) -> None:
    """A JPEG that OpenCV would fill with grey is refused, and nothing is left behind."""
    twin = PandaTwin(tmp_path)
    path = twin.source / "002" / "camera" / "left_camera" / "02.jpg"
    path.write_bytes(path.read_bytes()[:-200])
    assert cv2.imread(str(path)) is not None
    with pytest.raises(DataError, match=r"left_camera/02\.jpg: the image is truncated"):
        converted(twin, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["panda", "panda_lidar"]
