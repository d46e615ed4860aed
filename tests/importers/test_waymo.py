from __future__ import annotations

import pickle
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from import_checks import assert_balls_in_place, assert_devkit_loads
from typer.testing import CliRunner
from waymo_street import CAR, CAR_LWH, CAR_RGB, CAR_YAW, NAME, NO_LABEL_ZONE, ORIGIN
from waymo_twin import Records, crc32c, framed, write_components

from appocc.doctor import contents_of
from appocc.errors import DataError
from appocc.geometry import apply, inverse, yaw_of
from appocc.importers import import_logs
from appocc.importers.waymo import find_logs
from appocc.importers.waymo.tfrecord import masked_crc32c
from appocc.importers.waymo.wire import Message
from appocc.nuscenes import Dataset
from appocc.nuscenes.label_zones import no_label_zones
from appocc.nuscenes.maps import mask_window, vector_map
from appocc.nuscenes.validate import validate
from cli.convert import app

LAYOUTS = ("v1", "v2")
_MISSED = "all vehicles but bicycles are one class of Waymo: cars, buses, trucks and motorcycles become vehicle.car"


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same segment in both layouts."""
    root = tmp_path_factory.mktemp("waymo")
    Records().write(root / "v1/training")
    write_components(root / "v2/training")
    return root


@pytest.fixture(scope="module")
def converted(sources: Path) -> dict[str, Dataset]:
    found = {}
    for layout in LAYOUTS:
        out = sources / f"out-{layout}"
        summary = import_logs(find_logs(sources / layout, 5.0), out, "waymo", {})
        assert (summary.scenes, summary.samples, summary.images) == ([NAME], 3, 9)
        assert (summary.sweeps, summary.boxes, summary.missing, summary.damaged) == (3, 3, {}, [])
        assert _MISSED in summary.notes
        found[layout] = Dataset(out)
    return found


@pytest.mark.parametrize("layout", LAYOUTS)
def test_pictures_are_rectified_and_in_place(converted: dict[str, Dataset], layout: str) -> None:
    assert_balls_in_place(converted[layout], ORIGIN, 9)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_boxes_lie_on_their_car_in_the_pictures(converted: dict[str, Dataset], layout: str) -> None:
    dataset = converted[layout]
    for sample in dataset.samples(dataset.scenes[0]):
        frame = dataset.frame(sample)
        assert frame.boxes_ego is not None
        camera = next(camera for camera in frame.rig if camera.channel == "CAM_FRONT")
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        corners = frame.boxes_ego.centre_m + 0.45 * signs * CAR_LWH @ frame.boxes_ego.rotation[0].T
        (left, top), (right, bottom) = (f(camera.project_ego(corners)[0], axis=0) for f in (np.min, np.max))
        blue = np.abs(frame.images["CAM_FRONT"].astype(int) - CAR_RGB).max(axis=2) < 40
        rows, columns = np.nonzero(blue)
        middle = round((top + bottom) / 2), round((left + right) / 2)
        assert blue[middle]
        # The patch is as large as the box.
        found = np.array([columns.min(), rows.min(), columns.max(), rows.max()])
        np.testing.assert_allclose(found, [left, top, right, bottom], atol=4)


def test_no_label_zones_of_version_1_lie_on_the_map(converted: dict[str, Dataset]) -> None:
    for sample in converted["v1"].samples(converted["v1"].scenes[0]):
        (outline,) = no_label_zones(converted["v1"], sample)
        np.testing.assert_allclose(outline, (ORIGIN + NO_LABEL_ZONE)[:, :2], atol=1e-6)
    assert contents_of(converted["v1"]).no_label_zones == 3
    assert contents_of(converted["v2"]).no_label_zones == 0


def test_a_damaged_no_label_zone_is_refused(sources: Path, tmp_path: Path) -> None:
    class Cut(Records):
        def frame(self, index: int, name: str = NAME) -> Any:
            frame = super().frame(index, name)
            del frame.no_label_zones[0].x[2:]
            return frame

    Cut().write(tmp_path / "cut", 1)
    with pytest.raises(DataError, match="no-label zone: expected three or more points, got 2 x, 4 y"):
        import_logs(find_logs(tmp_path / "cut", 5.0), tmp_path / "out", "waymo", {})


@pytest.mark.parametrize("layout", LAYOUTS)
def test_boxes_hold_their_points_of_both_returns_and_all_lidars(converted: dict[str, Dataset], layout: str) -> None:
    dataset = converted[layout]
    for sample in dataset.samples(dataset.scenes[0]):
        boxes, lidar = dataset.boxes_world(sample), dataset.data(sample)["LIDAR_TOP"]
        np.testing.assert_allclose(boxes.centre_m, [ORIGIN + CAR], atol=1e-6)
        np.testing.assert_allclose(boxes.size_wlh_m, CAR_LWH[None, [1, 0, 2]])
        assert yaw_of(boxes.rotation[0]) == pytest.approx(CAR_YAW, abs=1e-3)
        points = dataset.lidar(lidar)
        world = apply(dataset.world_from_ego(sample) @ dataset.ego_from_sensor(lidar), points[:, :3])
        counted = int(boxes.inside(world, 0.02).sum())
        assert boxes.lidar_points[0] > 60
        assert 0.95 * boxes.lidar_points[0] <= counted <= 1.05 * boxes.lidar_points[0]
        # All other points are on the ground, on which the vehicle stands.
        ground = world[~boxes.inside(world, 0.2)]
        assert len(ground) > 1000
        assert np.abs(ground[:, 2] - ORIGIN[2]).max() < 0.02
        assert np.abs(apply(inverse(dataset.world_from_ego(sample)), ORIGIN)[2]) < 0.1
        assert set(np.unique(points[:, 4])) <= {-1.0, *range(24)}
        assert points[:, 3].max() == pytest.approx(np.tanh(2.0) * 255, abs=0.1)


def test_both_layouts_become_the_same_data(converted: dict[str, Dataset]) -> None:
    one, other = (converted[layout] for layout in LAYOUTS)
    for first, second in zip(one.samples(one.scenes[0]), other.samples(other.scenes[0]), strict=True):
        assert first.timestamp_us == second.timestamp_us
        for channel, data in one.data(first).items():
            twin = other.data(second)[channel]
            assert data.timestamp_us == twin.timestamp_us
            np.testing.assert_allclose(one.world_from_ego_at(data), other.world_from_ego_at(twin), atol=1e-6)
            if channel == "LIDAR_TOP":
                np.testing.assert_allclose(one.lidar(data), other.lidar(twin), atol=5e-3)
            else:
                assert one.path(data).read_bytes() == other.path(twin).read_bytes()


def test_the_map_of_version_1_has_roads_markings_crossings_and_junctions(converted: dict[str, Dataset]) -> None:
    dataset = converted["v1"]
    scene = dataset.scenes[0]
    assert dataset.location(scene) == f"location_sf-{NAME}"
    assert "Day, sunny" in scene.description
    found = vector_map(dataset, scene)
    assert found is not None
    assert found.markings is not None
    assert len(found.markings) == 2
    assert {kind: len(outlines) for kind, outlines in found.landmarks.items() if outlines} == {
        "crossing": 1,
        "junction": 1,
    }
    mask = mask_window(dataset, scene, ORIGIN[:2] - 60, ORIGIN[:2] + 60)
    assert mask is not None
    road = np.array([[-50, -3], [-50, 4.5], [20, 0], [20, -4.5], [4, -4], [50, 4.5], [-30, 1.2]])
    off = np.array([[-50, 5.5], [20, -5.5], [4, -7], [-30, 0], [-50, -9]])
    assert mask.sample(ORIGIN[:2] + road)[0].all()
    assert not mask.sample(ORIGIN[:2] + off)[0].any()
    assert vector_map(converted["v2"], converted["v2"].scenes[0]) is None
    assert contents_of(converted["v2"]).uses == (
        "ground truth: vehicles (boxes), colours (cameras and LiDAR)",
        "  not: road (needs a map or labelled points), lane markings (needs a vector map or labelled points)",
        "no camera looks: behind",
    )


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_result_is_healthy_and_the_devkit_loads_it(converted: dict[str, Dataset], layout: str) -> None:
    assert list(validate(converted[layout], images=True)) == []
    kit = assert_devkit_loads(converted[layout].root, "v1.0-waymo")
    annotation = kit.sample_annotation[1]
    assert kit.box_velocity(annotation["token"]) == pytest.approx([0, 0, 0], abs=1e-3)
    assert kit.get("attribute", annotation["attribute_tokens"][0])["name"] == "vehicle.stopped"


def test_a_log_can_be_pickled_after_it_was_read(sources: Path) -> None:
    for layout in LAYOUTS:
        (log,) = find_logs(sources / layout, 5.0)
        assert log.frames_in_total == 3
        assert pickle.loads(pickle.dumps(log)).frames_in_total == 3


# Damage ----------------------------------------------------------------------------------------------------------


def refused(src: Path, tmp_path: Path) -> str:
    """The message of a refused conversion, which leaves nothing."""
    result = CliRunner().invoke(app, ["waymo", str(src), str(tmp_path / "out")])
    assert isinstance(result.exception, DataError), result.exception
    assert not (tmp_path / "out").exists()
    assert "\n" not in str(result.exception)
    return str(result.exception)


def _flipped(data: bytes) -> bytes:
    return data[:5000] + bytes([data[5000] ^ 1]) + data[5001:]


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda data: data[:-100], "record 0: expected .* got the end of the file: cut off"),
        (_flipped, r"record 0: damaged \(the checksum of its data is wrong\)"),
        (lambda data: b"PAR1" + data, "expected a TFRecord, got other bytes"),
        (lambda data: framed(b"\x07\x07"), "record 0: expected a frame of Waymo"),
        (lambda data: framed(b"\x10\x05"), "expected a calibrated camera, got none"),
        (lambda data: framed(b"\x10\x05\x0a\xff"), "frame 0: expected a frame of Waymo"),
        (lambda data: b"", "expected at least one frame, got an empty file"),
    ],
)
def test_a_damaged_record_is_one_clear_line(
    sources: Path, tmp_path: Path, damage: Callable[[bytes], bytes], reason: str
) -> None:
    (path,) = (sources / "v1/training").glob("*.tfrecord")
    whole = path.read_bytes()
    size = int.from_bytes(whole[:8], "little") + 16
    copy = tmp_path / path.name
    copy.write_bytes(damage(whole[:size]))
    message = refused(copy, tmp_path)
    assert str(copy) in message
    assert re.search(reason, message)


@pytest.mark.parametrize("component", ["vehicle_pose", "camera_calibration", "lidar_calibration", "lidar_box"])
def test_a_damaged_table_is_one_clear_line(sources: Path, tmp_path: Path, component: str) -> None:
    shutil.copytree(sources / "v2", tmp_path / "v2")
    path = tmp_path / "v2/training" / component / f"{NAME}.parquet"
    path.write_bytes(path.read_bytes()[:300])
    assert f"{path}: expected a parquet file with" in refused(tmp_path / "v2", tmp_path)


def test_a_table_without_a_column_is_one_clear_line(sources: Path, tmp_path: Path) -> None:
    shutil.copytree(sources / "v2", tmp_path / "v2")
    path = tmp_path / "v2/training/lidar_box" / f"{NAME}.parquet"
    pq.write_table(pq.read_table(path).drop_columns("[LiDARBoxComponent].box.heading"), path)
    assert "it lacks [LiDARBoxComponent].box.heading" in refused(tmp_path / "v2", tmp_path)


@pytest.mark.parametrize(
    ("component", "column", "value", "reason"),
    [
        ("vehicle_pose", "[VehiclePoseComponent].world_from_vehicle.transform", [2.0] * 16, "expected a pose"),
        ("camera_image", "[CameraImageComponent].pose_timestamp", -1.0, "expected seconds since 1970, got -1.0"),
        ("lidar_box", "[LiDARBoxComponent].box.size.x", 0.0, "box car: expected finite numbers and a positive size"),
        ("lidar_calibration", "key.laser_name", 4, "expected the calibration of the upper LiDAR (1), got none"),
    ],
)
def test_impossible_values_are_one_clear_line(
    sources: Path, tmp_path: Path, component: str, column: str, value: object, reason: str
) -> None:
    shutil.copytree(sources / "v2", tmp_path / "v2")
    path = tmp_path / "v2/training" / component / f"{NAME}.parquet"
    table = pq.read_table(path)
    place = table.column_names.index(column)
    same = pa.array([value] * len(table), table.schema.field(column).type)
    pq.write_table(table.set_column(place, column, same), path)
    assert reason in refused(tmp_path / "v2", tmp_path)


def test_unknown_speeds_are_no_attribute(sources: Path, tmp_path: Path) -> None:
    shutil.copytree(sources / "v2", tmp_path / "v2")
    path = tmp_path / "v2/training/lidar_box" / f"{NAME}.parquet"
    table = pq.read_table(path)
    place = table.column_names.index("[LiDARBoxComponent].speed.x")
    pq.write_table(table.set_column(place, table.column_names[place], pa.nulls(len(table), pa.float64())), path)
    import_logs(find_logs(tmp_path / "v2", 2.0), tmp_path / "out", "waymo", {})
    assert set(Dataset(tmp_path / "out").tables["sample_annotation"]["attribute_tokens"]) == {()}


def test_missing_components_and_pictures_are_told(sources: Path, tmp_path: Path) -> None:
    shutil.copytree(sources / "v2", tmp_path / "v2")
    for component in ("lidar_pose", "lidar_box", "stats"):
        shutil.rmtree(tmp_path / "v2/training" / component)
    path = tmp_path / "v2/training/camera_image" / f"{NAME}.parquet"
    table = pq.read_table(path)
    pq.write_table(table.filter(table["key.camera_name"].to_numpy() != 4), path)
    summary = import_logs(find_logs(tmp_path / "v2", 2.0), tmp_path / "out", "waymo", {})
    assert summary.missing == {"SIDE_LEFT": 2}
    assert (summary.boxes, summary.sweeps) == (0, 2)
    notes = " ".join(summary.notes)
    assert "no lidar_box: no boxes" in notes
    assert "no lidar_pose: points of the upper LiDAR are not compensated" in notes


def test_a_segment_without_pictures_or_lidar_is_converted(sources: Path, tmp_path: Path) -> None:
    shutil.copytree(sources / "v2", tmp_path / "v2")
    for component in ("camera_image", "lidar", "lidar_calibration"):
        shutil.rmtree(tmp_path / "v2/training" / component)
    summary = import_logs(find_logs(tmp_path / "v2", 2.0), tmp_path / "out", "waymo", {})
    assert (summary.images, summary.sweeps, summary.boxes) == (0, 0, 2)
    assert summary.missing == {"FRONT": 2, "SIDE_LEFT": 2, "SIDE_RIGHT": 2}
    assert "no camera_image: no pictures" in summary.notes


def test_damaged_rows_of_pictures_and_range_images_are_counted(sources: Path, tmp_path: Path) -> None:
    shutil.copytree(sources / "v2", tmp_path / "v2")
    for component, name in (("camera_image", "image"), ("lidar", "return1.values.list.element")):
        path = tmp_path / "v2/training" / component / f"{NAME}.parquet"
        group = pq.ParquetFile(path).metadata.row_group(0)
        columns = map(group.column, range(group.num_columns))
        column = next(column for column in columns if column.path_in_schema.endswith(name))
        start = column.dictionary_page_offset or column.data_page_offset
        data = bytearray(path.read_bytes())
        data[start + 100 : start + 400] = bytes(300)
        path.write_bytes(data)
    summary = import_logs(find_logs(tmp_path / "v2", 2.0), tmp_path / "out", "waymo", {})
    assert summary.missing == {"FRONT": 1, "SIDE_LEFT": 1, "SIDE_RIGHT": 1, "LIDAR_TOP": 1}
    assert "expected a parquet file" in summary.damaged[0]
    assert (summary.images, summary.sweeps) == (3, 1)


def test_a_folder_without_segments_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"expected segments of Waymo: \*\.tfrecord"):
        find_logs(tmp_path, 2.0)


# Formats ---------------------------------------------------------------------------------------------------------


def test_checksums_are_those_of_the_standard() -> None:
    """RFC 3720, B.4; the mask is that of TensorFlow's `masked_crc`."""

    def masked(crc: int) -> int:
        return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF

    known = {bytes(32): 0x8A9136AA, b"\xff" * 32: 0x62A8AB43, bytes(range(32)): 0x46DD794E, b"123456789": 0xE3069283}
    for data, crc in known.items():
        assert crc32c(data) == crc
        assert masked_crc32c(data) == masked(crc)


def test_fields_are_read_packed_or_not_and_unknown_ones_ignored() -> None:
    message = Message(b"\x08\x96\x01\x12\x03\x01\xac\x02\x10\x05\x18" + b"\xff" * 9 + b"\x01\xfa\x3f\x01x")
    assert message.integer(1) == 150
    assert message.integers(2) == [1, 300, 5]
    assert message.integer(3) == -1
    assert message.integer(9, 7) == 7
    with pytest.raises(ValueError, match="cut off"):
        Message(b"\x12\x05abc")
    with pytest.raises(ValueError, match="wire type 7"):
        Message(b"\x0f")
