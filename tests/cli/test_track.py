from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.bevmap import VEHICLE, BEVMap, bev_path
from appocc.errors import DataError, NotFoundError
from appocc.grid import BEVGrid
from cli.main import app

NAMES = ["tracking.json", "mot.txt", "tracks.csv", "summary.csv"]


@pytest.fixture
def street(tiny: TinyDataset) -> TinyDataset:
    """The tiny dataset with maps of its parked car, 10 m ahead of the ego's start; the ego drives 2.5 m a frame."""
    grid = BEVGrid.surround()
    for i in range(3):
        offset = np.abs(grid.centres() - [10.0 - 2.5 * i, 0.0])
        car = (offset[..., 0] < 2.3) & (offset[..., 1] < 0.95)
        occupancy = np.zeros((3, *grid.shape), np.float32)
        occupancy[VEHICLE][car] = 1
        appearance = np.where(car, 240, 90).astype(np.uint8)[None].repeat(3, axis=0)
        known = np.ones((3, *grid.shape), np.bool_)
        bev = BEVMap(grid, occupancy, known, appearance, known[0].copy())
        bev.save(bev_path(tiny.root, "groundtruth", token("sample", i)))
    return tiny


def run(root: Path, *more: str) -> Result:
    scene = () if "--scene" in more else ("--scene", "scene-tiny")
    return CliRunner().invoke(app, ["track", str(root), "--bev", "groundtruth", *scene, *more])


def test_json(street: TinyDataset) -> None:
    result = run(street.root, "--json")
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert list(answer) == ["scene", "bev", "tracks", "files", "metrics", "metrics_moving", "metrics_parked"]
    assert (answer["scene"], answer["bev"], answer["tracks"]) == ("scene-tiny", "groundtruth", 1)
    metrics = answer["metrics"]
    assert {"MOTA", "MOTP", "IDF1", "IDS", "FRAG", "HOTA"} <= set(metrics)
    assert (metrics["MOTA"], metrics["IDF1"], metrics["IDS"], metrics["GT"]) == (1.0, 1.0, 0, 3)
    assert answer["metrics_moving"]["MOTA"] is None
    assert answer["metrics_parked"]["MOTA"] == 1.0
    folder = street.root / "tracks" / "groundtruth" / "scene-tiny"
    assert answer["files"] == [str(folder / name) for name in (*NAMES, "metrics.json")]
    assert all(Path(name).is_file() for name in answer["files"])
    assert json.loads((folder / "metrics.json").read_text())["metrics"] == metrics


def test_tracks_of_one_source_do_not_overwrite_those_of_another(street: TinyDataset, tmp_path: Path) -> None:
    assert run(street.root).exit_code == 0
    (street.root / "bev" / "groundtruth").rename(tmp_path / "mine")
    first = {path: path.stat().st_mtime_ns for path in (street.root / "tracks").rglob("*.*")}
    assert run(street.root, "--bev", f"{tmp_path}/mine/").exit_code == 0
    assert {path.name for path in (street.root / "tracks").iterdir()} == {"groundtruth", "mine"}
    assert {path: path.stat().st_mtime_ns for path in first} == first
    assert len(list((street.root / "tracks" / "mine" / "scene-tiny").iterdir())) == len(first)


def test_smoothed_tracks_are_written_and_scored_alike(street: TinyDataset) -> None:
    result = run(street.root, "--smooth", "--json")
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert (answer["tracks"], answer["metrics"]["MOTA"], answer["metrics"]["GT"]) == (1, 1.0, 3)


def test_for_people_everything_goes_to_stderr(street: TinyDataset, tmp_path: Path) -> None:
    result = run(street.root, "--out", str(tmp_path / "out"), "--video", str(tmp_path / "t.webm"))
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "scene scene-tiny: 1 vehicles in 3 key frames" in result.stderr
    assert "MOTA" in result.stderr
    assert (tmp_path / "t.webm").stat().st_size > 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*NAMES, "metrics.json"}
    assert not (street.root / "tracks").exists()


def test_without_annotations_metrics_are_null(street: TinyDataset) -> None:
    street.tables["sample_annotation"] = []
    street.write()
    result = run(street.root, "--json")
    answer = json.loads(result.stdout)
    assert answer["metrics"] is answer["metrics_moving"] is answer["metrics_parked"] is None
    assert [Path(name).name for name in answer["files"]] == NAMES
    assert "no annotations" in result.stderr


def test_bad_input(street: TinyDataset, tmp_path: Path) -> None:
    assert isinstance(run(street.root, "--scene", "nowhere").exception, NotFoundError)
    assert isinstance(run(tmp_path / "nothing").exception, DataError)
    bev_path(street.root, "groundtruth", token("sample", 1)).unlink()
    assert "appocc groundtruth" in str(run(street.root).exception)
    assert not (street.root / "tracks").exists()


def test_a_bad_video_name_is_refused_before_any_work(street: TinyDataset) -> None:
    result = run(street.root, "--video", "t.mp4")
    assert "ends in .webm" in str(result.exception)
    assert not (street.root / "tracks").exists()


def test_help_shows_an_example() -> None:
    result = CliRunner().invoke(app, ["track", "--help"])
    assert result.exit_code == 0
    assert "appocc track DATA --scene 002" in result.stdout


def test_no_vehicle_is_followed_where_no_camera_sees_unless_asked_for(street: TinyDataset) -> None:
    for i in range(3):
        path = bev_path(street.root, "groundtruth", token("sample", i))
        bev = BEVMap.load(path)
        behind = bev.grid.centres()[..., 0] < 0
        meta = {"thresholds": {"road": 0.5, "vehicle": 0.5, "lane": 0.5}}
        replace(bev, occupancy_valid=bev.occupancy_valid & behind, meta=meta).save(path)
    blind, trusted = (json.loads(run(street.root, "--json", *more).stdout) for more in ((), ("--trust-unseen",)))
    assert (blind["tracks"], trusted["tracks"]) == (0, 1)
    assert trusted["metrics"]["MOTA"] == 1.0
