from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from made_map import Car, map_of, pose
from made_scene import with_maps
from tiny_dataset import TinyDataset, token

from appocc.bevmap import bev_path
from appocc.errors import DataError
from appocc.geometry import apply, inverse
from appocc.nuscenes import Dataset
from tracking.detections import Detections
from tracking.evaluation.clear_id_hota import evaluate
from tracking.evaluation.frames import EvaluationFrame
from tracking.evaluation.scene import moving_instances, score_scene, write_metrics
from tracking.pipeline import track_scene, write_tracks
from tracking.presets import MAPS
from tracking.tracker import Tracker


def test_a_scene_is_tracked_written_and_scored(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = with_maps(tiny)
    steps: list[int] = []
    result = track_scene(dataset, dataset.scenes[0], "groundtruth", advance=steps.append)
    assert steps == [1, 1, 1]
    assert (result.scene, result.source, result.count) == ("scene-tiny", "groundtruth", 1)
    assert [[track.id for track in moment] for moment in result.tracks] == [[1], [1], [1]]
    np.testing.assert_allclose(result.tracks[-1][0].position_world_m, [100, 210, 0], atol=0.1)

    scores = score_scene(dataset, result)
    assert scores is not None
    assert (scores["metrics"].MOTA, scores["metrics"].GT) == (1.0, 3)
    assert (scores["metrics_parked"].MOTA, scores["metrics_parked"].GT) == (1.0, 3)
    assert (scores["metrics_moving"].GT, scores["metrics_moving"].FP) == (0, 0)

    paths = write_tracks(tmp_path / "out", result)
    assert [path.name for path in paths] == ["tracking.json", "mot.txt", "tracks.csv", "summary.csv"]
    lines = [path.read_text().splitlines() for path in paths[2:]]
    assert [len(each) for each in lines] == [4, 2]
    first, last = (result.samples[i].timestamp_us for i in (0, -1))
    assert [line.split(",")[0] for line in lines[0][1:]] == [str(time_us) for time_us in result.times_us]
    assert lines[1][1] == f"1,car,white,{first},{last},3,3,0.00,0.00,0"
    data = json.loads(paths[0].read_text())
    assert list(data["results"]) == [token("sample", i) for i in range(3)]
    assert data["meta"]["use_lidar"]
    write_metrics(tmp_path / "out" / "metrics.json", result, scores)
    written = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert written["metrics"]["MOTA"] == 1.0
    assert written["metrics_moving"]["MOTA"] is None
    assert written["protocol"] == {"range_m": 40.0, "gate_m": 2.0, "moving_span_m": 2.0}


def test_smoothed_tracks_are_the_same_vehicles(tiny: TinyDataset) -> None:
    dataset = with_maps(tiny)
    result = track_scene(dataset, dataset.scenes[0], "groundtruth")
    smoothed = result.smoothed(MAPS.lifecycle.motion)
    assert [[track.id for track in moment] for moment in smoothed.tracks] == [[1], [1], [1]]
    assert len({(track.length_m, track.yaw_world_rad) for (track,) in smoothed.tracks}) == 1
    np.testing.assert_allclose(
        [track.position_world_m for (track,) in smoothed.tracks], [[100, 210, 0]] * 3, atol=0.1
    )
    assert smoothed.samples == result.samples


def test_maps_of_a_model_come_from_cameras_alone(tiny: TinyDataset, tmp_path: Path) -> None:
    dataset = with_maps(tiny, "my-model")
    path = write_tracks(tmp_path, track_scene(dataset, dataset.scenes[0], "my-model"))[0]
    meta = json.loads(path.read_text())["meta"]
    assert [name for name, used in meta.items() if used] == ["use_camera"]


def test_a_missing_map_says_how_to_make_it(tiny: TinyDataset) -> None:
    dataset = with_maps(tiny)
    gone = bev_path(tiny.root, "groundtruth", dataset.samples(dataset.scenes[0])[1].token)
    gone.unlink()
    with pytest.raises(DataError) as caught:
        track_scene(dataset, dataset.scenes[0], "groundtruth")
    assert str(caught.value) == f"{gone}: no BEV map; make it with: appocc groundtruth {tiny.root}"
    with pytest.raises(
        DataError, match=r"no BEV map; there are maps of source groundtruth; make it with: appocc infer .*/bev/other"
    ):
        track_scene(dataset, dataset.scenes[0], "other")


def test_a_scene_without_key_frames(tiny: TinyDataset) -> None:
    tiny.tables["sample"], tiny.tables["sample_data"], tiny.tables["sample_annotation"] = [], [], []
    tiny.write()
    dataset = Dataset(tiny.root)
    with pytest.raises(DataError, match="scene 'scene-tiny' has no key frames"):
        track_scene(dataset, dataset.scenes[0], "groundtruth")


def test_without_annotations_there_are_no_scores(tiny: TinyDataset) -> None:
    with_maps(tiny)
    tiny.tables["sample_annotation"] = []
    tiny.write()
    dataset = Dataset(tiny.root)
    assert score_scene(dataset, track_scene(dataset, dataset.scenes[0], "groundtruth")) is None


def test_objects_beyond_the_range_are_ignored(tiny: TinyDataset) -> None:
    for i in range(3):
        tiny.row("sample_annotation", token("car", i))["translation"] = [100.0, 240.5, 0.8]
    tiny.write()
    dataset = with_maps(tiny)
    scores = score_scene(dataset, track_scene(dataset, dataset.scenes[0], "groundtruth"))
    assert scores is not None
    # 40.5, 38 and 35.5 m from the ego: the first is beyond 40 m.
    assert (scores["metrics"].GT, scores["metrics"].FN, scores["metrics"].FP) == (2, 0, 0)


def test_what_moves(tiny: TinyDataset) -> None:
    def moving(step_m: float) -> set[str]:
        for i in range(3):
            tiny.row("sample_annotation", token("car", i))["translation"] = [100.0 + i * step_m, 210.0, 0.8]
        tiny.write()
        dataset = Dataset(tiny.root)
        samples = dataset.samples(dataset.scenes[0])
        return moving_instances([dataset.boxes_world(sample).vehicles() for sample in samples])

    assert moving(0.9) == set()
    assert moving(1.1) == {token("car")}


@pytest.mark.realdata
def test_recorded_traffic_at_two_key_frames_a_second(data_root: Path) -> None:
    """Boxes of a nuScenes scene, painted in made-up colours, seen from its ego's path."""
    data = np.load(data_root / "nuscenes_mini_tracks" / "scene-0103.npz")
    cars = np.flatnonzero([name.startswith("vehicle.") and name != "vehicle.bicycle" for name in data["category"]])
    colours = np.random.default_rng(5).integers(0, 256, (len(data["ids"]), 3))
    tracker, moments = Tracker(MAPS), []
    for k in range(0, len(data["t"]), 5):
        here = pose(data["ego_position"][k, 0], data["ego_position"][k, 1], data["ego_heading"][k])
        there = cars[data["valid"][cars, k]]
        places = apply(inverse(here), data["position"][there, k])[:, :2]
        yaws = data["heading"][there, k] - data["ego_heading"][k]
        painted = [
            Car(place[0], place[1], yaw, tuple(colours[n]), data["size_lwh"][n, 0], data["size_lwh"][n, 1])
            for n, place, yaw in zip(there, places, yaws, strict=True)
        ]
        tracks = tracker.update(Detections.from_bev(map_of(painted)), round(data["t"][k] * 1e6), here)
        found = np.array([track.position_world_m for track in tracks]).reshape(-1, 3)
        near = [np.hypot(*apply(inverse(here), xyz)[:, :2].T) <= 40 for xyz in (data["position"][there, k], found)]
        numbers = np.array([track.id for track in tracks], np.int64)
        moments.append(
            EvaluationFrame(there, data["position"][there, k, :2], near[0], numbers, found[:, :2], near[1])
        )
    scores = evaluate(moments)
    assert scores.GT > 600
    assert scores.MOTA > 0.95
    assert scores.IDF1 > 0.95


@pytest.mark.realdata
def test_a_recorded_street_is_tracked(panda_root: Path) -> None:
    dataset = Dataset(panda_root)
    scores = score_scene(dataset, track_scene(dataset, dataset.scene("002"), "groundtruth"))
    assert scores is not None
    assert scores["metrics"].GT > 1000
    assert scores["metrics"].MOTA > 0.95
    assert scores["metrics_moving"].MOTA > 0.95
    assert scores["metrics"].IDF1 > 0.95
