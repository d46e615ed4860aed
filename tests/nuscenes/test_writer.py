"""What the writer writes, read back as plain JSON and by the reader."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.errors import DataError, ShapeError
from appocc.geometry import quaternion_from_yaw, transform
from appocc.nuscenes import Dataset
from appocc.nuscenes.schema import TABLES
from appocc.nuscenes.writer import ATTRIBUTES, CATEGORIES, Annotation, Writer, pose_fields, token_of, whole_folder

POSE = transform(quaternion_from_yaw(0.5), [1.0, 2.0, 3.0])
INTRINSIC = np.array([[100.0, 0, 50], [0, 100, 30], [0, 0, 1]])


def box(name: str, x: float = 0.0, category: str = "vehicle.car", **more: Any) -> Annotation:
    return Annotation(
        instance=name,
        category=category,
        world_from_box=transform(np.eye(3), [x, 0.0, 0.0]),
        size_wlh_m=(1.8, 4.5, 1.5),
        **more,
    )


def filled(root: Path) -> Writer:
    """Two scenes of three and two samples, added out of order; a camera and a LiDAR with one sweep."""
    writer = Writer(root, "v1.0-test")
    for name, count in (("first", 3), ("second", 2)):
        log, scene = token_of("log", name), token_of("scene", name)
        writer.add("log", log, logfile=name, vehicle="", date_captured="", location="here")
        mounts = [writer.add_sensor(name, "CAM_FRONT", POSE, INTRINSIC), writer.add_sensor(name, "LIDAR_TOP", POSE)]
        samples = [token_of("sample", name, k) for k in range(count)]
        for k in reversed(range(count)):
            time_us = 1_000_000 * k
            writer.add("sample", samples[k], timestamp=time_us, scene_token=scene)
            writer.add_file(
                sample=samples[k],
                channel="CAM_FRONT",
                calibration=mounts[0],
                world_from_ego=POSE,
                timestamp_us=time_us - 10,
                filename=f"samples/{name}{k}.jpg",
                size_px=(100, 60),
            )
            writer.add_file(samples[k], "LIDAR_TOP", mounts[1], POSE, time_us, f"samples/{name}{k}.pcd.bin")
            writer.add_annotation(scene, samples[k], box("car", float(k), attribute="vehicle.moving", lidar_points=k))
            if k == 1:
                writer.add_annotation(scene, samples[k], box("bus", category="vehicle.bus.rigid", visibility="4"))
        sweep = f"sweeps/{name}.pcd.bin"
        writer.add_file(samples[1], "LIDAR_TOP", mounts[1], POSE, 500_000, sweep, is_key_frame=False)
        writer.add_scene(name, "a scene", log, samples)
    return writer


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    filled(folder).save()
    return folder


def rows(root: Path, table: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((root / "v1.0-test" / f"{table}.json").read_text())
    return found


def test_all_thirteen_tables(root: Path) -> None:
    assert sorted(path.stem for path in (root / "v1.0-test").iterdir()) == sorted(TABLES)
    for name, fields in TABLES.items():
        for row in rows(root, name):
            assert {field.name for field in fields if field.required} <= row.keys()
            assert set(row) <= {field.name for field in fields}
        tokens = [row["token"] for row in rows(root, name)]
        assert len(tokens) == len(set(tokens))


def test_references_are_whole(root: Path) -> None:
    tokens = {name: {row["token"] for row in rows(root, name)} for name in TABLES}
    for name, fields in TABLES.items():
        for row in rows(root, name):
            for field in fields:
                if field.refers_to:
                    values = row[field.name] if isinstance(row[field.name], list) else [row[field.name]]
                    if not (field.optional_reference and values == [""]):
                        assert set(values) <= tokens[field.refers_to], (name, field.name)


def test_chains_run_in_order_of_time(root: Path) -> None:
    dataset = Dataset(root)
    first, second = dataset.scenes
    samples = dataset.samples(first)
    assert [s.timestamp_us for s in samples] == [0, 1_000_000, 2_000_000]
    assert [(s.prev, s.next) for s in samples] == [
        ("", samples[1].token),
        (samples[0].token, samples[2].token),
        (samples[1].token, ""),
    ]
    assert (first.first_sample_token, first.last_sample_token) == (samples[0].token, samples[2].token)
    assert len(dataset.samples(second)) == 2
    data = {row["token"]: row for row in rows(root, "sample_data")}
    lidar = dataset.chain(first, "LIDAR_TOP")
    assert [d.timestamp_us for d in lidar] == [0, 500_000, 1_000_000, 2_000_000]
    assert [d.is_key_frame for d in lidar] == [True, False, True, True]
    assert [data[d.token]["prev"] for d in lidar] == ["", *(d.token for d in lidar[:-1])]
    assert [data[d.token]["next"] for d in lidar] == [*(d.token for d in lidar[1:]), ""]


def test_instances_follow_from_annotations(root: Path) -> None:
    annotations = {row["token"]: row for row in rows(root, "sample_annotation")}
    category = {row["token"]: row["name"] for row in rows(root, "category")}
    found = {}
    for row in rows(root, "instance"):
        first, last = annotations[row["first_annotation_token"]], annotations[row["last_annotation_token"]]
        assert first["prev"] == last["next"] == ""
        found[row["token"]] = (category[row["category_token"]], row["nbr_annotations"], last["translation"][0])
    assert sorted(found.values()) == [
        ("vehicle.bus.rigid", 1, 0.0),
        ("vehicle.bus.rigid", 1, 0.0),
        ("vehicle.car", 2, 1.0),
        ("vehicle.car", 3, 2.0),
    ]


def test_annotations(root: Path) -> None:
    dataset = Dataset(root)
    boxes = dataset.boxes_world(dataset.samples(dataset.scenes[0])[1])
    assert boxes.category == ("vehicle.car", "vehicle.bus.rigid")
    assert boxes.size_wlh_m.tolist() == [[1.8, 4.5, 1.5]] * 2
    assert boxes.lidar_points.tolist() == [1, -1]
    bus, car = (
        next(row for row in rows(root, "sample_annotation") if bool(row["attribute_tokens"]) == wanted)
        for wanted in (False, True)
    )
    assert bus["visibility_token"] == "4"
    assert car["visibility_token"] == ""
    assert car["attribute_tokens"] == [token_of("attribute", "vehicle.moving")]
    assert "category" not in car


def test_sensors_and_files(root: Path) -> None:
    dataset = Dataset(root)
    assert {row["channel"]: row["modality"] for row in rows(root, "sensor")} == {
        "CAM_FRONT": "camera",
        "LIDAR_TOP": "lidar",
    }
    assert len(rows(root, "calibrated_sensor")) == 4
    data = dataset.data(dataset.samples(dataset.scenes[1])[0])
    camera = dataset.camera(data["CAM_FRONT"])
    assert (camera.width_px, camera.height_px) == (100, 60)
    np.testing.assert_array_equal(camera.intrinsic, INTRINSIC)
    np.testing.assert_allclose(dataset.world_from_ego_at(data["LIDAR_TOP"]), POSE, atol=1e-12)
    np.testing.assert_allclose(dataset.ego_from_sensor(data["LIDAR_TOP"]), POSE, atol=1e-12)
    assert {row["fileformat"] for row in rows(root, "sample_data")} == {"jpg", "pcd"}


def test_the_fixed_tables(root: Path) -> None:
    assert [(row["index"], row["name"]) for row in rows(root, "category")] == list(enumerate(CATEGORIES))
    assert len(CATEGORIES) == 32
    assert CATEGORIES.index("flat.driveable_surface") == 24  # nuScenes-lidarseg's numbers
    assert CATEGORIES.index("vehicle.ego") == 31
    assert [row["name"] for row in rows(root, "attribute")] == list(ATTRIBUTES)
    assert [row["level"] for row in rows(root, "visibility")] == ["v0-40", "v40-60", "v60-80", "v80-100"]


def test_the_same_bytes_from_the_same_names(root: Path, tmp_path: Path) -> None:
    filled(tmp_path).save()
    for name in TABLES:
        path = Path("v1.0-test") / f"{name}.json"
        assert (tmp_path / path).read_bytes() == (root / path).read_bytes()


def test_additional_tables(tmp_path: Path) -> None:
    writer = Writer(tmp_path, "v1.0-test")
    writer.add_extra("lidarseg", "t", sample_data_token="d", filename="lidarseg/x.bin")
    writer.save()
    assert rows(tmp_path, "lidarseg") == [{"token": "t", "sample_data_token": "d", "filename": "lidarseg/x.bin"}]


def test_tokens() -> None:
    assert token_of("a", 1) == token_of("a", 1) == token_of("a", "1")
    assert token_of("a", 1) != token_of("a", 2)
    assert len(token_of()) == 32


def test_pose_fields() -> None:
    fields = pose_fields(POSE)
    assert fields["translation"] == [1, 2, 3]
    np.testing.assert_allclose(fields["rotation"], quaternion_from_yaw(0.5))


def test_invalid_rows_are_refused(tmp_path: Path) -> None:
    writer = Writer(tmp_path, "v1.0-test")
    with pytest.raises(ShapeError, match="scene x: expected at least one sample, got none"):
        writer.add_scene("x", "", "log", [])
    with pytest.raises(ShapeError, match=r"annotation a: expected a nuScenes category, got 'Car'"):
        writer.add_annotation("scene", "sample", box("a", category="Car"))


def test_tables_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "v1.0-test").write_text("a file")
    with pytest.raises(DataError, match="cannot be written"):
        Writer(tmp_path, "v1.0-test").save()


# Folders that are whole or not there --------------------------------------------------------------------------------


def test_a_folder_appears_when_it_is_complete(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    with whole_folder(out) as folder:
        (folder / "a").write_text("1")
        assert not out.exists()
    assert (out / "a").read_text() == "1"
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert out.stat().st_mode & 0o777 == 0o755


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, DataError])
def test_a_folder_that_fails_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    def fill() -> None:
        with whole_folder(tmp_path / "out") as folder:
            (folder / "a").write_text("1")
            raise error("stop")

    with pytest.raises(error):
        fill()
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"out: cannot be written \(No space left"), whole_folder(tmp_path / "out"):
        raise OSError(28, "No space left on device")
    assert not list(tmp_path.iterdir())


def test_an_empty_folder_may_be_there(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with whole_folder(tmp_path / "out") as folder:
        (folder / "a").touch()
    assert (tmp_path / "out" / "a").exists()


def test_existing_folders_are_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").touch()
    (tmp_path / "file").touch()
    for name in ("folder", "file"):
        with (
            pytest.raises(DataError, match=rf"{name}: exists already; name a new folder"),
            whole_folder(tmp_path / name),
        ):
            pass
    assert (tmp_path / "folder" / "mine").exists()


def test_a_folder_below_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DataError, match="cannot be written"), whole_folder(tmp_path / "file" / "out"):
        pass


def test_tokens_of_names_with_slashes_differ() -> None:
    assert len({token_of("a/b", "c"), token_of("a", "b/c"), token_of("a", "b", "c"), token_of("a%2Fb", "c")}) == 4
