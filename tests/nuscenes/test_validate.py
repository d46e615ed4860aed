"""Every way in which the tables of a dataset can be broken is named with its table, its token and the reason."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import assert_only, found
from tiny_dataset import INTRINSIC, START_US, TinyDataset, token

from appocc.geometry import is_unit
from appocc.nuscenes import Dataset
from appocc.nuscenes.problem import Problem
from appocc.nuscenes.validate import validate


@pytest.mark.parametrize("images", [True, False])
def test_a_valid_dataset_has_no_problems(tiny: TinyDataset, images: bool) -> None:
    assert found(tiny, images) == []


def test_a_finding_is_one_line() -> None:
    assert str(Problem("sample", "abc", "k", "it is late")) == "error: sample abc: it is late"
    assert str(Problem("map", "", "k", "none", "note")) == "note: map: none"


def test_progress_counts_every_sensor_file(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"][0]["filename"] = "../x.jpg"
    tiny.tables["sample_data"][1]["filename"] = "sweeps/CAM_FRONT/gone.jpg"
    steps: list[int] = []
    totals: list[int | None] = []

    @contextmanager
    def progress(title: str, total: int | None) -> Iterator[Callable[[int], None]]:
        totals.append(total)
        yield steps.append

    validate(Dataset(tiny.write()), images=False, progress=progress)
    assert (totals, sum(steps)) == ([12], 12)


# Tables and references --------------------------------------------------------------------------------------------


def test_damaged_tables_are_all_named_and_nothing_else_is_looked_at(tiny: TinyDataset) -> None:
    tiny.write()
    (tiny.root / tiny.version / "scene.json").unlink()
    (tiny.root / tiny.version / "ego_pose.json").write_text("[{")
    problems = list(validate(Dataset(tiny.root)))
    assert_only(
        problems,
        ("ego_pose", "", "damaged table", "no valid JSON"),
        ("scene", "", "damaged table", "cannot be read"),
    )


def test_a_recording_without_boxes_or_maps_is_a_note(tiny: TinyDataset) -> None:
    tiny.write()
    for name in ("sample_annotation", "instance", "map"):
        del tiny.tables[name]
        (tiny.root / tiny.version / f"{name}.json").unlink()
    problems = found(tiny)
    assert {(p.table, p.kind, p.severity) for p in problems} == {
        (name, "missing table", "note") for name in ("sample_annotation", "instance", "map")
    }


def test_a_dataset_without_rows(tiny: TinyDataset) -> None:
    tiny.tables = {name: [] for name in tiny.tables}
    expected = [(name, "", "empty table", "no rows") for name in ("scene", "sample", "sample_data")]
    assert_only(found(tiny), *expected)


def test_repeated_and_empty_tokens(tiny: TinyDataset) -> None:
    tiny.tables["attribute"].append({**tiny.tables["attribute"][0]})
    tiny.tables["visibility"].append({"token": "", "level": "x"})
    assert_only(
        found(tiny),
        ("attribute", token("attribute"), "repeated token", "an earlier row"),
        ("visibility", "", "empty token", "row 1 has no token"),
    )


@pytest.mark.parametrize(
    ("table", "row", "field", "target"),
    [
        ("calibrated_sensor", 1, "sensor_token", "sensor"),
        ("instance", 0, "category_token", "category"),
        ("instance", 0, "first_annotation_token", "sample_annotation"),
        ("instance", 0, "last_annotation_token", "sample_annotation"),
        ("sample", 1, "scene_token", "scene"),
        ("sample", 0, "next", "sample"),
        ("sample_annotation", 0, "sample_token", "sample"),
        ("sample_annotation", 0, "instance_token", "instance"),
        ("sample_annotation", 0, "visibility_token", "visibility"),
        ("sample_annotation", 2, "prev", "sample_annotation"),
        ("sample_data", 0, "sample_token", "sample"),
        ("sample_data", 3, "ego_pose_token", "ego_pose"),
        ("sample_data", 0, "calibrated_sensor_token", "calibrated_sensor"),
        ("sample_data", 0, "next", "sample_data"),
        ("scene", 0, "log_token", "log"),
        ("scene", 0, "first_sample_token", "sample"),
        ("scene", 0, "last_sample_token", "sample"),
    ],
)
@pytest.mark.parametrize("value", ["gone", None])
def test_every_broken_reference(
    tiny: TinyDataset, table: str, row: int, field: str, target: str, value: str | None
) -> None:
    """An empty reference is as good as none where the schema allows it: at the ends of chains, for the visibility."""
    tiny.tables[table][row][field] = value
    named = [p for p in found(tiny) if p.kind == "broken reference"]
    if value is None and field in ("prev", "next", "visibility_token"):
        assert named == []
    else:
        reason = f"{field} '{value or ''}' is not in the table {target}"
        assert_only(named, (table, tiny.tables[table][row]["token"], "broken reference", reason))


def test_broken_references_in_lists(tiny: TinyDataset) -> None:
    tiny.tables["sample_annotation"][0]["attribute_tokens"].append("gone")
    tiny.tables["map"][0]["log_tokens"] += ["a", "b"]
    problems = found(tiny)
    assert_only(
        problems,
        ("sample_annotation", token("car", 0), "broken reference", "'gone' is not in the table attribute"),
        ("map", token("map"), "logs of other parts", "2 of its 3 log_tokens"),
    )
    assert [p.severity for p in problems] == ["error", "note"]


# Chains, ends, counts ---------------------------------------------------------------------------------------------


def test_links_that_do_not_match(tiny: TinyDataset) -> None:
    tiny.tables["sample"][2]["prev"] = tiny.tables["sample"][0]["token"]
    first, second, third = (row["token"] for row in tiny.tables["sample"])
    assert_only(
        found(tiny),
        ("sample", second, "broken chain", f"its next is {third}, whose prev is '{first}'"),
        ("sample", third, "broken chain", f"its prev is {first}, whose next is '{second}'"),
    )


def test_a_chain_in_pieces(tiny: TinyDataset) -> None:
    tiny.tables["sample"][0]["next"] = tiny.tables["sample"][1]["prev"] = ""
    tiny.tables["sample_data"][2]["next"] = tiny.tables["sample_data"][3]["prev"] = ""
    problems = found(tiny)
    assert_only(
        problems,
        ("sample", token("sample", 1), "chain in pieces", "nor has another row of its scene"),
        ("sample_data", token("CAM_FRONT", 990_000), "chain in pieces", "of its channel of the scene"),
    )
    assert [p.severity for p in problems] == ["error", "note"]


def test_time_that_runs_backwards(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"][1]["timestamp"] = START_US + 600_000
    reason = f"its next {token('CAM_FRONT', 490_000)} is 110000 us earlier"
    assert_only(found(tiny), ("sample_data", token("CAM_FRONT", 240_000), "time runs backwards", reason))


def test_times_that_do_not_increase(tiny: TinyDataset) -> None:
    tiny.tables["sample"][1]["timestamp"] = START_US
    kinds = {(p.table, p.kind) for p in found(tiny)}
    assert kinds == {("sample", "time runs backwards"), ("sample_annotation", "time runs backwards")}


def test_chains_that_leave_their_scene_channel_or_instance(tiny: TinyDataset) -> None:
    front, back = tiny.tables["sample_data"][3], tiny.tables["sample_data"][4]
    front["next"], back["prev"] = back["token"], front["token"]
    front["timestamp"] = START_US - 50_000
    car, walker = tiny.tables["sample_annotation"][2], tiny.tables["sample_annotation"][3]
    car["next"], walker["prev"] = walker["token"], car["token"]
    leaving = [p for p in found(tiny) if p.kind == "broken chain"]
    assert_only(
        leaving,
        ("sample_data", front["token"], "broken chain", "its next is of another channel of the scene"),
        ("sample_annotation", car["token"], "broken chain", "its next is of another instance"),
    )


def test_ends_and_counts_of_a_scene(tiny: TinyDataset) -> None:
    scene = tiny.tables["scene"][0]
    scene.update(first_sample_token=token("sample", 1), last_sample_token=token("sample", 0), nbr_samples=40)
    assert_only(
        found(tiny),
        ("scene", token("scene"), "wrong count", "nbr_samples is 40, but 3 rows refer to it"),
        ("scene", token("scene"), "wrong end", f"first_sample_token {token('sample', 1)} is not its first in time"),
        ("scene", token("scene"), "wrong end", f"last_sample_token {token('sample', 0)} is not its last in time"),
    )


def test_ends_and_counts_of_an_instance(tiny: TinyDataset) -> None:
    tiny.tables["instance"][1].update(first_annotation_token=token("car", 0), nbr_annotations=1)
    assert_only(
        found(tiny),
        ("instance", token("walker"), "wrong count", "nbr_annotations is 1, but 2 rows refer to it"),
        ("instance", token("walker"), "wrong end", f"{token('car', 0)} belongs to another instance"),
    )


def test_counts_that_the_tables_do_not_state(tiny: TinyDataset) -> None:
    del tiny.tables["scene"][0]["nbr_samples"], tiny.tables["instance"][0]["nbr_annotations"]
    assert found(tiny) == []


def test_samples_without_files_and_repeated_files(tiny: TinyDataset) -> None:
    data = tiny.tables["sample_data"]
    for row in data[3::4]:
        row["sample_token"] = token("sample", 1)
    kinds = [(p.table, p.token, p.kind) for p in found(tiny)]
    assert kinds == [
        *[("sample_data", row["token"], "two key frames") for row in data[3::4]],
        ("sample", token("sample", 2), "no files"),
        *[("scene", token("scene"), "samples without a channel")] * 3,
    ]


def test_a_lidar_that_some_samples_lack_is_a_note(tiny: TinyDataset) -> None:
    data = tiny.tables["sample_data"]
    data[9]["next"], data[11]["prev"] = data[11]["token"], data[9]["token"]
    del data[10]
    problems = found(tiny)
    reason = "1 of 3 samples have no LIDAR_TOP"
    assert_only(problems, ("scene", token("scene"), "samples without a channel", reason))
    assert problems[0].severity == "note"


def test_repeated_scene_names(tiny: TinyDataset) -> None:
    tiny.tables["scene"].append({**tiny.tables["scene"][0], "token": "other", "nbr_samples": 0})
    repeated = [p for p in found(tiny) if p.kind == "repeated name"]
    assert_only(repeated, ("scene", "other", "repeated name", "another scene is called 'scene-tiny'"))


# Numbers ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", ["ego_pose", "calibrated_sensor", "sample_annotation"])
@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("translation", [0, None, 0], "translation is [0.0, nan, 0.0]"),
        ("rotation", [1, 1, 0, 0], "has length 1.414, expected a unit quaternion"),
        ("rotation", [0, 0, 0, 0], "has length 0"),
        ("rotation", [None, 0, 0, 1], "has length nan"),
    ],
)
def test_poses_that_are_none(tiny: TinyDataset, table: str, field: str, value: list[Any], reason: str) -> None:
    row = tiny.tables[table][1]
    row[field] = value
    assert_only(found(tiny), (table, row["token"], "bad pose", reason))


@pytest.mark.parametrize(
    "value",
    [
        *[
            [],
            None,
            [[1, 2], [3]],
            "abc",
            [["20", 0, 15], [0, 20, 9], [0, 0, 1]],
            [[20, 0, 15], [0, 20, 9], [0, 0, True]],
        ],
        *[[[-20, 0, 15], [0, 20, 9], [0, 0, 1]], [[20, 0, None]] * 3],
    ],
)
def test_intrinsics_of_cameras(tiny: TinyDataset, value: Any) -> None:
    tiny.row("calibrated_sensor", token("mount", "LIDAR_TOP"))["camera_intrinsic"] = value
    assert found(tiny) == []
    tiny.row("calibrated_sensor", token("mount", "CAM_BACK"))["camera_intrinsic"] = value
    reason = "expected 3 x 3 numbers with positive focal lengths and a last row of 0 0 1, got"
    assert_only(found(tiny), ("calibrated_sensor", token("mount", "CAM_BACK"), "bad intrinsic", reason))
    tiny.row("calibrated_sensor", token("mount", "CAM_BACK"))["camera_intrinsic"] = INTRINSIC
    assert found(tiny) == []


@pytest.mark.parametrize("size", [[1, 0, 1], [1, 1, -2], [None, 1, 1]])
def test_sizes_that_are_not_positive(tiny: TinyDataset, size: list[Any]) -> None:
    tiny.tables["sample_annotation"][4]["size"] = size
    assert_only(found(tiny), ("sample_annotation", token("walker", 1), "bad size", "expected positive numbers"))


def test_an_instance_annotated_twice_in_a_sample(tiny: TinyDataset) -> None:
    tiny.tables["sample_annotation"][4]["sample_token"] = token("sample", 0)
    twice = [p for p in found(tiny) if p.kind == "annotated twice"]
    assert_only(twice, ("sample_annotation", token("walker", 1), "annotated twice", "another annotation"))


@pytest.mark.realdata
def test_a_published_part_of_nuscenes(data_root: Path) -> None:
    """Its masks name the logs of the whole dataset; nothing else is to be found."""
    problems = validate(Dataset(data_root / "nuscenes_real"))
    assert {(p.table, p.kind, p.severity) for p in problems} == {("map", "logs of other parts", "note")}
    assert len(problems) == 4


@pytest.mark.realdata
def test_rotations_rounded_to_float32_are_unit_quaternions(data_root: Path) -> None:
    turns = Dataset(data_root / "nuscenes_real").tables["ego_pose"].array("rotation")
    assert is_unit(turns.astype(np.float32)).all()


# Channels and scenes ----------------------------------------------------------------------------------------------


def test_two_sensors_of_one_channel(tiny: TinyDataset) -> None:
    """One of the two cameras would be lost in every sample."""
    tiny.row("sensor", token("sensor", "CAM_BACK"))["channel"] = "CAM_FRONT"
    data = tiny.tables["sample_data"]
    behind = [row["token"] for row in data[4:8] if row["is_key_frame"]]
    twice = [p for p in found(tiny) if p.kind == "two key frames"]
    assert_only(twice, *[("sample_data", name, "two key frames", "has another such file") for name in behind])


def test_two_sensors_of_one_channel_in_different_samples_are_sound(tiny: TinyDataset) -> None:
    """As in the joined tables of two vehicles."""
    data = tiny.tables["sample_data"]
    tiny.row("sensor", token("sensor", "CAM_BACK"))["channel"] = "CAM_FRONT"
    tiny.tables["sample_data"] = [row for row in data[:4] if row["sample_token"] == token("sample", 0)]
    tiny.tables["sample_data"] += [row for row in data[4:8] if row["sample_token"] != token("sample", 0)] + data[8:]
    kinds = {p.kind for p in found(tiny)}
    assert not kinds & {"two key frames", "samples without a channel"}


def test_a_scene_without_key_frames(tiny: TinyDataset) -> None:
    tiny.tables["scene"].append({**tiny.tables["scene"][0], "token": "other", "name": "b", "nbr_samples": 0})
    empty = [p for p in found(tiny) if p.kind == "no key frames"]
    assert_only(empty, ("scene", "other", "no key frames", "no sample refers to it"))


def test_times_with_fractions_are_a_note(tiny: TinyDataset) -> None:
    for row in tiny.tables["sample"]:
        row["timestamp"] += 0.25
    problems = found(tiny)
    assert_only(problems, ("sample", "", "times with fractions", "timestamp: expected whole microseconds"))
    assert problems[0].severity == "note"


@pytest.mark.parametrize(
    ("table", "field", "value"),
    [
        ("sensor", "channel", None),
        ("sensor", "channel", ""),
        ("sensor", "modality", "Camera"),
        ("sample", "timestamp", True),
        ("sample_data", "timestamp", "1600000000000000"),
        ("ego_pose", "translation", [True, False, True]),
        ("sample_annotation", "translation", ["1", "2", "3"]),
        ("calibrated_sensor", "rotation", ["1", 0, 0, 0]),
    ],
)
def test_values_that_are_none_are_a_damaged_table(tiny: TinyDataset, table: str, field: str, value: Any) -> None:
    tiny.tables[table][1][field] = value
    assert_only(found(tiny), (table, "", "damaged table", f"{field}: expected "))
