"""The real PandaSet recording, converted: its traps, and the devkit's opinion."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.boxes import is_vehicle
from appocc.geometry import apply, inverse, wrap_angle
from appocc.nuscenes import Dataset
from appocc.nuscenes.lidar import read_labels, read_lidar
from appocc.nuscenes.maps import mask_window
from appocc.nuscenes.point_labels import point_labels
from appocc.nuscenes.writer import Writer
from appocc.pandaset.convert import convert
from appocc.pandaset.pickles import read_pickles
from appocc.pandaset.plain import read_plain
from appocc.pandaset.recording import CHANNELS

pytestmark = pytest.mark.realdata
LOWERED_M = 0.40


@pytest.fixture(scope="module")
def frames(data_root: Path) -> list[dict[str, Any]]:
    """Its key frames as the plain file has them."""
    every: list[dict[str, Any]] = json.loads((data_root / "pandaset_002" / "frames.json").read_text())["frames"]
    return [frame for frame in every if frame["has_images"]]


def test_real_counts(panda_root: Path) -> None:
    dataset = Dataset(panda_root)
    samples = dataset.samples(dataset.scenes[0])
    assert len(samples) == 40
    assert [2 * i for i, s in enumerate(samples) if "LIDAR_TOP" not in dataset.data(s)] == [56, 58]
    assert all(len(dataset.data(s)) in (6, 7) for s in samples)
    counts = [len(dataset.boxes_world(s)) for s in samples]
    assert 91 <= min(counts) <= max(counts) <= 99
    names = {name for s in samples for name in dataset.boxes_world(s).category}
    assert "vehicle.motorcycle" in names
    assert "vehicle.bicycle" not in names  # every Bicycle box is the copy of a Motorcycle box


def test_real_camera_poses_are_exact_in_all_images(panda_root: Path, frames: list[dict[str, Any]]) -> None:
    dataset = Dataset(panda_root)
    worst = 0.0
    for sample, frame in zip(dataset.samples(dataset.scenes[0]), frames, strict=True):
        for name, camera in frame["cameras"].items():
            data = dataset.data(sample)[CHANNELS[name]]
            assert data.timestamp_us == round(camera["t"] * 1e6)
            pose = dataset.world_from_ego_at(data) @ dataset.ego_from_sensor(data)
            worst = max(worst, float(np.abs(pose - np.array(camera["T_world_cam"])).max()))
    assert worst < 1e-3


def test_real_images_are_the_originals(panda_root: Path, data_root: Path, frames: list[dict[str, Any]]) -> None:
    dataset = Dataset(panda_root)
    sample, frame = dataset.samples(dataset.scenes[0])[17], frames[17]
    for name, camera in frame["cameras"].items():
        copy = dataset.path(dataset.data(sample)[CHANNELS[name]])
        assert copy.read_bytes() == (data_root / "pandaset_002" / camera["file"]).read_bytes()


def test_real_ego_poses(panda_root: Path, frames: list[dict[str, Any]]) -> None:
    """0.40 m below PandaSet's, level; where there is no LiDAR, between the poses of the images."""
    dataset = Dataset(panda_root)
    for sample, frame in zip(dataset.samples(dataset.scenes[0]), frames, strict=True):
        expected = np.array(frame["T_world_ego"])
        expected[:3, 3] -= LOWERED_M * expected[:3, 2]
        exact = "LIDAR_TOP" in dataset.data(sample)
        difference = np.abs(dataset.world_from_ego(sample) - expected)
        assert difference[:3, 3].max() < (0.05 if exact else 0.1)
        assert 0.03 < difference[:3, :3].max() < 0.05  # its LiDAR leans to one side by 2 degrees


def test_real_vehicles_stand_on_level_ground(panda_root: Path) -> None:
    dataset = Dataset(panda_root)
    bottoms = []
    for sample in dataset.samples(dataset.scenes[0])[::4]:
        boxes = dataset.frame(sample, images=False).boxes_ego
        assert boxes is not None
        keep = [is_vehicle(name) for name in boxes.category] & (np.hypot(*boxes.centre_m[:, :2].T) < 30)
        bottoms.append(boxes.centre_m[keep] - np.outer(boxes.size_wlh_m[keep, 2] / 2, [0, 0, 1]))
    x, y, z = np.concatenate(bottoms).T
    assert np.abs(np.polyfit(x, z, 1)[0]) < np.radians(0.5)
    assert np.abs(np.polyfit(y, z, 1)[0]) < np.radians(0.3)
    assert abs(np.median(z)) < 0.1


def test_real_road_is_at_the_height_of_the_ego(panda_root: Path) -> None:
    dataset = Dataset(panda_root)
    for sample in dataset.samples(dataset.scenes[0])[::13]:
        data = dataset.data(sample)["LIDAR_TOP"]
        labels = point_labels(dataset, data)
        assert labels is not None
        raw = read_lidar(dataset.path(data))[:, :3]
        ego = apply(dataset.ego_from_sensor(data), raw)
        road = labels.is_road[read_labels(labels.path, len(raw))] & (np.linalg.norm(ego[:, :2], axis=1) < 12)
        assert abs(np.median(ego[road, 2])) < 0.25  # the road is crowned: its middle is above the plane


def test_real_points_of_cars_lie_in_boxes_of_cars(panda_root: Path) -> None:
    """Poses, sizes and headings all have to be right for that."""
    dataset = Dataset(panda_root)
    category = {name: label for label, name in dataset.label_names("lidarseg").items()}
    for sample in dataset.samples(dataset.scenes[0])[::13]:
        data = dataset.data(sample)["LIDAR_TOP"]
        path = dataset.label_path(data, "lidarseg")
        assert path is not None
        raw = read_lidar(dataset.path(data))[:, :3]
        world = apply(dataset.world_from_ego_at(data) @ dataset.ego_from_sensor(data), raw)
        cars = read_labels(path, len(raw)) == category["vehicle.car"]
        boxes = dataset.boxes_world(sample)
        only_cars = boxes.select(np.array([name == "vehicle.car" for name in boxes.category]))
        assert only_cars.inside(world[cars]).mean() > 0.97
        counted = [int(boxes.select(np.array([i])).inside(world).sum()) for i in (0, 5, 9)]
        assert boxes.lidar_points[[0, 5, 9]].tolist() == counted


def test_real_moving_cars_drive_where_they_point(panda_root: Path) -> None:
    dataset = Dataset(panda_root)
    angles = []
    for sample in dataset.samples(dataset.scenes[0]):
        boxes = dataset.boxes_world(sample)
        speed = np.linalg.norm(boxes.velocity_mps, axis=1)
        moving = np.flatnonzero((speed > 3) & np.array([name == "vehicle.car" for name in boxes.category]))
        way = np.arctan2(boxes.velocity_mps[moving, 1], boxes.velocity_mps[moving, 0])
        angles += np.abs(wrap_angle(way - boxes.yaw_rad[moving])).tolist()
    assert len(angles) > 100
    assert np.quantile(angles, 0.98) < 0.35


def test_real_mask_is_the_road_raster(panda_root: Path, data_root: Path) -> None:
    dataset = Dataset(panda_root)
    with np.load(data_root / "pandaset_002" / "road_world.npz") as data:
        label, x0, y0 = data["label"], float(data["x0"]), float(data["y0"])
    window = mask_window(dataset, dataset.scenes[0], np.array([-200.0, -200.0]), np.array([200.0, 200.0]))
    assert window is not None
    rows, columns = np.random.default_rng(1).integers(0, 700, (2, 20_000))
    places = np.column_stack([x0 + 0.2 * (columns + 0.5), y0 + 0.2 * (rows + 0.5)])
    drivable, known = window.sample(places)
    np.testing.assert_array_equal(known, label[rows, columns] != 0)
    np.testing.assert_array_equal(drivable, label[rows, columns] == 1)
    egos = np.stack([dataset.world_from_ego(s)[:2, 3] for s in dataset.samples(dataset.scenes[0])])
    assert window.sample(egos)[0].mean() > 0.9


def test_real_plain_and_pickled_forms_give_the_same(data_root: Path, tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    source, lidar = data_root / "pandaset_002", data_root / "pandaset_002_lidar"
    roots = []
    for name, recording in (("plain", read_plain(source, lidar)), ("pickled", read_pickles(source / "002", lidar))):
        both = tuple(frame for frame in recording.frames if frame.index in (0, 20, 40, 60, 78))
        writer = Writer(tmp_path / name, "v1.0-pandaset")
        convert(replace(recording, frames=both, road=None, source=""), writer, lambda _: None)
        writer.save()
        roots.append(tmp_path / name)
    _same_tables(roots[0] / "v1.0-pandaset", roots[1] / "v1.0-pandaset", atol=2e-5)
    for kind in ("lidarseg", "pointlabels", "samples/CAM_LEFT"):
        for path in (path for path in (roots[0] / kind).rglob("*") if path.is_file()):
            assert path.read_bytes() == (roots[1] / path.relative_to(roots[0])).read_bytes()
    sweeps = sorted((roots[0] / "samples" / "LIDAR_TOP").iterdir())
    assert len(sweeps) == 5
    for path in sweeps:
        difference = np.abs(read_lidar(path) - read_lidar(roots[1] / path.relative_to(roots[0])))
        assert difference.max() < 0.0051  # centimetres


def _same_tables(first: Path, second: Path, atol: float) -> None:
    """Tables that are the same but for the rounding of numbers, and of the points counted in boxes."""
    names = sorted(path.name for path in first.iterdir())
    assert names == sorted(path.name for path in second.iterdir())
    for name in names:
        one, other = (json.loads((folder / name).read_text()) for folder in (first, second))
        assert len(one) == len(other)
        for a, b in zip(*(sorted(rows, key=lambda row: str(row["token"])) for rows in (one, other)), strict=True):
            assert a.keys() == b.keys()
            for key in a:
                where = f"{name} {a['token']} {key}"
                if key == "num_lidar_pts":
                    assert abs(a[key] - b[key]) <= max(3, 0.02 * a[key]), where
                elif isinstance(a[key], list) and a[key] and not isinstance(a[key][0], str):
                    np.testing.assert_allclose(a[key], b[key], atol=atol, err_msg=where)
                else:
                    assert a[key] == b[key], where


def test_the_devkit_reads_what_was_written(panda_root: Path) -> None:
    devkit = pytest.importorskip("nuscenes.nuscenes")
    nusc = devkit.NuScenes("v1.0-pandaset", str(panda_root), verbose=False)
    dataset = Dataset(panda_root)
    assert [scene["name"] for scene in nusc.scene] == ["002"]
    assert len(nusc.lidarseg) == 38
    for sample in dataset.samples(dataset.scenes[0])[::10]:
        record = nusc.get("sample", sample.token)
        assert set(record["data"]) == set(dataset.data(sample))
        boxes = dataset.boxes_world(sample)
        for channel, data in dataset.data(sample).items():
            path, theirs, intrinsic = nusc.get_sample_data(data.token, use_flat_vehicle_coordinates=False)
            assert Path(path) == dataset.path(data)
            sensor_from_world = inverse(dataset.world_from_ego_at(data) @ dataset.ego_from_sensor(data))
            if channel == "LIDAR_TOP":
                ours = boxes.transformed(sensor_from_world)
                places = {box.token: box for box in theirs}
                assert set(places) == set(boxes.token)
                for i, token in enumerate(ours.token):
                    np.testing.assert_allclose(places[token].center, ours.centre_m[i], atol=1e-6)
                    np.testing.assert_allclose(places[token].wlh, ours.size_wlh_m[i])
                    np.testing.assert_allclose(places[token].rotation_matrix, ours.rotation[i], atol=1e-6)
                    assert places[token].name == ours.category[i]
                    np.testing.assert_allclose(
                        places[token].corners().T, ours.corners()[i][[4, 7, 3, 0, 5, 6, 2, 1]], atol=1e-5
                    )
                labels = panda_root / nusc.get("lidarseg", data.token)["filename"]
                assert labels == dataset.label_path(data, "lidarseg")
                assert len(devkit.load_bin_file(str(labels))) == len(read_lidar(Path(path)))
            else:
                np.testing.assert_allclose(intrinsic, dataset.camera(data).intrinsic)
    assert nusc.lidarseg_idx2name_mapping == dataset.label_names("lidarseg")
    mask = nusc.map[0]["mask"].mask(dilation=0.0)
    assert mask.shape == (1400, 1400)
