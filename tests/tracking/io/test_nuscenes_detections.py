from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.checks import FloatArray
from appocc.errors import DataError
from tracking.detections import log_odds_from_probability
from tracking.field_of_view import CircularView
from tracking.io.nuscenes_detections import read_detections, read_scene_file

HALF = 0.5**0.5


def pose(x: float, y: float, yaw_rad: float) -> FloatArray:
    """world_from_ego."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cos, -sin, 0, x], [sin, cos, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])


def result(**changes: Any) -> dict[str, Any]:
    """A car 10 m in front of an ego at (100, 50) that looks along +y, turned by 90 degrees to the ego."""
    return {
        "sample_token": "a",
        "translation": [100.0, 60.0, 0.8],
        "size": [2, 4.0, 1.6],
        "rotation": [0.0, 0.0, 0.0, 1.0],
        "velocity": [0.0, None],
        "detection_name": "car",
        "detection_score": 0.75,
    } | changes


def write(path: Path, results: Any) -> Path:
    path.write_text(json.dumps({"meta": {}, "results": results}))
    return path


def test_boxes_in_the_ego_frame(tmp_path: Path) -> None:
    path = write(tmp_path / "r.json", {"other": [], "a": [result(), result(detection_name="bus")], "b": []})
    first, second = read_detections(path, ["a", "b"], np.stack([pose(100, 50, np.pi / 2), np.eye(4)]))
    np.testing.assert_allclose(first.ground_m, [[10, 0, 0]] * 2, atol=1e-12)
    np.testing.assert_allclose(first.yaw_rad, [np.pi / 2] * 2)
    np.testing.assert_allclose(first.size_m, [[2, 4, 1.6]] * 2)
    np.testing.assert_allclose(first.log_odds, np.log([3, 3]))
    assert first.heading_known.all()
    assert first.kind == ("car", "bus")
    assert first.view == CircularView(50.0)
    assert len(second) == 0


def test_boxes_beyond_the_range_are_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "r.json", {"a": [result()]})
    (seen,) = read_detections(path, ["a"], pose(100, 0, 0)[None], range_m=30)
    assert len(seen) == 1
    assert not seen.view.sees(seen.ground_m[:, :2]).any()


BROKEN = [
    ({"a": [result(translation=[1.0, 2.0])]}, "results.a.0.translation"),
    ({"a": [result(size=[0.0, 1.0, 1.0])]}, "sample a: detections: expected positive sizes"),
    ({"a": [result(rotation=[0.0, 0.0, 0.0, 0.0])]}, "sample a: quaternion"),
    ({"a": [result(detection_score=1.5)]}, "results.a.0.detection_score"),
    ({"a": [result(detection_score=float("nan"))]}, "results.a.0.detection_score"),
    ({"b": []}, "for sample a, got nothing"),
    ([], "results"),
]


@pytest.mark.parametrize(("results", "reason"), BROKEN, ids=[reason[:30] for _, reason in BROKEN])
def test_damaged_results(tmp_path: Path, results: Any, reason: str) -> None:
    path = write(tmp_path / "r.json", results)
    with pytest.raises(DataError) as caught:
        read_detections(path, ["a"], np.eye(4)[None])
    assert str(caught.value).startswith(f"{path}: ")
    assert reason in str(caught.value)


# Scenes -----------------------------------------------------------------------------------------------------------


def key_frame(**changes: Any) -> dict[str, Any]:
    return {
        "token": "k0",
        "timestamp": 1000,
        "ego2global": pose(100, 50, np.pi / 2).tolist(),
        "gt": [{"id": 3, "name": "car", "xyz": [100.0, 60.0, 1.0], "num_lidar_pts": 7, "wlh": [1, 1, 1]}],
        "det": {"one": [{"name": "car", "score": 0.5, "xyz": [99.0, 50.0, 0.8], "wlh": [2.0, 4.0, 1.6], "yaw": 0.1}]},
    } | changes


def write_scene(path: Path, *frames: dict[str, Any]) -> Path:
    path.write_text(json.dumps({"scene": frames}))
    return path


def test_a_scene(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "s.json", key_frame(), key_frame(timestamp=2000, gt=[], det={"one": []}))
    (scene,) = read_scene_file(path, "one")
    assert (scene.name, scene.tokens, scene.timestamps_us.tolist()) == ("scene", ("k0", "k0"), [1000, 2000])
    np.testing.assert_allclose(scene.detections[0].ground_m, [[0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(scene.detections[0].yaw_rad, [0.1 - np.pi / 2])
    np.testing.assert_allclose(scene.detections[0].log_odds, [0], atol=1e-12)
    truth = scene.truth[0]
    assert (truth.ids.tolist(), truth.kind, truth.points.tolist()) == ([3], ("car",), [7])
    np.testing.assert_allclose(truth.centre_m, [[100, 60, 1]])
    assert [len(seen) for seen in scene.detections] == [1, 0]


BROKEN_SCENES = [
    ([key_frame(), key_frame()], "expected rising timestamps"),
    ([key_frame(det={"two": []})], "expected boxes of 'one', got those of two"),
    ([key_frame(ego2global=(2 * np.eye(4)).tolist())], "ego2global: expected a rotation"),
    ([key_frame(ego2global=[[1.0]])], "scene.0.ego2global"),
    ([key_frame(gt=[{"id": 1}])], "scene.0.gt.0.name: expected a value, got nothing"),
]


@pytest.mark.parametrize(("frames", "reason"), BROKEN_SCENES, ids=[reason[:30] for _, reason in BROKEN_SCENES])
def test_damaged_scenes(tmp_path: Path, frames: list[dict[str, Any]], reason: str) -> None:
    path = write_scene(tmp_path / "s.json", *frames)
    with pytest.raises(DataError) as caught:
        read_scene_file(path, "one")
    assert str(caught.value).startswith(f"{path}: ")
    assert reason in str(caught.value)


@pytest.mark.realdata
def test_a_recorded_scene(data_root: Path) -> None:
    """Most annotated cars with points have a detection where they are."""
    (scene,) = read_scene_file(data_root / "mot" / "nuscenes_scene-0103" / "derived_tracking.json", "centerpoint")
    assert len(scene.tokens) == 40
    assert sum(kind == "car" for seen in scene.detections for kind in seen.kind) == 1577
    log_odds = np.concatenate([seen.log_odds for seen in scene.detections])
    assert log_odds.min() == pytest.approx(log_odds_from_probability(np.array(0.1)))
    distances = []
    for at, seen, truth in zip(scene.world_from_ego, scene.detections, scene.truth, strict=True):
        places = (seen.ground_m @ at[:3, :3].T + at[:3, 3])[:, :2]
        cars = np.array([kind == "car" for kind in truth.kind]) & (truth.points > 10)
        distances += np.linalg.norm(truth.centre_m[cars, None, :2] - places, axis=2).min(axis=1).tolist()
    assert np.median(distances) < 0.3
