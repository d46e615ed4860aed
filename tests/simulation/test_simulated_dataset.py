"""Consistency of a dataset of `appocc simulate`, read through the loader."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap, bev_path, load_map
from appocc.files import zip_arrays
from appocc.geometry import apply, inverse
from appocc.nuscenes import Dataset
from appocc.nuscenes.point_labels import point_labels
from appocc.nuscenes.records import Sample
from appocc.nuscenes.validate import validate
from appocc.nuscenes.view_targets import load_view_targets
from appocc.simulation.builtin import TEST_TOWNS, TRAIN_TOWNS


@pytest.fixture(scope="module")
def dataset(simulated_root: Path) -> Dataset:
    return Dataset(simulated_root)


@pytest.fixture(scope="module")
def samples(dataset: Dataset) -> list[Sample]:
    return [dataset.samples(scene)[0] for scene in dataset.scenes]


def test_all_eight_towns_are_present_and_valid(dataset: Dataset) -> None:
    assert {dataset.location(scene) for scene in dataset.scenes} == {*TRAIN_TOWNS, *TEST_TOWNS}
    assert len(TRAIN_TOWNS) == 6
    assert len(TEST_TOWNS) == 2
    assert not validate(dataset, images=True)


def test_the_devkit_reads_it(dataset: Dataset) -> None:
    nuscenes = pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    kit = nuscenes.NuScenes("v1.0-simulation", str(dataset.root), verbose=False)
    assert len(kit.scene) == 8
    sample = kit.get("sample", kit.scene[0]["first_sample_token"])
    path, boxes, intrinsic = kit.get_sample_data(sample["data"]["CAM_FRONT"])
    assert Path(path).is_file()
    assert intrinsic.shape == (3, 3)
    assert all(box.center[2] > 0 for box in boxes), "what the devkit says is in the picture is in front of it"


def test_frames_come_at_a_fixed_rate_and_the_ego_moves(dataset: Dataset) -> None:
    moved = []
    for scene in dataset.scenes:
        found = dataset.samples(scene)
        assert np.diff([sample.timestamp_us for sample in found]).tolist() == [500_000] * 3
        places = np.stack([dataset.world_from_ego(sample)[:2, 3] for sample in found])
        moved.append(np.linalg.norm(places[-1] - places[0]))
    assert np.median(moved) > 4
    assert min(moved) > 0.1


def test_boxes_of_vehicles_are_the_vehicle_layer(dataset: Dataset, samples: list[Sample]) -> None:
    for sample in samples:
        bev = load_map(dataset.root, "exact", sample.token)
        boxes = dataset.frame(sample).boxes_ego
        assert boxes is not None
        vehicles = boxes.vehicles()
        centres = np.pad(bev.grid.centres(), ((0, 0), (0, 0), (0, 1)))
        inside = np.zeros(bev.grid.shape, bool)
        for i in range(len(vehicles)):
            local = apply(inverse(vehicles.frame_from_box(i)), centres)[..., :2]
            inside |= (np.abs(local) <= vehicles.size_wlh_m[i, [1, 0]] / 2).all(axis=-1)
        layer = bev.occupancy[VEHICLE] > 0.5
        union = (inside | layer).sum()
        assert union == 0 or (inside & layer).sum() / union > 0.85
    assert sum(load_map(dataset.root, "exact", s.token).occupancy[VEHICLE].sum() for s in samples) > 500


def test_instances_of_cells_are_annotated_objects(dataset: Dataset, samples: list[Sample]) -> None:
    sample = max(samples, key=lambda s: load_map(dataset.root, "exact", s.token).occupancy[VEHICLE].sum())
    path = bev_path(dataset.root, "exact", sample.token)
    bev = BEVMap.load(path)
    with zip_arrays(path.read_bytes()) as data:
        instance, covered = data["instance"], data["appearance_covered"]
    assert covered.shape == bev.appearance.shape
    np.testing.assert_array_equal(instance >= 0, bev.occupancy[VEHICLE] > 0.5)
    boxes = dataset.frame(sample).boxes_ego
    assert boxes is not None
    names = bev.meta["instances"]
    for number in np.unique(instance[instance >= 0]):
        row = boxes.instance.index(names[number])
        middle = bev.grid.centres()[instance == number].mean(axis=0)
        away = np.linalg.norm(middle - boxes.centre_m[row, :2])
        assert away < 0.5 or np.abs(middle).max() > 34, "cut off by the grid's edge"


def test_every_object_has_its_true_paint(dataset: Dataset) -> None:
    paints = dataset.tables["paint"]
    assert sorted(paints.array("instance_token").tolist()) == sorted(
        dataset.tables["instance"].array("token").tolist()
    )
    assert {"white", "black", "grey"} <= set(paints["name"])


def test_vehicles_show_their_paint_from_above(dataset: Dataset, samples: list[Sample]) -> None:
    """By day the roof of a white car is lighter than that of a black one."""
    paints = dataset.tables["paint"]
    tokens = [token.decode() for token in paints.array("instance_token")]
    brightness = dict(zip(tokens, np.asarray(paints["rgb"]).mean(axis=1), strict=True))
    shown, true = [], []
    for sample in samples:
        path = bev_path(dataset.root, "exact", sample.token)
        bev = BEVMap.load(path)
        if bev.meta["weather"] not in ("clear", "overcast"):
            continue
        with zip_arrays(path.read_bytes()) as data:
            instance = data["instance"]
        for number in np.unique(instance[instance >= 0]):
            cells = instance == number
            if cells.sum() > 20:
                shown.append(float(np.median(bev.appearance[:, cells].mean(axis=0))))
                true.append(float(brightness[bev.meta["instances"][number]]))
    assert len(true) > 10
    assert np.corrcoef(shown, true)[0, 1] > 0.6


def test_lidar_points_on_the_road_are_where_the_map_has_road(dataset: Dataset, samples: list[Sample]) -> None:
    for sample in samples[:3]:
        data = dataset.data(sample)["LIDAR_TOP"]
        points = apply(dataset.ego_from_sensor(data), dataset.lidar(data)[:, :3])
        labels = point_labels(dataset, data)
        assert labels is not None
        bev = load_map(dataset.root, "exact", sample.token)
        cells = bev.grid.cell_of(points[:, :2])
        known = bev.grid.contains(cells)
        road = bev.occupancy[ROAD][tuple(cells[known].T)] > 0.5
        said = labels.is_road[np.fromfile(labels.path, np.uint8)][known]
        low = np.abs(points[known, 2]) < 0.2
        assert (said[low] == road[low]).mean() > 0.93


def test_lane_markings_are_on_the_road(dataset: Dataset, samples: list[Sample]) -> None:
    for sample in samples:
        bev = load_map(dataset.root, "exact", sample.token)
        lane, road = bev.occupancy[LANE] > 0.5, bev.occupancy[ROAD] > 0.5
        assert (lane & ~road).sum() <= 0.1 * lane.sum()
        assert 0.03 < road.mean() < 0.6


def test_views_are_an_eighth_of_the_pictures(dataset: Dataset, samples: list[Sample]) -> None:
    views = load_view_targets(dataset.root / "views" / f"{samples[0].token}.npz")
    assert set(views) == set(dataset.frame(samples[0]).images)
    for view in views.values():
        assert view.kind.shape == (16, 44)


def test_velocities_are_those_of_the_boxes(dataset: Dataset) -> None:
    rows = json.loads((dataset.root / "v1.0-simulation" / "sample_annotation.json").read_text())
    place = {row["token"]: np.array(row["translation"][:2]) for row in rows}
    errors = []
    for row in rows:
        if row["next"]:
            step = (place[row["next"]] - place[row["token"]]) / 0.5
            errors.append(np.linalg.norm(step - row["velocity"]))
    assert np.median(errors) < 0.3
