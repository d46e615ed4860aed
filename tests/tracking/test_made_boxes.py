"""Made detections on real trajectories: objects are mostly found, near their place; false boxes are less likely."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from benchmarks.made_boxes import make_scene
from benchmarks.nuscenes_mini import measure


def write_scene(path: Path, frames: int = 101) -> Path:
    """Three vehicles that drive beside the ego at its speed, a person, and a cone, in one file."""
    times = np.arange(frames) / 10
    ego: FloatArray = np.stack([5.0 * times, 0 * times, 0 * times], axis=1)
    offsets = np.array([[10, 4, 0.8], [20, -4, 0.8], [-10, 4, 0.8], [8, 9, 0.9], [6, -6, 0.5]], dtype=np.float64)
    count = len(offsets)
    np.savez(
        path,
        t=times,
        category=np.array(["vehicle.car"] * 3 + ["human.pedestrian.adult", "movable_object.trafficcone"]),
        position=offsets[:, None] + ego,
        heading=np.zeros((count, frames), np.float32),
        valid=np.ones((count, frames), np.bool_),
        size_lwh=np.array([[4.5, 1.8, 1.6]] * 3 + [[0.6, 0.6, 1.8]] * 2, np.float32),
        ego_position=ego,
        ego_heading=np.zeros(frames),
    )
    return path


def test_made_detections(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "scene-0001.npz")
    scene = make_scene(path, 2.0, 0)
    assert len(scene.detections) == len(scene.truth) == 21
    np.testing.assert_array_equal(np.diff(scene.timestamps_us), 500_000)
    assert scene.truth[0].kind == ("car", "car", "car", "pedestrian")
    found, true = 0, []
    for detections, pose, truth in zip(scene.detections, scene.world_from_ego, scene.truth, strict=True):
        assert set(detections.kind) <= {"car", "pedestrian"}
        for place in truth.centre_m[:, :2]:
            far = np.hypot(*(detections.ground_m[:, :2] + pose[:2, 3] - place).T)
            found += bool((far < 0.8).any())
            true += detections.log_odds[far < 0.8].tolist()
    every = np.concatenate([detections.log_odds for detections in scene.detections])
    assert 0.8 * 84 < found < 84
    assert np.mean(true) > every.mean() + 0.5
    np.testing.assert_array_equal(make_scene(path, 2.0, 0).detections[5].ground_m, scene.detections[5].ground_m)
    assert not np.array_equal(make_scene(path, 2.0, 1).detections[5].yaw_rad, scene.detections[5].yaw_rad)


def test_made_detections_are_measured_by_class(tmp_path: Path) -> None:
    scene = make_scene(write_scene(tmp_path / "scene-0001.npz"), 2.0, 0)
    for kind, count in (("car", 63), ("pedestrian", 21)):
        figures = measure([scene], False, kind)
        assert figures["AMOTA"] > 0.5
        assert figures["FN"] < 0.5 * count
