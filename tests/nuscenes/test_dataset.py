"""Reading scenes, samples, files, poses, boxes, frames and maps from a dataset known by heart."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_dataset import INTRINSIC, START_US, TinyDataset, token

from appocc.errors import DataError, NotFoundError
from appocc.geometry import apply
from appocc.nuscenes import Dataset
from appocc.nuscenes.dataset import sample_at
from appocc.nuscenes.records import Sample, Scene


def opened(tiny: TinyDataset) -> tuple[Dataset, Scene, tuple[Sample, ...]]:
    dataset = Dataset(tiny.write())
    return dataset, dataset.scenes[0], dataset.samples(dataset.scenes[0])


# Scenes and samples -----------------------------------------------------------------------------------------------


def test_a_scene_is_found_by_name_and_by_token(tiny_root: Path) -> None:
    dataset = Dataset(str(tiny_root), "v1.0-tiny")
    assert dataset.scene("scene-tiny") is dataset.scene(token("scene")) is dataset.scenes[0]
    assert dataset.scenes[0].description == "a made-up street"
    with pytest.raises(NotFoundError, match="no scene 'scene-0061'; it has scene-tiny"):
        dataset.scene("scene-0061")


def test_a_dataset_without_scenes(tiny: TinyDataset) -> None:
    tiny.tables["scene"] = []
    with pytest.raises(NotFoundError, match="it has none"):
        Dataset(tiny.write()).scene("x")


def test_samples_are_in_order_of_time_for_any_order_of_rows(tiny: TinyDataset) -> None:
    tiny.tables["sample"].reverse()
    dataset, scene, samples = opened(tiny)
    assert [sample.timestamp_us - START_US for sample in samples] == [0, 500_000, 1_000_000]
    assert (samples[0].prev, samples[0].next) == ("", samples[1].token)
    assert dataset.sample(samples[2].token) == samples[2]
    assert sample_at(dataset, scene, 1) == samples[1]


def test_samples_that_are_not_there(tiny: TinyDataset) -> None:
    dataset, scene, _ = opened(tiny)
    with pytest.raises(NotFoundError, match="table sample has no token 'x'"):
        dataset.sample("x")
    for frame in (-1, 3):
        with pytest.raises(NotFoundError, match=rf"scene 'scene-tiny' has frames 0\.\.2, not {frame}"):
            sample_at(dataset, scene, frame)


# Files ------------------------------------------------------------------------------------------------------------


def test_key_frames_of_a_sample_by_channel(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    data = dataset.data(samples[1])
    assert sorted(data) == ["CAM_BACK", "CAM_FRONT", "LIDAR_TOP"]
    assert all(one.is_key_frame for one in data.values())
    front = data["CAM_FRONT"]
    assert (front.modality, front.width_px, front.height_px) == ("camera", 32, 20)
    assert front.timestamp_us == START_US + 490_000
    assert dataset.path(front) == tiny.root / f"samples/CAM_FRONT/{START_US + 490_000}.jpg"


def test_a_channel_may_be_missing_in_some_samples(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"] = [r for r in tiny.tables["sample_data"] if r["token"] != token("LIDAR_TOP", 500_000)]
    dataset, scene, samples = opened(tiny)
    assert sorted(dataset.data(samples[1])) == ["CAM_BACK", "CAM_FRONT"]
    assert [d.timestamp_us - START_US for d in dataset.chain(scene, "LIDAR_TOP")] == [0, 250_000, 1_000_000]
    assert dataset.world_from_ego(samples[1])[1, 3] == pytest.approx(202.5)


def test_the_chain_of_a_channel_has_key_frames_and_sweeps_in_order_of_time(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"].reverse()
    dataset, scene, _ = opened(tiny)
    chain = dataset.chain(scene, "CAM_BACK")
    assert [(d.timestamp_us - START_US, d.is_key_frame) for d in chain] == [
        (-10_000, True),
        (240_000, False),
        (490_000, True),
        (990_000, True),
    ]
    assert len(dataset.stream(scene)) == 12
    times = [d.timestamp_us for d in dataset.stream(scene)]
    assert times == sorted(times)


def test_a_channel_that_the_scene_does_not_have(tiny: TinyDataset) -> None:
    dataset, scene, _ = opened(tiny)
    with pytest.raises(NotFoundError, match="scene 'scene-tiny' has no channel 'RADAR'; it has CAM_BACK, CAM_FRONT"):
        dataset.chain(scene, "RADAR")
    tiny.tables["sample_data"] = []
    dataset, scene, _ = opened(tiny)
    with pytest.raises(NotFoundError, match="it has none"):
        dataset.chain(scene, "RADAR")


def test_a_file_name_that_leads_out_of_the_root(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"][0]["filename"] = "../../etc/passwd"
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match="leads out"):
        dataset.path(dataset.data(samples[0])["CAM_FRONT"])


@pytest.mark.parametrize(("field", "lacks"), [("ego_pose_token", "ego pose"), ("calibrated_sensor_token", "sensor")])
def test_a_file_without_pose_or_sensor(tiny: TinyDataset, field: str, lacks: str) -> None:
    tiny.tables["sample_data"][0][field] = "gone"
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match=rf"sample_data\.json: {token('CAM_FRONT', -10_000)} refers to no {lacks}"):
        dataset.data(samples[0])


def test_lidar_points(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    points = dataset.lidar(dataset.data(samples[0])["LIDAR_TOP"])
    assert points.dtype == np.float64
    np.testing.assert_allclose(points[1], [0, 5, -1.8, 20, 1], atol=1e-6)


# Cameras and poses ------------------------------------------------------------------------------------------------


def test_a_camera_as_it_is_mounted(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    camera = dataset.camera(dataset.data(samples[0])["CAM_FRONT"])
    np.testing.assert_array_equal(camera.intrinsic, INTRINSIC)
    uv, depth = camera.project_ego(np.array([[11.5, 1.0, 1.6]]))
    np.testing.assert_allclose((*uv[0], depth[0]), (13.5, 9.5, 10.0))


def test_a_size_that_the_table_lacks_is_read_from_the_image(tiny: TinyDataset) -> None:
    del tiny.tables["sample_data"][0]["width"]
    dataset, _, samples = opened(tiny)
    camera = dataset.camera(dataset.data(samples[0])["CAM_FRONT"])
    assert (camera.width_px, camera.height_px) == (32, 20)


@pytest.mark.parametrize("value", [[], [[1, 2], [3]], None, "x", [[0.0, 0, 0]] * 3])
def test_an_intrinsic_that_cannot_be_true(tiny: TinyDataset, value: Any) -> None:
    tiny.row("calibrated_sensor", token("mount", "CAM_FRONT"))["camera_intrinsic"] = value
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match=rf"calibrated_sensor\.json: {re.escape(token('mount', 'CAM_FRONT'))}: "):
        dataset.camera(dataset.data(samples[0])["CAM_FRONT"])


def test_a_pose_that_cannot_be_true(tiny: TinyDataset) -> None:
    tiny.tables["ego_pose"][0]["rotation"] = [0, 0, 0, 0]
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match=rf"ego_pose\.json: {token('CAM_FRONT', -10_000)}: quaternion wxyz"):
        dataset.world_from_ego_at(dataset.data(samples[0])["CAM_FRONT"])


@pytest.mark.parametrize("table", ["ego_pose", "calibrated_sensor", "sample_annotation"])
def test_a_rotation_that_is_no_unit_quaternion(tiny: TinyDataset, table: str) -> None:
    for row in tiny.tables[table]:
        row["rotation"] = [1.01 * part for part in row["rotation"]]
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match=rf"{table}\.json: .*quaternion wxyz: expected a length of 1, got "):
        dataset.frame(samples[0], images=False)


def test_rotations_may_be_rounded(tiny: TinyDataset) -> None:
    for row in tiny.tables["ego_pose"]:
        row["rotation"] = [round(part, 3) for part in row["rotation"]]
    dataset, _, samples = opened(tiny)
    np.testing.assert_allclose(dataset.world_from_ego(samples[0])[:2, 0], [0, 1], atol=1e-12)


def test_two_key_frames_of_one_channel(tiny: TinyDataset) -> None:
    """One of two cameras would be lost, whichever way they came to have one name."""
    tiny.row("sensor", token("sensor", "CAM_BACK"))["channel"] = "CAM_FRONT"
    dataset, _, samples = opened(tiny)
    both = f"{token('CAM_FRONT', -10_000)} and {token('CAM_BACK', -10_000)}"
    with pytest.raises(
        DataError, match=rf"sample {samples[0].token}: expected one key frame of CAM_FRONT, got {both}"
    ):
        dataset.data(samples[0])


def test_the_pose_of_a_sample_is_that_of_its_lidar(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    world_from_ego = dataset.world_from_ego(samples[1])
    np.testing.assert_allclose(apply(world_from_ego, np.array([1.0, 0, 0])), [100, 203.5, 0])


def test_without_a_file_at_its_time_the_pose_is_interpolated(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"] = [r for r in tiny.tables["sample_data"] if "LIDAR" not in r["token"]]
    dataset, _, samples = opened(tiny)
    for sample, y in zip(samples, (200.0, 202.5, 205.0), strict=True):
        assert dataset.world_from_ego(sample)[1, 3] == pytest.approx(y, abs=1e-4)


def test_a_sample_without_any_file_has_no_pose(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"] = []
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match=rf"sample {re.escape(samples[0].token)} has no file with an ego pose"):
        dataset.world_from_ego(samples[0])


# Boxes and frames -------------------------------------------------------------------------------------------------


def test_boxes_of_a_sample_with_velocities_from_their_neighbours(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    boxes = dataset.boxes_world(samples[0])
    assert boxes.category == ("vehicle.car", "human.pedestrian.adult")
    assert boxes.instance == (token("car"), token("walker"))
    np.testing.assert_allclose(boxes.centre_m, [[100, 210, 0.8], [95, 205, 0.9]])
    np.testing.assert_allclose(boxes.velocity_mps, [[0, 0], [0, 1]], atol=1e-12)
    np.testing.assert_allclose(boxes.yaw_rad, [np.pi / 2] * 2)
    assert boxes.lidar_points.tolist() == [7, 7]


def test_velocities_over_long_gaps_or_of_lone_boxes_are_not_known(tiny: TinyDataset) -> None:
    tiny.tables["sample"][1]["timestamp"] = START_US + 1_600_000
    tiny.tables["sample"][2]["timestamp"] = START_US + 2_000_000
    for row in tiny.tables["sample_annotation"][3:]:
        row.update(prev="", next="")
    dataset, _, samples = opened(tiny)
    assert np.isnan(dataset.boxes_world(samples[0]).velocity_mps).all()
    # Two neighbours may be twice as far apart.
    assert not np.isnan(dataset.boxes_world(samples[1]).velocity_mps[0]).any()


def test_a_box_that_cannot_be_true(tiny: TinyDataset) -> None:
    tiny.tables["sample_annotation"][0]["size"] = [1, 0, 1]
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match=r"sample_annotation\.json: sample .*: box car-0.*: expected a positive size"):
        dataset.boxes_world(samples[0])


def test_a_box_of_unknown_category_is_refused(tiny: TinyDataset) -> None:
    tiny.tables["category"] = tiny.tables["category"][:1]
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match=r"sample_annotation\.json: walker-.* refers to no instance with a category"):
        dataset.boxes_world(samples[0])


def test_a_frame_has_all_images_of_one_time(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    frame = dataset.frame(samples[1])
    assert (frame.token, frame.timestamp_us) == (samples[1].token, START_US + 500_000)
    assert frame.rig.channels == ("CAM_BACK", "CAM_FRONT")
    assert frame.images["CAM_FRONT"].shape == (20, 32, 3)
    np.testing.assert_allclose(frame.images["CAM_FRONT"][10, 10], [160, 80, 40], atol=6)
    assert frame.boxes_ego is not None
    np.testing.assert_allclose(frame.boxes_ego.centre_m, [[7.5, 0, 0.8], [3, 5, 0.9]], atol=1e-9)
    with pytest.raises(ValueError, match="read-only"):
        frame.images["CAM_FRONT"][0] = 0


def test_cameras_of_a_frame_stand_where_they_stood_when_they_fired(tiny: TinyDataset) -> None:
    """10 ms before the sample, at 5 m/s: 5 cm behind their mounting place."""
    dataset, _, samples = opened(tiny)
    frame = dataset.frame(samples[1], images=False)
    np.testing.assert_allclose(frame.rig["CAM_FRONT"].ego_from_cam[:3, 3], [1.45, 0, 1.6], atol=1e-9)
    assert frame.images == {}


def test_a_dataset_without_annotations_has_no_boxes_rather_than_none_in_sight(tiny: TinyDataset) -> None:
    del tiny.tables["sample_annotation"], tiny.tables["instance"]
    for name in ("sample_annotation", "instance"):
        (tiny.root / tiny.version / f"{name}.json").unlink()
    dataset, _, samples = opened(tiny)
    assert dataset.frame(samples[0]).boxes_ego is None
    assert len(dataset.boxes_world(samples[0])) == 0


def test_a_frame_without_a_box_in_an_annotated_dataset(tiny: TinyDataset) -> None:
    tiny.tables["sample_annotation"] = tiny.tables["sample_annotation"][:1]
    dataset, _, samples = opened(tiny)
    boxes = dataset.frame(samples[2]).boxes_ego
    assert boxes is not None
    assert len(boxes) == 0


def test_a_frame_whose_image_is_damaged(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    dataset.path(dataset.data(samples[0])["CAM_FRONT"]).write_bytes(b"\xff\xd8broken")
    with pytest.raises(DataError, match=r"CAM_FRONT.*truncated"):
        dataset.frame(samples[0])


# Labels and maps --------------------------------------------------------------------------------------------------


def test_lidarseg_where_there_is_any(tiny: TinyDataset) -> None:
    dataset, _, samples = opened(tiny)
    lidar = dataset.data(samples[0])["LIDAR_TOP"]
    assert dataset.label_path(lidar, "lidarseg") is None
    assert dataset.label_names("lidarseg") == {}
    tiny.tables["lidarseg"] = [
        {"token": "l", "sample_data_token": lidar.token, "filename": "lidarseg/v1.0-tiny/a_lidarseg.bin"}
    ]
    for index, row in zip((17, 2), tiny.tables["category"], strict=True):
        row["index"] = index
    dataset, _, samples = opened(tiny)
    assert dataset.label_path(lidar, "lidarseg") == tiny.root / "lidarseg/v1.0-tiny/a_lidarseg.bin"
    assert dataset.label_path(dataset.data(samples[1])["LIDAR_TOP"], "lidarseg") is None
    assert dataset.label_names("lidarseg") == {17: "vehicle.car", 2: "human.pedestrian.adult"}


def test_labels_that_cannot_be_true(tiny: TinyDataset) -> None:
    lidar = token("LIDAR_TOP", 0)
    tiny.tables["lidarseg"] = [{"token": "l", "sample_data_token": lidar, "filename": "../a.bin"}]
    tiny.tables["category"][0]["index"] = "many"
    dataset, _, samples = opened(tiny)
    with pytest.raises(DataError, match="leads out"):
        dataset.label_path(dataset.data(samples[0])["LIDAR_TOP"], "lidarseg")
    with pytest.raises(DataError, match=r"category\.json: index: expected a whole number"):
        _ = dataset.label_names("lidarseg")


def test_where_a_scene_was_recorded(tiny: TinyDataset) -> None:
    dataset, scene, _ = opened(tiny)
    assert dataset.location(scene) == "nowhere"
    tiny.tables["log"][0]["location"] = None
    dataset, scene, _ = opened(tiny)
    assert dataset.location(scene) == ""
    tiny.tables["log"] = []
    dataset, scene, _ = opened(tiny)
    with pytest.raises(DataError, match=r"scene\.json: scene 'scene-tiny' refers to no log"):
        dataset.location(scene)


def test_the_mask_of_a_scene(tiny: TinyDataset) -> None:
    dataset, scene, _ = opened(tiny)
    record = dataset.map_record(scene)
    assert record is not None
    assert (record.filename, record.origin_m, record.unknown_value) == ("maps/drivable.png", (0.0, 0.0), None)
    tiny.tables["map"][0].update(origin_m=[90, 190.5], unknown_value=128, source="made")
    dataset, scene, _ = opened(tiny)
    record = dataset.map_record(scene)
    assert record is not None
    assert (record.origin_m, record.unknown_value, record.source) == ((90.0, 190.5), 128, "made")
    tiny.tables["map"][0]["log_tokens"] = ["another"]
    dataset, scene, _ = opened(tiny)
    assert dataset.map_record(scene) is None


@pytest.mark.parametrize("change", [{"origin_m": [1]}, {"origin_m": "x"}, {"origin_m": 5}, {"unknown_value": "grey"}])
def test_a_mask_that_cannot_be_true(tiny: TinyDataset, change: dict[str, Any]) -> None:
    tiny.tables["map"][0].update(change)
    dataset, scene, _ = opened(tiny)
    with pytest.raises(DataError, match=r"map\.json: .*: origin_m or unknown_value: expected numbers"):
        dataset.map_record(scene)
