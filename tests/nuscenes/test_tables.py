"""The tables of a root: found, read when asked for, related to each other."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tiny_dataset import TinyDataset

from appocc.errors import DataError, NotFoundError
from appocc.nuscenes.schema import EXTRA_TABLES, OPTIONAL_TABLES, TABLES
from appocc.nuscenes.tables import Tables, find_version


def test_the_schema_has_thirteen_tables_and_refers_only_to_them() -> None:
    assert len(TABLES) == 13
    for fields in [*TABLES.values(), *EXTRA_TABLES.values()]:
        assert fields[0].name == "token"
        assert {field.refers_to for field in fields} <= {"", *TABLES}
    assert {*TABLES, *EXTRA_TABLES} >= OPTIONAL_TABLES


def test_the_only_version_needs_no_name(tiny_root: Path) -> None:
    assert find_version(tiny_root, None) == "v1.0-tiny"
    assert find_version(tiny_root, "v1.0-tiny") == "v1.0-tiny"


def test_tables_in_the_root_itself(tiny: TinyDataset) -> None:
    for path in (tiny.root / tiny.version).iterdir():
        path.rename(tiny.root / path.name)
    assert find_version(tiny.root, None) == ""
    assert len(Tables(tiny.root)["sample"]) == 3


def test_roots_without_a_dataset_or_with_several(tiny: TinyDataset, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"nowhere: no such folder"):
        find_version(tmp_path / "nowhere", None)
    with pytest.raises(DataError, match="no nuScenes-schema dataset"):
        find_version(tmp_path, None)
    with pytest.raises(DataError, match=r"no version 'v2'; found v1.0-tiny"):
        find_version(tiny.root, "v2")
    with pytest.raises(DataError, match="no version 'v2'; found none"):
        find_version(tmp_path, "v2")
    tiny.version = "v1.0-other"
    tiny.write()
    with pytest.raises(DataError, match=r"several versions \(v1.0-other, v1.0-tiny\); choose one with --version"):
        find_version(tiny.root, None)


def test_tables_are_read_once_and_on_demand(tiny_root: Path) -> None:
    tables = Tables(tiny_root)
    (tiny_root / "v1.0-tiny" / "sample_annotation.json").write_text("damaged")
    assert tables["sample"] is tables["sample"]
    with pytest.raises(DataError, match=r"sample_annotation\.json: no valid JSON"):
        _ = tables["sample_annotation"]


def test_tables_that_a_recording_may_lack_are_empty(tiny: TinyDataset) -> None:
    for name in OPTIONAL_TABLES & set(tiny.tables):
        (tiny.root / tiny.version / f"{name}.json").unlink()
    tables = Tables(tiny.root)
    tables.load_all()
    assert [len(tables[name]) for name in sorted(OPTIONAL_TABLES)] == [0] * len(OPTIONAL_TABLES)
    assert tables.annotation_category.shape == (0,)


def test_tables_that_no_dataset_lacks(tiny: TinyDataset) -> None:
    for name in set(TABLES) - OPTIONAL_TABLES - {"sample_data"}:
        (tiny.root / tiny.version / f"{name}.json").unlink()
        with pytest.raises(DataError, match=rf"{name}\.json: cannot be read \(No such file"):
            _ = Tables(tiny.root)[name]


def test_names_that_the_schema_does_not_have(tiny_root: Path) -> None:
    with pytest.raises(NotFoundError, match=r"the schema has no table 'samples'; it has attribute, .*lidarseg"):
        _ = Tables(tiny_root)["samples"]


def test_rows_of_one_table_by_another(tiny_root: Path) -> None:
    tables = Tables(tiny_root)
    tables.load_all()
    data, channel = tables["sample_data"], tables["sensor"]["channel"]
    assert [channel[row] for row in tables.data_channel] == ["CAM_FRONT"] * 4 + ["CAM_BACK"] * 4 + ["LIDAR_TOP"] * 4
    rows = tables.data_by_sample.rows(tables["sample"].text("token", 1))
    assert [data["is_key_frame"][row] for row in rows] == [False, True] * 3
    names = [tables["category"]["name"][row] for row in tables.annotation_category]
    assert names == ["vehicle.car"] * 3 + ["human.pedestrian.adult"] * 2


def test_broken_references_are_rows_of_minus_one(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"][0]["calibrated_sensor_token"] = "gone"
    tiny.tables["sample_annotation"][1]["instance_token"] = "gone"
    tables = Tables(tiny.write())
    assert tables.data_channel[:2].tolist() == [-1, 0]
    assert tables.annotation_category.tolist() == [0, -1, 0, 1, 1]


def test_references_into_empty_tables(tiny: TinyDataset) -> None:
    for name in ("calibrated_sensor", "instance", "category", "sensor"):
        tiny.tables[name] = []
    tables = Tables(tiny.write())
    assert set(tables.data_channel) == {-1}
    assert set(tables.annotation_category) == {-1}


def test_lyft_tables_hold_more_and_other_things(tiny: TinyDataset) -> None:
    """Lyft Level 5: tokens of 64 digits, times with fractions, empty visibilities, fields left out and added."""
    text = {name: json.dumps(rows) for name, rows in tiny.tables.items()}
    for row in [r for rows in tiny.tables.values() for r in rows]:
        for name in text:
            text[name] = text[name].replace(f'"{row["token"]}"', f'"{row["token"].rjust(64, "f")}"')
    tiny.tables = {name: json.loads(value) for name, value in text.items()}
    for row in tiny.tables["sample_data"] + tiny.tables["sample"] + tiny.tables["ego_pose"]:
        row["timestamp"] += 0.5
    for row in tiny.tables["sample"]:
        row.update(data={"CAM_FRONT": "x"}, anns=["y"])
    for row in tiny.tables["sample_annotation"]:
        row.update(visibility_token="", num_lidar_pts=-1)
        del row["attribute_tokens"], row["num_radar_pts"]
    tables = Tables(tiny.write())
    tables.load_all()
    assert len(tables["sample"].text("token", 0)) == 64
    assert tables["sample"]["timestamp"][1] == 1_600_000_000_500_000
    assert tables["sample_annotation"].array("num_lidar_pts").tolist() == [-1] * 5
    assert set(tables["sample_annotation"]["attribute_tokens"]) == {()}
