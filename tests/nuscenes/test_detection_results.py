"""Detection results: objects of a map to boxes in the world frame, written and read back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from made_map import pose
from made_objects import made_object, together

from appocc.errors import DataError
from appocc.geometry import rotation_from_quaternion, yaw_of
from appocc.nuscenes.detection_results import MOST_PER_SAMPLE, ResultBox, read_boxes, result_boxes, write_results

WORLD_FROM_EGO = pose(100.0, 50.0, np.pi / 2)


def box_of(kind: str = "car", **changes: object) -> ResultBox:
    (box,) = result_boxes(made_object(kind, 10.0, 0.0, **changes), WORLD_FROM_EGO)
    return box


def test_boxes_are_in_the_world_frame() -> None:
    box = box_of(yaw_rad=0.5, velocity_mps=(3.0, 1.0), rgb=(10.0, 20.0, 30.0), score=0.25)
    np.testing.assert_allclose(box.translation, [100, 60, 0.8], atol=1e-12)
    assert box.size == [1.8, 4.5, 1.6]
    assert yaw_of(rotation_from_quaternion(box.rotation)) == pytest.approx(np.pi / 2 + 0.5)
    np.testing.assert_allclose(np.array(box.velocity, np.float64), [-1, 3], atol=1e-12)
    assert (box.detection_name, box.detection_score, box.paint_rgb) == ("car", 0.25, [10, 20, 30])


@pytest.mark.parametrize(
    ("kind", "moving", "standing"),
    [
        ("car", "vehicle.moving", "vehicle.parked"),
        ("bus", "vehicle.moving", "vehicle.stopped"),
        ("motorcycle", "cycle.with_rider", "cycle.without_rider"),
        ("pedestrian", "pedestrian.moving", "pedestrian.standing"),
    ],
)
def test_attributes_by_speed(kind: str, moving: str, standing: str) -> None:
    assert box_of(kind, velocity_mps=(0.3, 0.0)).attribute_name == moving
    assert box_of(kind, velocity_mps=(0.1, 0.0)).attribute_name == standing


def test_what_is_unknown() -> None:
    box = box_of(velocity_mps=(np.nan, np.nan), rgb=(np.nan,) * 3)
    assert (box.velocity, box.attribute_name, box.paint_rgb) == ([0, 0], "vehicle.parked", None)


def test_the_best_are_kept_and_come_first() -> None:
    many = together(*(made_object("car", 1.0 * i, 0.0, score=i / 600) for i in range(MOST_PER_SAMPLE + 20)))
    scores = [box.detection_score for box in result_boxes(many, WORLD_FROM_EGO)]
    assert scores == sorted(scores, reverse=True)
    assert (len(scores), scores[0]) == (MOST_PER_SAMPLE, (MOST_PER_SAMPLE + 19) / 600)


def test_a_file_comes_back(tmp_path: Path) -> None:
    boxes = {"a": [box_of(), box_of("pedestrian", rgb=(np.nan,) * 3)], "b": []}
    path = tmp_path / "results.json"
    write_results(path, boxes)
    content = json.loads(path.read_text())
    assert content["meta"] == {
        "use_camera": True,
        "use_lidar": False,
        "use_radar": False,
        "use_map": False,
        "use_external": False,
    }
    assert [row["sample_token"] for row in content["results"]["a"]] == ["a", "a"]
    assert read_boxes(path, content, ["b", "a"]) == [[], boxes["a"]]
    with pytest.raises(
        DataError, match=r"results\.json: expected boxes, or an empty list, for sample c, got nothing"
    ):
        read_boxes(path, content, ["c"])
    content["results"]["a"][0]["velocity"] = [1.0]
    with pytest.raises(DataError, match=r"expected detection results of nuScenes \(results\.a\.0\.velocity"):
        read_boxes(path, content, ["a"])
