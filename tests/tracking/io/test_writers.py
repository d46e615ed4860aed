from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from made_tracks import track

from appocc.errors import DataError, ShapeError
from tracking.io.writers import assign_classes, write_csv, write_mot, write_nuscenes
from tracking.vehicle_classes import class_from_size


@pytest.mark.parametrize(
    ("length_m", "width_m", "expected"),
    [(4.5, 1.8, "car"), (2.0, 0.8, "motorcycle"), (2.6, 1.6, "car"), (7.0, 2.4, "truck"), (12.0, 2.9, "bus")],
)
def test_class_by_size(length_m: float, width_m: float, expected: str) -> None:
    assert class_from_size(length_m, width_m) == expected


def test_nuscenes_results(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "tracking.json"
    unseen = track(2, rgb=np.full(3, np.nan), seen=False)
    write_nuscenes(path, ["first", "empty", "last"], [(track(),), (), (track(), unseen)], ["camera", "external"])
    data = json.loads(path.read_text())
    assert data["meta"] == {
        "use_camera": True,
        "use_lidar": False,
        "use_radar": False,
        "use_map": False,
        "use_external": True,
    }
    assert {token: len(entries) for token, entries in data["results"].items()} == {"first": 1, "empty": 0, "last": 2}
    entry = data["results"]["first"][0]
    half = 0.707107
    assert entry == {
        "sample_token": "first",
        "translation": [100.0, 50.0, 2.8],
        "size": [1.8, 4.5, 1.6],
        "rotation": [half, 0.0, 0.0, half],
        "velocity": [3.0, 4.0],
        "tracking_id": "1",
        "tracking_name": "car",
        "tracking_score": 0.9,
        "rgb": [10.0, 20.0, 30.0],
        "seen": True,
        "heading_known": True,
        "velocity_known": True,
    }
    assert data["results"]["last"][1]["rgb"] is None


def test_a_track_has_one_class_for_life(tmp_path: Path) -> None:
    """A truck that enters at the rim first looks like a car."""
    moments = [(track(length_m=length),) for length in (3.0, 7.0, 7.1)]
    write_nuscenes(tmp_path / "t.json", list("abc"), moments, [])
    results = json.loads((tmp_path / "t.json").read_text())["results"]
    assert [results[token][0]["tracking_name"] for token in "abc"] == ["truck"] * 3


def test_a_detectors_class_and_height_stay(tmp_path: Path) -> None:
    """Also one that only it knows."""
    moments = [(track(1, kind="bus", height_m=3.0), track(2, kind="pram", height_m=np.nan), track(3))]
    assert assign_classes(moments) == {1: "bus", 2: "pram", 3: "car"}
    write_nuscenes(tmp_path / "t.json", ["a"], moments, [])
    entries = json.loads((tmp_path / "t.json").read_text())["results"]["a"]
    assert [(each["size"][2], each["translation"][2]) for each in entries] == [(3.0, 3.5), (1.6, 2.8), (1.6, 2.8)]


def test_table_lines(tmp_path: Path) -> None:
    unknown = {"heading_known": False, "velocity_known": False, "rgb": np.full(3, np.nan)}
    unseen = track(12, seen=False, kind="bus", **unknown)
    write_csv(tmp_path / "deep" / "t.csv", [10**15, 10**15 + 5, 10**15 + 9], [(track(),), (), (track(), unseen)])
    lines = (tmp_path / "deep" / "t.csv").read_text().split("\n")
    place = "100.0000,50.0000,2.0000,1.5708,4.5000,1.8000"
    colour = "10.0,20.0,30.0,black or blue"
    assert lines == [
        "timestamp_us,frame,track_id,class,x_m,y_m,z_m,yaw_rad,length_m,width_m,"
        "vx_mps,vy_mps,r,g,b,colour,score,seen,heading_known",
        f"1000000000000000,1,1,car,{place},3.0000,4.0000,{colour},0.9000,1,1",
        f"1000000000000009,3,1,car,{place},3.0000,4.0000,{colour},0.9000,1,1",
        f"1000000000000009,3,12,bus,{place},,,,,,,0.9000,0,0",
        "",
    ]


def test_a_table_of_nothing_has_a_header(tmp_path: Path) -> None:
    write_csv(tmp_path / "t.csv", [1, 2], [(), ()])
    assert len((tmp_path / "t.csv").read_text().splitlines()) == 1
    with pytest.raises(ShapeError, match="expected a time for each of 1 frames, got 2"):
        write_csv(tmp_path / "t.csv", [1, 2], [()])


def test_mot_lines(tmp_path: Path) -> None:
    slanted = track(7, yaw_world_rad=np.pi / 6, length_m=4.0, width_m=2.0)
    write_mot(tmp_path / "mot.txt", [(track(),), (), (slanted,)])
    first, second = (tmp_path / "mot.txt").read_text().splitlines()
    assert first == "1,1,99.100,47.750,1.800,4.500,0.900,100.000,50.000,2.000"
    frame, name, left, top, width, height, conf, x, y, z = (float(value) for value in second.split(","))
    assert (frame, name, conf, x, y, z) == (3, 7, 0.9, 100, 50, 2)
    np.testing.assert_allclose([width, height], [4 * 0.866 + 2 * 0.5, 4 * 0.5 + 2 * 0.866], atol=1e-3)
    np.testing.assert_allclose([left + width / 2, top + height / 2], [100, 50], atol=1e-3)


def test_mot_text_is_read_by_motmetrics(tmp_path: Path) -> None:
    motmetrics = pytest.importorskip("motmetrics")
    write_mot(tmp_path / "mot.txt", [(track(1), track(2)), (track(1),)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = motmetrics.io.loadtxt(tmp_path / "mot.txt", fmt="mot15-2D")
    assert table.index.tolist() == [(1, 1), (1, 2), (2, 1)]


def test_what_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        write_mot(tmp_path / "file" / "mot.txt", [(track(),)])
    with pytest.raises(DataError, match="cannot be written"):
        write_csv(tmp_path / "file" / "t.csv", [1], [(track(),)])
    with pytest.raises(ValueError, match="shorter"):
        write_nuscenes(tmp_path / "t.json", ["one", "two"], [(track(),)], [])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]
