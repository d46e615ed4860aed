"""Reading one table: any layout of the text, any damage named by record, tokens found."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appocc.errors import DataError, NotFoundError
from appocc.nuscenes import table as table_module
from appocc.nuscenes.schema import FieldSpec
from appocc.nuscenes.table import RowGroups, Table, empty_table, read_table, take_rows

FIELDS = (
    FieldSpec("token", "token"),
    FieldSpec("time", "time"),
    FieldSpec("note", "text", required=False),
    FieldSpec("name", "name", required=False),
    FieldSpec("parts", "tokens", required=False),
    FieldSpec("key", "bool"),
    FieldSpec("place", "vector", width=3),
    FieldSpec("count", "int", required=False, unknown=-1),
    FieldSpec("other", "any", required=False),
    FieldSpec("title", "name"),
    FieldSpec("mode", "name", required=False, choices=("", "one", "two")),
)


def record(i: int = 0, **changes: Any) -> dict[str, Any]:
    return {"token": f"t{i}", "time": i, "key": i % 2 == 0, "place": [i, 0.5, -1], "title": "x", **changes}


def write(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "things.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def read(tmp_path: Path, records: Any, **layout: Any) -> Table:
    return read_table(write(tmp_path, json.dumps(records, **layout)), FIELDS)


def test_columns_by_kind(tmp_path: Path) -> None:
    full = record(1, note="é", name="car", parts=["a", "b"], count=7, other={"x": [1]})
    t = read(tmp_path, [record(0), full])
    assert (t.name, len(t)) == ("things", 2)
    assert t.array("token").tolist() == [b"t0", b"t1"]
    assert t.text("note", 1) == "é"
    assert t["name"] == ["", "car"]
    assert t["parts"] == [(), ("a", "b")]
    assert t.array("key").tolist() == [True, False]
    assert t.array("place").tolist() == [[0, 0.5, -1], [1, 0.5, -1]]
    assert t.array("count").tolist() == [-1, 7]
    assert t["other"] == [None, {"x": [1]}]
    assert "note" not in record(0)


def test_null_means_not_known(tmp_path: Path) -> None:
    t = read(tmp_path, [record(0, note=None, name=None, parts=None, count=None, place=[1, None, 2])])
    assert (t.text("note", 0), t["name"], t["parts"], t["count"][0]) == ("", [""], [()], -1)
    assert np.isnan(t.array("place")[0, 1])


def test_fractions_of_microseconds_are_truncated(tmp_path: Path) -> None:
    t = read(tmp_path, [record(0), record(1, time=1557858039302414.8)])
    assert t.array("time").tolist() == [0, 1557858039302414]
    assert t.cut == ("time",)


def test_whole_numbers_may_be_written_as_floats(tmp_path: Path) -> None:
    t = read(tmp_path, [record(0, time=1557858039302414.0, count=5.0)])
    assert (t["time"][0], t["count"][0], t.cut) == (1557858039302414, 5, ())
    assert t.array("time").dtype == t.array("count").dtype == np.int64


def test_fields_that_the_schema_does_not_know_are_skipped(tmp_path: Path) -> None:
    t = read(tmp_path, [record(0, data={"CAM": "x"}, anns=[{"a": 1}, {"b": 2}])])
    assert set(t.columns) == {field.name for field in FIELDS}


records = st.lists(
    st.builds(
        record,
        st.integers(0, 99),
        note=st.text(alphabet='},{ "\\ab\n', max_size=8),
        other=st.recursive(
            st.none() | st.text(alphabet='},{[]"', max_size=4),
            lambda part: st.lists(part, max_size=3) | st.dictionaries(st.text(max_size=2), part, max_size=2),
        ),
    ),
    max_size=12,
)


@given(records, st.sampled_from([None, 0, 2]), st.integers(1, 60), st.booleans())
def test_any_layout_read_in_pieces_of_any_size(
    tmp_path_factory: pytest.TempPathFactory, rows: list[dict[str, Any]], indent: int | None, size: int, bom: bool
) -> None:
    path = write(tmp_path_factory.mktemp("t"), b"\xef\xbb\xbf" * bom + json.dumps(rows, indent=indent).encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table_module, "_PIECE", size)
        t = read_table(path, FIELDS)
    assert [t.text("token", i) for i in range(len(t))] == [row["token"] for row in rows]
    assert [t.text("note", i) for i in range(len(t))] == [row["note"] for row in rows]
    assert t["other"] == [row["other"] for row in rows]


@pytest.mark.parametrize("size", [7, 64, 1 << 16])
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text[:-3], "no valid JSON list of records"),
        (lambda text: text.replace('"time": 7', '"time": 7 7'), "after record"),
        (lambda text: text.replace('"t7"', '"t7'), "after record"),
        (lambda text: text.replace("}, {", "} {", 1), "Expecting ',' delimiter"),
        (lambda text: text + "x", "Extra data"),
    ],
)
def test_damage_is_found_wherever_the_pieces_are_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int, change: Any, reason: str
) -> None:
    monkeypatch.setattr(table_module, "_PIECE", size)
    path = write(tmp_path, change(json.dumps([record(i) for i in range(10)])))
    with pytest.raises(DataError, match=rf"things\.json: .*{reason}"):
        read_table(path, FIELDS)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", r"the file is empty, after record 0"),
        ("  \n", "the file is empty"),
        ('{"token": "a"}', r"it does not begin with '\['"),
        ("[", "no valid JSON list"),
        ("[" * 100_000, "recursion|no valid JSON list"),
        (b"[\xff\xfe]", "can't decode byte 0xff"),
        ("[1]", "record 0: expected an object, got int"),
        ('[{"token": 9' + "9" * 5000 + "}]", "no valid JSON list"),
    ],
)
def test_what_is_no_table(tmp_path: Path, text: str | bytes, reason: str) -> None:
    with pytest.raises(DataError, match=reason):
        read_table(write(tmp_path, text), FIELDS)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.json: cannot be read \(No such file or directory\)"):
        read_table(tmp_path / "none.json", FIELDS)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"token": 5}, r"record 3 \(5\): token: expected a short text, got 5"),
        ({"token": "x" * 2000}, "token: expected a short text"),
        ({"token": "\ud800"}, "token: expected a short text"),
        ({"note": ["a"]}, r"record 3 \(t3\): note: expected a short text, got \[\"a\"\]"),
        ({"name": 5}, "name: expected a text, got 5"),
        ({"parts": "abc"}, 'parts: expected a list of tokens, got "abc"'),
        ({"parts": [1]}, r"parts: expected a list of tokens, got \[1\]"),
        ({"time": "soon"}, 'time: expected microseconds, got "soon"'),
        ({"time": float("nan")}, "time: expected microseconds, got NaN"),
        ({"time": 2**63}, "time: expected microseconds, got 9223372036854775808"),
        ({"time": [3]}, r"time: expected microseconds, got \[3\]"),
        ({"time": True}, "time: expected microseconds, got true"),
        ({"time": None}, "time: expected microseconds, got null"),
        ({"time": -float("inf")}, "time: expected microseconds, got -Infinity"),
        ({"count": 2.5}, r"count: expected a whole number, got 2\.5"),
        ({"count": False}, "count: expected a whole number, got false"),
        ({"count": "7"}, 'count: expected a whole number, got "7"'),
        ({"title": None}, "title: expected a text that is not empty, got null"),
        ({"title": ""}, 'title: expected a text that is not empty, got ""'),
        ({"mode": "three"}, 'mode: expected one or two, got "three"'),
        ({"place": [True, 2, 3]}, r"place: expected 3 numbers, got \[true, 2, 3\]"),
        ({"place": ["1", "2", "3"]}, r'place: expected 3 numbers, got \["1", "2", "3"\]'),
        ({"key": "false"}, 'key: expected true or false, got "false"'),
        ({"key": None}, "key: expected true or false, got null"),
        ({"place": [1, 2]}, r"place: expected 3 numbers, got \[1, 2\]"),
        ({"place": [[1], [2], [3]]}, "place: expected 3 numbers"),
        ({"place": None}, "place: expected 3 numbers, got null"),
        ({"place": ["a", 2, 3]}, "place: expected 3 numbers"),
    ],
)
def test_a_wrong_value_is_named_with_its_record(tmp_path: Path, changes: dict[str, Any], reason: str) -> None:
    rows = [record(i) for i in range(6)]
    rows[3].update(changes)
    with pytest.raises(DataError, match=rf"things\.json: .*{reason}"):
        read(tmp_path, rows)


def test_records_are_counted_over_all_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_module, "_PIECE", 100)
    rows = [record(i) for i in range(50)]
    del rows[41]["time"]
    with pytest.raises(DataError, match=r"record 41 \(t41\) has no field 'time'"):
        read(tmp_path, rows)


def test_rows_are_found_by_token(tmp_path: Path) -> None:
    t = read(tmp_path, [record(0, token="bb"), record(1, token="a"), record(2, token="ccc")])
    assert t.rows_of(np.array([b"ccc", b"x", b"bb", b""])).tolist() == [2, -1, 0, -1]
    assert t.row("a") == 1
    for token in ("nope", "\udcff"):
        with pytest.raises(NotFoundError, match="table things has no token"):
            t.row(token)


def test_repeated_tokens(tmp_path: Path) -> None:
    t = read(tmp_path, [record(0, token=token) for token in ("b", "a", "b", "b", "c")])
    assert t.repeated().tolist() == [False, False, True, True, False]


def test_an_empty_table_has_no_rows_and_finds_none(tmp_path: Path) -> None:
    for t in (empty_table("things", FIELDS), read(tmp_path, [])):
        assert len(t) == 0
        assert t.array("place").shape == (0, 3)
        assert t.rows_of(np.array([b"a"])).tolist() == [-1]
        assert t.repeated().shape == (0,)
        assert t.groups("token").rows("a").tolist() == []


def test_groups_keep_the_order_of_rows() -> None:
    groups = RowGroups(np.array([b"x", b"yy", b"x", b"z", b"x"]))
    assert groups.rows("x").tolist() == [0, 2, 4]
    assert groups.rows("yy").tolist() == [1]
    assert groups.rows("q").tolist() == []
    assert groups.rows("\udcff").tolist() == []


@given(st.lists(st.sampled_from(["", "a", "b", "cc"])))
def test_groups_part_all_rows(values: list[str]) -> None:
    groups = RowGroups(np.array([value.encode() for value in values], dtype=np.bytes_))
    for value in ("", "a", "b", "cc", "d"):
        assert groups.rows(value).tolist() == [i for i, one in enumerate(values) if one == value]


def test_values_at_rows() -> None:
    assert take_rows(np.array([5, 6]), np.array([1, -1, 0])).tolist() == [6, -1, 5]
    assert take_rows(np.array([], dtype=np.int64), np.array([-1, -1])).tolist() == [-1, -1]
