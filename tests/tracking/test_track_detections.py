from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_dataset import HALF, TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.errors import AppoccError, DataError
from appocc.nuscenes import Dataset
from cli.main import app
from tracking.detections import Detections
from tracking.evaluation.evaluate import EvaluationOptions, evaluate_files
from tracking.io.nuscenes_detections import RANGE_M
from tracking.pipeline import track_detections

SIZES = {
    "car": [1.9, 4.6, 1.6],
    "pedestrian": [0.5, 0.6, 1.8],
    "trailer": [2.5, 7.0, 3.0],
    "barrier": [2.0, 0.5, 1.0],
}


def box(kind: str, x: float, y: float, score: float = 0.9) -> dict[str, Any]:
    """On the ground, its heading along +y."""
    return {
        "translation": [x, y, SIZES[kind][2] / 2],
        "size": SIZES[kind],
        "rotation": [HALF, 0.0, 0.0, HALF],
        "velocity": [0.0, 0.0],
        "detection_name": kind,
        "detection_score": score,
        "attribute_name": "",
    }


def street() -> dict[str, list[dict[str, Any]]]:
    """Boxes of the tiny dataset's objects, of a trailer without annotation, and of untracked classes."""
    return {
        token("sample", i): [
            box("car", 100, 210),
            box("pedestrian", 95, 205 + 0.5 * i),
            box("trailer", 108, 220),
            box("barrier", 104, 205),
        ]
        for i in range(3)
    }


def write(path: Path, results: Any, **meta: bool) -> Path:
    path.write_text(json.dumps({"meta": {"use_lidar": True, "use_camera": False} | meta, "results": results}))
    return path


def run(root: Path, *words: object) -> Result:
    return CliRunner().invoke(app, ["track", str(root), "--scene", "scene-tiny", *map(str, words)])


def test_a_scene_is_tracked_written_and_scored(tiny: TinyDataset, tmp_path: Path) -> None:
    path = write(tmp_path / "results.json", street())
    result = run(tiny.root, "--detections", path, "--json")
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    scores = ["metrics", "metrics_moving", "metrics_parked"]
    assert list(answer) == ["scene", "detections", "left_out", "tracks", "files", *scores]
    assert (answer["scene"], answer["detections"], answer["tracks"]) == ("scene-tiny", str(path), 3)
    assert answer["left_out"] == {"barrier": 3}
    assert "left out, as they are no classes of the tracking benchmark: boxes of barrier (3)" in result.stderr
    assert "3 objects in 3 key frames" in result.stderr
    # The pedestrian is no vehicle and does not count; the trailer is one that is not there.
    assert [answer["metrics"][name] for name in ("GT", "FN", "FP", "IDS")] == [3, 0, 3, 0]
    folder = tiny.root / "tracks" / "results" / "scene-tiny"
    assert answer["files"][:2] == [str(folder / name) for name in ("tracking.json", "mot.txt")]
    assert json.loads((folder / "metrics.json").read_text())["detections"] == str(path)


def test_classes_sizes_and_sensors_are_the_detectors(tiny: TinyDataset, tmp_path: Path) -> None:
    path = write(tmp_path / "results.json", street(), use_map=True)
    assert run(tiny.root, "--detections", path, "--out", tmp_path / "out").exit_code == 0
    data = json.loads((tmp_path / "out" / "tracking.json").read_text())
    assert [name for name, used in data["meta"].items() if used] == ["use_lidar", "use_map"]
    assert list(data["results"]) == [token("sample", i) for i in range(3)]
    for i, moment in enumerate(data["results"].values()):
        assert [entry["tracking_name"] for entry in moment] == ["car", "pedestrian", "trailer"]
        assert [entry["size"] for entry in moment] == [SIZES[entry["tracking_name"]] for entry in moment]
        places = [entry["translation"] for entry in moment]
        np.testing.assert_allclose(places, [[100, 210, 0.8], [95, 205 + 0.5 * i, 0.9], [108, 220, 1.5]], atol=0.3)
        np.testing.assert_allclose([entry["rotation"] for entry in moment], [[HALF, 0, 0, HALF]] * 3, atol=1e-3)
        assert all(entry["heading_known"] and entry["rgb"] is None for entry in moment)
    # Its own annotations judge every class.
    metrics = evaluate_files(tiny.root, tmp_path / "out" / "tracking.json", EvaluationOptions("pedestrian")).metrics
    assert (metrics.GT, metrics.FN, metrics.FP) == (2, 0, 1)


def test_vehicles_of_classes_left_out_are_not_missed(tiny: TinyDataset, tmp_path: Path) -> None:
    """The car is a construction vehicle, whose boxes are left out."""
    for row in tiny.tables["category"]:
        if row["name"] == "vehicle.car":
            row["name"] = "vehicle.construction"
    tiny.write()
    boxes = [box("car", 100, 210) | {"detection_name": "construction_vehicle"}]
    path = write(tmp_path / "r.json", {token("sample", i): boxes for i in range(3)})
    answer = json.loads(run(tiny.root, "--detections", path, "--json").stdout)
    assert answer["left_out"] == {"construction_vehicle": 3}
    assert [answer["metrics"][name] for name in ("GT", "FN", "FP")] == [0, 0, 0]


@pytest.mark.parametrize(("out", "what"), [("v1.0-tiny", "the tables"), (".", "the detections")])
def test_the_input_is_not_overwritten(tiny: TinyDataset, out: str, what: str) -> None:
    path = write(tiny.root / "tracking.json", street())
    before = {each: each.read_bytes() for each in tiny.root.rglob("*") if each.is_file()}
    error = run(tiny.root, "--detections", path, "--out", tiny.root / out).exception
    assert isinstance(error, DataError)
    assert f"the tracks would be written over {what}; choose another folder" in str(error)
    assert {each: each.read_bytes() for each in tiny.root.rglob("*") if each.is_file()} == before


def test_without_annotations_nothing_is_scored(tiny: TinyDataset, tmp_path: Path) -> None:
    tiny.tables["sample_annotation"] = []
    tiny.write()
    result = run(tiny.root, "--detections", write(tmp_path / "r.json", street()), "--json")
    answer = json.loads(result.stdout)
    assert answer["metrics"] is answer["metrics_moving"] is answer["metrics_parked"] is None
    assert "no annotations" in result.stderr


def test_a_file_that_does_not_say_what_it_was_made_from(tiny: TinyDataset, tmp_path: Path) -> None:
    for meta in ({}, {"meta": "mine"}, {"meta": {"use_lidar": 1}}):
        (tmp_path / "r.json").write_text(json.dumps({"results": street(), **meta}))
        dataset = Dataset(tiny.root)
        tracks, left_out = track_detections(dataset, dataset.scenes[0], tmp_path / "r.json")
        assert tracks.sensors == ()
        assert left_out == {"barrier": 3}


class Silent:
    """A tracker that returns no tracks and records its input."""

    def __init__(self) -> None:
        self.given: list[tuple[Detections, int]] = []

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: Any) -> tuple[()]:
        self.given.append((detections, timestamp_us))
        return ()


def test_detections_passed_to_the_tracker(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset, tracker = Dataset(tiny.root), Silent()
    steps: list[int] = []
    path = write(tmp_path / "r.json", street())
    track_detections(dataset, dataset.scenes[0], path, tracker=tracker, advance=steps.append)
    assert steps == [1, 1, 1]
    seen, time_us = tracker.given[1]
    assert time_us == dataset.samples(dataset.scenes[0])[1].timestamp_us
    assert seen.kind == ("car", "pedestrian", "trailer")
    np.testing.assert_allclose(seen.ground_m, [[7.5, 0.0, 0.0], [3.0, 5.0, 0.0], [17.5, -8.0, 0.0]], atol=1e-9)
    assert seen.view.sees(np.array([[RANGE_M - 1, 0], [RANGE_M + 1, 0]])).tolist() == [True, False]


def _without(name: str) -> dict[str, Any]:
    return {key: boxes for key, boxes in street().items() if key != name}


def _with(**changes: Any) -> dict[str, Any]:
    return street() | {token("sample", 1): [box("car", 1, 2) | changes]}


@pytest.mark.parametrize(
    ("results", "reason"),
    [
        (_without(token("sample", 2)), f"for sample {token('sample', 2)}, got nothing"),
        (_with(translation=[1.0, float("nan"), 0.0]), f"results.{token('sample', 1)}.0.translation.1"),
        (_with(translation=[1.0, 1e12, 0.0]), "expected at most 1e+09 m"),
        (_with(size=[1.0, 4.0, 0.0]), "expected positive sizes, got 0 m"),
        (_with(size=[1.0, 1e4, 1.0]), "expected sizes up to 1000 m, got 10000 m"),
        (_with(detection_score=-0.1), "detection_score"),
        ([], "results"),
    ],
)
def test_damaged_files(tiny: TinyDataset, tmp_path: Path, results: Any, reason: str) -> None:
    path = write(tmp_path / "r.json", results)
    error = run(tiny.root, "--detections", path).exception
    assert isinstance(error, DataError)
    assert str(error).startswith(f"{path}: ")
    assert reason in str(error)
    assert not (tiny.root / "tracks").exists()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--detections", "f", "--bev", "b"), "expected one of --bev, --detections, --kitti and --mot, got --bev"),
        (("--detections", "f", "--kitti", "k"), "got --detections and --kitti"),
        (("--detections", "f", "--video", "v.webm"), "--detections goes only with ROOT, --scene"),
        (("--detections", "f", "--fps", "2"), "--detections goes only with ROOT, --scene"),
        ((), "expected one of --bev, --detections, --kitti and --mot, got none"),
    ],
)
def test_invalid_option_combinations(tiny: TinyDataset, words: tuple[str, ...], complaint: str) -> None:
    error = run(tiny.root, *words).exception
    assert isinstance(error, AppoccError)
    assert complaint in str(error)
    assert "\n" not in str(error)


def test_options_required_by_detections(tmp_path: Path) -> None:
    error = CliRunner().invoke(app, ["track", "--detections", "f"]).exception
    assert str(error) == "track: --detections needs ROOT and --scene, got no ROOT and --scene"
