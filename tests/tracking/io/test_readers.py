from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.errors import DataError
from tracking.io.readers import FrameEntries, TrackFormat, read_track_file

KITTI = "{frame} {id} {kind} {cut} {hidden} -10 10 20 60 80 1.5 1.6 4.0 {x} 1.7 {z} 0.1"


def box(**changes: Any) -> dict[str, Any]:
    return {"translation": [1.0, 2.0, 3.0], "tracking_id": "t1", "tracking_name": "car"} | changes


def kitti(**changes: Any) -> str:
    values = {"frame": 0, "id": 1, "kind": "Car", "cut": 0, "hidden": 0, "x": -2.5, "z": 20} | changes
    return KITTI.format(**values)


def write(path: Path, content: str | dict[str, Any]) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps({"results": content}))
    return path


def test_nuscenes(tmp_path: Path) -> None:
    content = {
        "b": [box(tracking_score=0.5), box(tracking_id=7, tracking_name="bus", velocity=[float("nan")] * 2)],
        "a": [],
    }
    file = read_track_file(write(tmp_path / "t.json", content))
    assert file.format is TrackFormat.nuscenes
    assert list(file.frames) == ["b", "a"]
    entries = file.frames["b"]
    assert (entries.ids, entries.kind) == (("t1", "7"), ("car", "bus"))
    np.testing.assert_array_equal(entries.xy_m, [[1, 2]] * 2)
    np.testing.assert_array_equal(entries.score, [0.5, np.nan])
    assert entries.required.all()
    assert len(file.frames["a"]) == 0


def test_motchallenge(tmp_path: Path) -> None:
    file = read_track_file(
        write(tmp_path / "t.txt", "10,1,5,6,2,3,0.5,-1,-1,-1\n\n2,1.0,5,6,2,3,0\r\n2, 3, 5, 6, 2, 3, 1\n")
    )
    assert file.format is TrackFormat.mot
    assert list(file.frames) == [2, 10]
    assert file.frames[2].ids == ("1", "3")
    assert file.frames[2].required.tolist() == [False, True]
    np.testing.assert_array_equal(file.frames[10].box_px, [[5, 6, 7, 9]])
    np.testing.assert_array_equal(file.frames[10].score, [0.5])


def test_kitti(tmp_path: Path) -> None:
    hard = [kitti(frame=1, id=2, cut=1), kitti(frame=1, id=3, hidden=3), kitti(frame=1, id=4, hidden=2)]
    regions = [kitti(frame=1, id=-1, kind="DontCare", x=-1000)] * 2
    file = read_track_file(write(tmp_path / "t.txt", "\n".join([kitti() + " 4.5", *hard, *regions])))
    assert file.format is TrackFormat.kitti
    first, second = file.frames[0], file.frames[1]
    assert (first.ids, first.kind) == (("1",), ("Car",))
    np.testing.assert_array_equal(first.xy_m, [[-2.5, 20]])
    np.testing.assert_array_equal(first.box_px, [[10, 20, 60, 80]])
    np.testing.assert_array_equal(first.score, [4.5])
    assert second.required.tolist()[:3] == [False, False, True]
    assert np.isnan(second.score).all()
    assert len(second) == 5


def test_an_empty_file_has_no_format(tmp_path: Path) -> None:
    file = read_track_file(write(tmp_path / "t.txt", " \n"))
    assert file.format is None
    assert not file.frames


def test_selecting(tmp_path: Path) -> None:
    entries = read_track_file(write(tmp_path / "t.txt", "1,1,5,6,2,3,0.5\n1,2,7,6,2,3,0.6\n")).frames[1]
    chosen = entries.select(np.array([False, True]))
    assert (chosen.ids, chosen.score.tolist(), chosen.box_px.tolist()) == (("2",), [0.6], [[7, 6, 9, 9]])
    assert len(FrameEntries.empty()) == 0


DAMAGED = [
    ({"a": [box(translation=[1.0, 2.0])]}, "results.a.0.translation"),
    ({"a": [box(translation=[1.0, float("nan"), 0.0])]}, "results.a.0.translation.1"),
    ({"a": [box(translation=[1e12, 0.0, 0.0])]}, "sample a: expected places up to 1e+09 m"),
    ({"a": [{"tracking_id": "1"}]}, "results.a.0.translation: expected a value, got nothing"),
    ({"a": [box(tracking_score="high")]}, "results.a.0.tracking_score"),
    ({"a": [box(), box()]}, "sample a: expected each id once in a frame, got 't1' twice"),
    ("{", "no valid JSON"),
    ("[1]", "expected tracking results of nuScenes"),
    ("1,1,5,6,2\n", "line 1: expected at least 7 columns, got 5"),
    ("1,1,5,6,2,3,1\n1,x,5,6,2,3,1\n", "line 2: expected numbers, got 'x'"),
    ("1,1,5,6,nan,3,1\n", "line 1: expected finite numbers"),
    ("1,1,5,inf,2,3,1\n", "line 1: expected finite numbers"),
    ("1,1,5,6,0,3,1\n", "line 1: expected a positive width and height, got 0 x 3"),
    ("1.5,1,5,6,2,3,1\n", "line 1: expected a whole number for frame, got 1.5"),
    ("1,1.5,5,6,2,3,1\n", "line 1: expected a whole number for id, got 1.5"),
    ("1,-1,5,6,2,3,1\n1,-1,9,6,2,3,1\n", "line 2: expected each id once in a frame, got '-1' twice"),
    (kitti().rsplit(" ", 1)[0], "line 1: expected at least 17 columns, got 16"),
    (kitti(x="left"), "line 1: expected numbers"),
    (kitti() + " nan", "line 1: expected finite numbers"),
    (kitti(frame=0.5), "line 1: expected a whole number for frame"),
    (kitti() + "\n" + kitti(), "line 2: expected each id once"),
    ("\0\1\2\n", "line 1: expected at least 17 columns, got 1"),
]


@pytest.mark.parametrize(("content", "reason"), DAMAGED, ids=[reason[:40] for _, reason in DAMAGED])
def test_damaged_files(tmp_path: Path, content: str | dict[str, Any], reason: str) -> None:
    path = write(tmp_path / "t", content)
    with pytest.raises(DataError) as caught:
        read_track_file(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_not_there(tmp_path: Path) -> None:
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(DataError, match="cannot be read"):
            read_track_file(path)
