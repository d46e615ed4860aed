from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from argoverse_twin import CAR, LOG, ORIGIN, write_log
from import_checks import assert_balls_in_place, assert_devkit_loads
from typer.testing import CliRunner

from appocc.errors import DataError
from appocc.geometry import apply, inverse
from appocc.importers import import_logs
from appocc.importers.argoverse import find_logs
from appocc.nuscenes import Dataset
from appocc.nuscenes.maps import mask_window, vector_map
from appocc.nuscenes.validate import validate
from cli.convert import app


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("av2") / "sensor/val")


@pytest.fixture(scope="module")
def converted(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    out = tmp_path_factory.mktemp("out") / "av2"
    summary = import_logs(find_logs(source.parents[2], 5.0), out, "argoverse", {})
    assert (summary.samples, summary.images, summary.sweeps, summary.boxes) == (3, 6, 3, 3)
    assert summary.notes == ["left out, without a class in nuScenes: boxes of STOP_SIGN"]
    return Dataset(out)


def test_pictures_are_rectified_and_in_place(converted: Dataset) -> None:
    assert_balls_in_place(converted, ORIGIN, 6)
    assert {c.channel for c in converted.frame(converted.samples(converted.scenes[0])[0]).rig} == {
        "CAM_FRONT",
        "CAM_BACK_LEFT",
    }


def test_boxes_stand_on_the_ground_with_their_points(converted: Dataset) -> None:
    for sample in converted.samples(converted.scenes[0]):
        boxes, lidar = converted.boxes_world(sample), converted.data(sample)["LIDAR_TOP"]
        np.testing.assert_allclose(boxes.centre_m, [ORIGIN + np.array([CAR[0], CAR[1], 0.8])], atol=1e-6)
        world_from_lidar = converted.world_from_ego(sample) @ converted.ego_from_sensor(lidar)
        points = apply(world_from_lidar, converted.lidar(lidar)[:, :3].astype(np.float64))
        assert boxes.inside(points, 0.02).sum() == boxes.lidar_points[0] == 30
        ground = apply(inverse(converted.world_from_ego(sample)), ORIGIN[None])
        assert abs(ground[0, 2]) < 1e-6


def test_the_map_has_roads_markings_crossings_and_one_junction(converted: Dataset) -> None:
    scene = converted.scenes[0]
    found = vector_map(converted, scene)
    assert found is not None
    assert found.drivable is not None
    assert found.markings is not None
    assert len(found.drivable) == len(found.markings) == 1
    assert len(found.landmarks["crossing"]) == 1
    (junction,) = found.landmarks["junction"]
    np.testing.assert_allclose(
        [junction.min(axis=0), junction.max(axis=0)] - ORIGIN[:2], [[50, -4], [60, 4]], atol=0.2
    )
    mask = mask_window(converted, scene, ORIGIN[:2] - 30, ORIGIN[:2] + 30)
    assert mask is not None
    drivable, known = mask.sample(ORIGIN[:2] + np.array([[0, 0], [0, 5.8], [0, 6.3], [20, -5.8]]))
    assert drivable.tolist() == [True, True, False, True]
    assert known.all()


def test_the_result_is_healthy_and_the_devkit_loads_it(converted: Dataset) -> None:
    assert list(validate(converted, images=True)) == []
    kit = assert_devkit_loads(converted.root, "v1.0-argoverse")
    assert kit.box_velocity(kit.sample_annotation[0]["token"]) == pytest.approx([0, 0, 0], abs=1e-3)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        ("calibration/intrinsics.feather", "intrinsics.feather: "),
        ("calibration/egovehicle_SE3_sensor.feather", "egovehicle_SE3_sensor.feather: "),
        ("annotations.feather", "annotations.feather: expected a feather file"),
        ("city_SE3_egovehicle.feather", "city_SE3_egovehicle.feather: expected a feather file"),
    ],
)
def test_a_damaged_table_is_one_clear_line(tmp_path: Path, damage: str, reason: str) -> None:
    folder = write_log(tmp_path / "val")
    (folder / damage).write_bytes((folder / damage).read_bytes()[:200])
    result = CliRunner().invoke(app, ["argoverse", str(tmp_path), str(tmp_path / "out")])
    assert isinstance(result.exception, DataError)
    assert reason in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_a_damaged_picture_and_sweep_are_counted(tmp_path: Path) -> None:
    folder = write_log(tmp_path / "val")
    for path in (*folder.glob("sensors/cameras/ring_front_center/*.jpg"), *folder.glob("sensors/lidar/*")):
        path.write_bytes(path.read_bytes()[:100])
    summary = import_logs(find_logs(folder, 2.0), tmp_path / "out", "argoverse", {})
    assert summary.missing == {"ring_front_center": 2, "LIDAR_TOP": 2}
    assert summary.damaged


def test_a_folder_without_logs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"expected logs of Argoverse 2 with city_SE3_egovehicle\.feather, got none"):
        find_logs(tmp_path, 2.0)


@pytest.mark.realdata
def test_a_real_log(data_root: Path, tmp_path: Path) -> None:
    """A log without pictures: all points lie in their boxes, vehicles on the road, and the ground is level."""
    summary = import_logs(find_logs(data_root / "av2_log", 10.0), tmp_path / "out", "argoverse", {})
    assert (summary.samples, summary.sweeps) == (2, 2)
    dataset = Dataset(tmp_path / "out")
    assert not [problem for problem in validate(dataset) if problem.severity == "error"]
    assert_devkit_loads(dataset.root, "v1.0-argoverse")
    inside = on_road = vehicles = 0
    for sample in dataset.samples(dataset.scenes[0]):
        boxes, lidar = dataset.boxes_world(sample), dataset.data(sample)["LIDAR_TOP"]
        world_from_lidar = dataset.world_from_ego(sample) @ dataset.ego_from_sensor(lidar)
        points = apply(world_from_lidar, dataset.lidar(lidar)[:, :3].astype(np.float64))
        counts = [int(boxes.select(np.array([i])).inside(points).sum()) for i in range(len(boxes))]
        inside += int(np.minimum(counts, boxes.lidar_points).sum())
        assert inside >= 0.95 * boxes.lidar_points.sum()
        here = dataset.world_from_ego(sample)[:2, 3]
        mask = mask_window(dataset, dataset.scenes[0], here - 60, here + 60)
        assert mask is not None
        near = boxes.vehicles().centre_m[:, :2]
        near = near[np.hypot(*(near - here).T) < 56]
        on_road += int(mask.sample(near)[0].sum())
        vehicles += len(near)
    assert on_road >= 0.9 * vehicles
    assert LOG not in str(dataset.root)
