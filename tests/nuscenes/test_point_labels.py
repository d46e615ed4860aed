"""Labels of LiDAR points: nuScenes-lidarseg, and a recording's own beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_dataset import TinyDataset, token

from appocc.errors import DataError
from appocc.nuscenes import Dataset
from appocc.nuscenes.point_labels import PointLabels, point_labels

SWEEP = token("LIDAR_TOP", 0)
OWN = {3: "Vegetation", 7: "Road", 8: "Lane Line Marking", 9: "Stop Line Marking", 10: "Other Road Marking"}
LIDARSEG = {0: "noise", 17: "vehicle.car", 24: "flat.driveable_surface"}


def table(tiny: TinyDataset, name: str, rows: Any) -> None:
    (tiny.root / tiny.version / f"{name}.json").write_text(json.dumps(rows))


def label_rows(name: str) -> list[dict[str, Any]]:
    return [{"token": SWEEP, "sample_data_token": SWEEP, "filename": f"{name}/v1.0-tiny/a.bin"}]


def named(names: dict[int, str]) -> list[dict[str, Any]]:
    return [{"token": f"c{index}", "index": index, "name": name} for index, name in names.items()]


def lidarseg(tiny: TinyDataset, names: dict[int, str] = LIDARSEG) -> None:
    tiny.tables["category"] += named(names)
    tiny.write()
    table(tiny, "lidarseg", label_rows("lidarseg"))


def own(tiny: TinyDataset, names: dict[int, str] = OWN) -> None:
    table(tiny, "pointlabels", label_rows("pointlabels"))
    table(tiny, "pointlabels_category", named(names))


def found(tiny: TinyDataset, sweep: int = 0) -> PointLabels | None:
    dataset = Dataset(tiny.root)
    return point_labels(dataset, dataset.chain(dataset.scenes[0], "LIDAR_TOP")[sweep])


def test_no_labels(tiny: TinyDataset) -> None:
    assert found(tiny) is None


def test_lidarseg_knows_roads_and_no_markings(tiny: TinyDataset) -> None:
    lidarseg(tiny)
    labels = found(tiny)
    assert labels is not None
    assert labels.path == tiny.root / "lidarseg/v1.0-tiny/a.bin"
    assert labels.source == "lidarseg"
    assert np.flatnonzero(labels.is_road).tolist() == [24]
    assert labels.is_lane is None
    assert found(tiny, 1) is None  # sweeps between key frames have none


def test_labels_of_the_recording_have_priority(tiny: TinyDataset) -> None:
    lidarseg(tiny)
    own(tiny)
    labels = found(tiny)
    assert labels is not None
    assert labels.source == "pointlabels"
    assert np.flatnonzero(labels.is_road).tolist() == [7, 8, 9, 10]
    assert labels.is_lane is not None
    assert np.flatnonzero(labels.is_lane).tolist() == [8, 9]  # other markings, such as zebras, are road and no lane


def test_label_sets_without_road_are_no_source(tiny: TinyDataset) -> None:
    lidarseg(tiny)
    own(tiny, {3: "Vegetation"})
    labels = found(tiny)
    assert labels is not None
    assert labels.source == "lidarseg"


def test_categories_without_an_index_are_no_labels(tiny: TinyDataset) -> None:
    """The first releases of nuScenes: `index` came with lidarseg."""
    table(tiny, "lidarseg", label_rows("lidarseg"))
    assert found(tiny) is None
    tiny.tables["category"] = [{**row, "index": None} for row in tiny.tables["category"]]
    tiny.write()
    assert found(tiny) is None


def test_labels_beyond_a_byte_are_ignored(tiny: TinyDataset) -> None:
    own(tiny, {7: "Road", 300: "Road", -1: "Road"})
    labels = found(tiny)
    assert labels is not None
    assert np.flatnonzero(labels.is_road).tolist() == [7]


@pytest.mark.parametrize(
    ("name", "rows", "message"),
    [
        ("pointlabels", [{"token": "a"}], r"pointlabels\.json: record 0 \(a\) has no field 'sample_data_token'"),
        ("pointlabels", [7], r"pointlabels\.json: record 0: expected an object, got int"),
        (
            "pointlabels_category",
            [{"token": "a", "index": 7}],
            r"pointlabels_category\.json: record 0 \(a\) has no field",
        ),
        (
            "pointlabels_category",
            [*named({7: "Road"}), 7],
            r"pointlabels_category\.json: record 1: expected an object",
        ),
        (
            "pointlabels_category",
            [{"token": "a", "index": "x", "name": "Road"}],
            r"pointlabels_category\.json: index: expected a whole number",
        ),
        ("pointlabels_category", 7, r"pointlabels_category\.json: no valid JSON list"),
    ],
)
def test_bad_tables(tiny: TinyDataset, name: str, rows: Any, message: str) -> None:
    own(tiny)
    table(tiny, name, rows)
    with pytest.raises(DataError, match=message):
        found(tiny)


def test_labels_without_names_are_no_source(tiny: TinyDataset) -> None:
    own(tiny)
    (tiny.root / tiny.version / "pointlabels_category.json").unlink()
    assert found(tiny) is None


def test_files_stay_below_the_root(tiny: TinyDataset) -> None:
    own(tiny)
    table(tiny, "pointlabels", [{**label_rows("x")[0], "filename": "../../labels.bin"}])
    with pytest.raises(DataError, match="leads out of this folder"):
        found(tiny)


@pytest.mark.realdata
def test_labels_of_a_converted_recording(panda_root: Path) -> None:
    dataset = Dataset(panda_root)
    sweeps = dataset.chain(dataset.scenes[0], "LIDAR_TOP")
    every = [point_labels(dataset, sweep) for sweep in sweeps]
    assert len(every) == 38
    assert all(labels is not None and labels.is_lane is not None for labels in every)
