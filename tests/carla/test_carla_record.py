from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_carla import AXLE, EGO_SPEED, HALF_ROAD, LANE, FakeCarla, World
from import_checks import assert_devkit_loads
from in_process import run_command

from appocc.bevmap import LANE as LANE_LAYER
from appocc.bevmap import ROAD, VEHICLE, BEVMap, load_map
from appocc.carla import DriveSettings, record_drives, truth
from appocc.carla.boxes import category_of
from appocc.errors import AppoccError, DataError
from appocc.geometry import apply, inverse
from appocc.importers import Summary
from appocc.nuscenes import Dataset
from appocc.nuscenes.maps import vector_map
from appocc.nuscenes.validate import validate
from appocc.nuscenes.view_targets import ViewClass, load_view_targets, view_targets_path
from appocc.rigs import read_source_rig

RIG = """cameras:
  CAM_FRONT: {size_px: [120, 60], fov_deg: 90, position_m: [1.7, 0.0, 1.5], yaw_deg: 0, centre_px: [59.5, 20.5]}
  CAM_FRONT_LEFT: {size_px: [120, 60], fov_deg: 90, position_m: [1.5, 0.4, 1.5], yaw_deg: 55}
"""
SETTINGS = DriveSettings(scenes=1, frames=2, hz=2.0, vehicles=2, walkers=1, seed=2)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.yaml"
    path.write_text(RIG)
    return path


@pytest.fixture(autouse=True, scope="module")
def coarse_picture_from_above() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(truth, "_PIXELS", 360)
        yield


@pytest.fixture
def carla(monkeypatch: pytest.MonkeyPatch) -> FakeCarla:
    fake = FakeCarla()
    monkeypatch.setitem(sys.modules, "carla", fake)
    return fake


def recorded(out: Path, rig: Path, settings: DriveSettings = SETTINGS) -> Summary:
    return record_drives(out, "127.0.0.1", 2000, None, read_source_rig(rig), settings)


@pytest.fixture(scope="module")
def drive(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "carla", FakeCarla())
        out = tmp_path_factory.mktemp("carla") / "out"
        summary = recorded(out, rig)
    assert (summary.samples, summary.images, summary.sweeps) == (2, 4, 2)
    assert not summary.missing
    return Dataset(out)


def maps(dataset: Dataset) -> list[tuple[Any, BEVMap]]:
    samples = dataset.samples(dataset.scenes[0])
    return [(sample, load_map(dataset.root, "exact", sample.token)) for sample in samples]


def test_the_ego_frame_is_below_the_rear_axle(drive: Dataset) -> None:
    poses = [drive.world_from_ego(sample) for sample in drive.samples(drive.scenes[0])]
    assert [pose[1, 3] for pose in poses] == pytest.approx([-LANE / 2] * 2)  # on the right of the road
    assert [pose[2, 3] for pose in poses] == pytest.approx([0, 0])
    assert poses[1][0, 3] - poses[0][0, 3] == pytest.approx(2.5)
    ticks = 1 + 60 + 10  # people come down, vehicles drive off, and half a second passes
    assert poses[0][0, 3] == pytest.approx(EGO_SPEED * ticks * 0.05 + AXLE)


def test_boxes_are_where_pictures_and_points_show_them(drive: Dataset) -> None:
    paints = {row["instance_token"]: row["rgb"] for row in drive_rows(drive, "paint")}
    shown = 0
    for sample in drive.samples(drive.scenes[0]):
        frame, boxes = drive.frame(sample), drive.boxes_world(sample)
        lidar = drive.data(sample)["LIDAR_TOP"]
        points = apply(
            drive.world_from_ego(sample) @ drive.ego_from_sensor(lidar), drive.lidar(lidar)[:, :3].astype(np.float64)
        )
        assert abs(points[:, 2].min()) < 0.01
        assert boxes.inside(points, 0.02).sum() == boxes.lidar_points.sum()
        assert boxes.lidar_points.max() > 5
        centres = apply(inverse(frame.world_from_ego), boxes.centre_m)
        for camera in frame.rig:
            uv, depth = camera.project_ego(centres)
            for (u, v), ahead, token in zip(uv, depth, boxes.instance, strict=True):
                if token in paints and 5 < ahead < 28 and 8 < u < 112 and 4 < v < 56:
                    seen = frame.images[camera.channel][round(v), round(u)].astype(int)
                    assert np.abs(seen - paints[token]).max() < 60
                    shown += 1
    assert shown


def drive_rows(dataset: Dataset, table: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads((dataset.root / "v1.0-carla" / f"{table}.json").read_text())
    return rows


def test_the_exact_map_holds_road_lines_vehicles_and_colours(drive: Dataset) -> None:
    for sample, bev in maps(drive):
        pose = drive.world_from_ego(sample)
        world = bev.grid.centres() + pose[:2, 3]
        y = -world[..., 1]  # to the right, as CARLA counts
        inner = np.abs(y - 1.25) < 1.25 + LANE - 0.3
        assert bev.occupancy[ROAD][inner].all()
        assert not bev.occupancy[ROAD][(y > HALF_ROAD + 0.4) | (y < -LANE - 0.4)].any()
        lines = bev.occupancy[LANE_LAYER].any(axis=0)
        assert lines.sum() in range(3, 7)  # the middle, and the edges of the two lanes: a cell or two each
        assert (bev.occupancy[LANE_LAYER].all(axis=0) == lines).all()
        boxes = drive.boxes_world(sample)
        for centre, category in zip(boxes.centre_m, boxes.category, strict=True):
            i, j = bev.grid.cell_of((centre - pose[:3, 3])[:2])
            if category.startswith("vehicle.") and bev.grid.contains([i, j]):
                assert bev.occupancy[VEHICLE][i, j]
        assert bev.is_truth
        # Far from vehicles the road is grey, and green beside it; below the ego vehicle nothing is known.
        assert np.abs(bev.appearance[:, 20, 100].astype(int) - [80, 80, 84]).max() <= 2
        assert np.abs(bev.appearance[:, 20, 170].astype(int) - [60, 120, 50]).max() <= 2
        assert not bev.appearance_valid[100, 100]


def test_instances_paints_and_visibility(drive: Dataset) -> None:
    rows = drive_rows(drive, "paint")
    assert {tuple(row["rgb"]) for row in rows} <= {(200, 20, 30), (20, 60, 200)}
    assert {row["name"] for row in rows} <= {"red", "blue"}
    sample, bev = maps(drive)[0]
    with np.load(drive.root / "bev/exact" / f"{sample.token}.npz") as arrays:
        instance = arrays["instance"]
    assert ((instance >= 0) == (bev.occupancy[VEHICLE] > 0)).all()
    tokens = bev.meta["instances"]
    assert {row["instance_token"] for row in rows} & {tokens[i] for i in np.unique(instance[instance >= 0])}
    annotations = drive_rows(drive, "sample_annotation")
    near, behind_it = (
        {row["visibility_token"] for row in annotations if row["translation"][0] == x} for x in (40, 55)
    )
    assert (near, behind_it) == ({"4"}, {"1"})
    names = {row["attribute_tokens"] == [] for row in annotations}
    assert names == {True, False}  # people have no attribute


def test_depth_and_classes_of_the_cameras(drive: Dataset) -> None:
    sample = drive.samples(drive.scenes[0])[0]
    views = load_view_targets(view_targets_path(drive.root, sample.token))
    assert set(views) == {"CAM_FRONT", "CAM_FRONT_LEFT"}
    front = views["CAM_FRONT"]
    assert front.depth_m is not None
    assert front.kind.shape == (8, 15)
    assert front.kind[0, 2] == ViewClass.SKY
    assert np.isinf(front.depth_m[0, 2])
    assert front.kind[7, 7] == ViewClass.ROAD
    # The lowest rows of blocks: rows 56 to 59, below the axis by 36 to 39 px at a focal length of 60 px, from 1.5 m.
    assert float(front.depth_m[7, 7]) == pytest.approx(1.5 * 60 / 37, abs=0.1)


def test_the_roads_become_a_vector_map(drive: Dataset) -> None:
    found = vector_map(drive, drive.scenes[0])
    assert found is not None
    assert found.drivable is not None
    assert found.markings is not None
    assert len(found.drivable) == 3
    assert len(found.landmarks["crossing"]) == 1
    across = sorted(round(float(line[0, 1]), 2) for line in found.markings)
    assert across == [-LANE, 0.0, LANE]


def test_the_dataset_is_healthy_and_the_devkit_loads_it(drive: Dataset) -> None:
    assert list(validate(drive, images=True)) == []
    assert_devkit_loads(drive.root, "v1.0-carla")


def left_as_found(carla: FakeCarla) -> bool:
    world = carla.world
    return not world.actors and not world.settings.synchronous_mode and not carla.traffic.synchronous


def test_an_interrupted_recording_leaves_nothing_and_is_resumed(carla: FakeCarla, rig: Path, tmp_path: Path) -> None:
    settings = DriveSettings(scenes=2, frames=1, hz=2.0, vehicles=0, walkers=0, seed=1)
    ticks = 0

    def interrupted() -> int:
        nonlocal ticks
        ticks += 1
        if ticks == 120:  # a drive takes 71
            raise KeyboardInterrupt
        return World.tick(carla.world)

    carla.world.tick = interrupted  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        recorded(tmp_path / "out", rig, settings)
    assert left_as_found(carla)
    assert not (tmp_path / "out").exists()
    before = ticks
    assert recorded(tmp_path / "out", rig, settings).samples == 2
    assert ticks - before < 100  # the first drive was kept
    assert left_as_found(carla)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_lost_server_is_one_clear_line(
    carla: FakeCarla, rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    carla.world.fail_at = 30
    with pytest.raises(DataError, match=r"127\.0\.0\.1:2000: expected a CARLA server, got an error \(time-out"):
        recorded(tmp_path / "out", rig)
    assert left_as_found(carla)
    carla.reachable = False
    done = run_command(["record", "carla", str(tmp_path / "out"), "--rig", str(rig)], capsys, monkeypatch)
    assert done.returncode == 2
    assert done.stderr.startswith("error: 127.0.0.1:2000: expected a CARLA server, got an error")
    assert not list(tmp_path.iterdir())


def test_rigs_that_carla_has_not_are_refused(carla: FakeCarla, rig: Path, tmp_path: Path) -> None:
    flat = tmp_path / "flat.yaml"
    flat.write_text(RIG.replace("fov_deg: 90", "fov_deg: 90, distortion: [-0.1, 0.0, 0.0, 0.0]"))
    with pytest.raises(DataError, match="expected a rig of pinholes"):
        recorded(tmp_path / "out", flat)
    flat.write_text(RIG.replace("fov_deg: 90", "focal_px: [60, 70]"))
    with pytest.raises(DataError, match="expected square pixels"):
        recorded(tmp_path / "out", flat)


def test_without_the_package_the_extra_is_named(rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "carla", None)
    with pytest.raises(AppoccError, match=r"recording from CARLA needs carla: pip install '\.\[carla\]'"):
        recorded(tmp_path / "out", rig)


@pytest.mark.parametrize(
    ("kind", "attributes", "category"),
    [
        ("vehicle.tesla.model3", {"base_type": "car"}, "vehicle.car"),
        ("vehicle.mitsubishi.fusorosa", {"base_type": "bus"}, "vehicle.bus.rigid"),
        ("vehicle.dodge.charger_police", {"base_type": "car"}, "vehicle.emergency.police"),
        ("vehicle.yamaha.yzf", {"number_of_wheels": "2"}, "vehicle.motorcycle"),
        ("vehicle.bh.crossbike", {"number_of_wheels": "2"}, "vehicle.bicycle"),
        ("walker.pedestrian.0009", {"age": "child"}, "human.pedestrian.child"),
    ],
)
def test_categories(kind: str, attributes: dict[str, str], category: str) -> None:
    assert category_of(kind, attributes) == category
