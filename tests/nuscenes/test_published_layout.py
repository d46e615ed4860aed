"""nuScenes as it is published and unpacked: map expansion, basemaps, prediction and CAN bus beside the tables."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from published_twin import TOWN, published

from appocc.doctor import contents_of
from appocc.grid import BEVGrid
from appocc.groundtruth.occupancy import vector_lane
from appocc.nuscenes import Dataset
from appocc.nuscenes.maps import VectorMap, vector_map
from appocc.nuscenes.validate import validate


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return Dataset(published(tmp_path_factory.mktemp("published") / "nuscenes"))


@pytest.fixture
def found(dataset: Dataset) -> VectorMap:
    made = vector_map(dataset, dataset.scenes[0])
    assert made is not None
    return made


def test_the_tables_are_found_and_healthy(dataset: Dataset) -> None:
    assert dataset.tables.version == "v1.0-mini"
    assert list(validate(dataset, images=True)) == []
    contents = contents_of(dataset)
    assert (contents.masks, contents.scenes_with_mask, contents.vector_maps) == (1, 1, 1)
    assert contents.locations == (TOWN,)
    assert set(contents.channels) == {"CAM_FRONT", "CAM_BACK", "LIDAR_TOP"}


def test_the_test_set_has_no_boxes(tmp_path: Path) -> None:
    root = published(tmp_path / "nuscenes")
    tables = (root / "v1.0-mini").rename(root / "v1.0-test")
    for name in ("sample_annotation", "instance"):
        (tables / f"{name}.json").write_text("[]")
    hidden = Dataset(root)
    assert list(validate(hidden)) == []
    assert hidden.frame(hidden.samples(hidden.scenes[0])[0]).boxes_ego is None


def test_roads_lines_and_landmarks_of_every_layer(found: VectorMap) -> None:
    assert found.drivable is not None
    assert found.markings is not None
    assert [len(holes) for _, holes in found.drivable] == [1, 0]  # the road, and the car park
    assert sorted(len(line) for line in found.markings) == [2, 2, 5]  # two dividers, and around the stop line
    kinds = {kind: len(outlines) for kind, outlines in found.landmarks.items()}
    once = dict.fromkeys(("crossing", "stop line", "traffic light", "junction", "car park"), 1)
    assert kinds == {**once, "stop sign": 0}


def test_cells_of_lines_around_the_ego(dataset: Dataset, found: VectorMap) -> None:
    pose = dataset.world_from_ego(dataset.samples(dataset.scenes[0])[0])  # at (100, 200), along +y
    grid = BEVGrid.surround()
    assert found.markings is not None
    lane = vector_lane(grid, pose, found.markings).on
    left = [-0.2, -4.2]  # of the two dividers, which end 12 m ahead
    assert lane[tuple(grid.cell_of([[10.0, y] for y in left]).T)].all()
    assert not lane[tuple(grid.cell_of([[14.0, y] for y in left]).T)].any()


def test_the_devkit_s_map_has_the_same_shapes(
    dataset: Dataset, found: VectorMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed (--no-deps)")
    drawing = SimpleNamespace(PolygonPatch=None)  # it draws with this package only
    monkeypatch.setitem(sys.modules, "descartes", drawing)
    api = pytest.importorskip("nuscenes.map_expansion.map_api", exc_type=ImportError)
    theirs: Any = api.NuScenesMap(str(dataset.root), TOWN)
    (road,) = (theirs.extract_polygon(token) for token in theirs.drivable_area[0]["polygon_tokens"])
    assert found.drivable is not None
    outline, (hole,) = found.drivable[0]
    np.testing.assert_array_equal(outline, np.array(road.exterior.coords)[:-1])
    np.testing.assert_array_equal(hole, np.array(road.interiors[0].coords)[:-1][: len(hole)])
    lines = [
        theirs.extract_line(theirs.get(layer, token)["line_token"])
        for layer, token in (("lane_divider", "e"), ("road_divider", "m"))
    ]
    assert found.markings is not None
    for ours, line in zip(found.markings, lines, strict=False):
        np.testing.assert_array_equal(ours, np.array(line.coords))
    assert theirs.layers_on_point(102, 160)["drivable_area"] == "d"
