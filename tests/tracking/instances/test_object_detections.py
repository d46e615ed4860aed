"""Objects of maps as detections, and the class of their tracks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_map import RED, Car, map_of, pose
from made_objects import made_object, objects_of_boxes, together
from made_scene import with_maps
from tiny_dataset import TinyDataset

from appocc.bevmap import ROAD, VEHICLE, BEVMap, bev_path, load_map
from appocc.colours import lab_from_rgb
from appocc.geometry import inverse
from appocc.objects import BEVObjects
from tracking.class_votes import vote_classes
from tracking.detections import Detections
from tracking.evaluation.scene import score_scene
from tracking.instances.instances import find_instances
from tracking.io.writers import assign_classes
from tracking.pipeline import track_scene
from tracking.presets import OBJECTS
from tracking.tracker import Tracker

THRESHOLDS = {"road": 0.5, "vehicle": 0.5, "lane": 0.5}


def with_objects(*parts: BEVObjects, **changes: Any) -> BEVMap:
    return replace(map_of([Car(10, 0)]), objects=together(*parts), **changes)


def test_objects_are_detections() -> None:
    rgb = tuple(float(value) for value in RED)
    bev = with_objects(
        made_object("truck", 10.0, 2.0, yaw_rad=0.3, rgb=rgb, score=0.75),
        made_object("pedestrian", 5.0, -3.0, rgb=(np.nan,) * 3, score=0.5),
        made_object("bicycle", 5.0, 3.0),
    )
    found = Detections.from_bev(bev)
    assert found.kind == ("vehicle", "pedestrian", "bicycle")
    np.testing.assert_allclose(found.ground_m[0], [10, 2, 0], atol=1e-12)
    np.testing.assert_allclose(found.size_m[0], [2.4, 7.5, 2.8])
    np.testing.assert_allclose(found.log_odds[:2], [np.log(3), 0], atol=1e-12)
    np.testing.assert_allclose(found.rgb[0], RED)
    np.testing.assert_allclose(found.lab[0], lab_from_rgb(RED))
    assert np.isnan(found.lab[1]).all()
    assert found.yaw_rad[0] == 0.3
    assert found.heading_known.all()
    assert not found.truncated.any()


def test_the_threshold_of_a_map_has_log_odds_of_zero() -> None:
    bev = with_objects(made_object("car", 10.0, 0.0, score=0.2), meta={"object_threshold": 0.2})
    np.testing.assert_allclose(Detections.from_bev(bev).log_odds, [0], atol=1e-12)


def test_objects_at_a_border_are_truncated_and_unseen_ones_left_out() -> None:
    cars = [made_object("car", x, 0.0) for x in (38.5, 10.0, 1.0, -5.0)]
    valid = np.ones((3, 200, 200), np.bool_)
    valid[:, :100] = False  # nothing is seen behind
    bev = with_objects(*cars, occupancy_valid=valid, meta={"thresholds": THRESHOLDS})
    found = Detections.from_bev(bev)
    assert found.ground_m[:, 0].tolist() == [38.5, 10, 1]
    assert found.truncated.tolist() == [True, False, True]
    assert found.view.blind(np.array([[-5.0, 0.0], [5.0, 0.0]])).tolist() == [True, False]
    guessed = Detections.from_bev(bev.with_guesses())
    assert guessed.truncated.tolist() == [True, False, False, False]
    assert not guessed.view.blind(np.array([[-5.0, 0.0]])).any()


def test_a_map_without_objects_has_its_instances() -> None:
    bev = map_of([Car(10, 0), Car(20, 5)])
    found, instances = Detections.from_bev(bev), Detections.from_instances(find_instances(bev))
    np.testing.assert_array_equal(found.ground_m, instances.ground_m)
    assert found.kind == instances.kind
    # A network that detects nothing is believed: there are no blobs then.
    assert len(Detections.from_bev(replace(bev, objects=made_object("car", 1, 1).select(np.zeros(1, np.bool_))))) == 0


def test_a_vehicle_whose_class_flips_keeps_its_track_and_gets_the_class_of_most_scores() -> None:
    tracker, tracks, tables = Tracker(OBJECTS), [], []
    for k, (kind, score) in enumerate((("car", 0.9), ("truck", 0.5), ("truck", 0.6), ("car", 0.8))):
        person = made_object("pedestrian", 5.0, 4.0)
        bev = with_objects(person, made_object(kind, 10.0 + k, 0.0, score=score))
        found = Detections.from_bev(bev)
        tracks.append(tuple(tracker.update(found, k * 500_000, pose())))
        tables.append(bev.known_objects)
    assert [[track.id for track in states] for states in tracks] == [[1, 2]] * 4
    voted = vote_classes(tracks, tables)
    assert [[track.kind for track in states] for states in voted] == [["pedestrian", "car"]] * 4
    assert assign_classes(voted) == {1: "pedestrian", 2: "car"}
    assert vote_classes(tracks, [None] * 4)[0][1].kind == "vehicle"


def test_a_scene_is_tracked_by_its_objects(tiny: TinyDataset, tmp_path: Path) -> None:
    """The maps show no vehicle, the objects do; the pedestrian is tracked and not counted."""
    dataset = with_maps(tiny, "model")
    for sample in dataset.samples(dataset.scenes[0]):
        bev = load_map(tiny.root, "model", sample.token)
        boxes = dataset.boxes_world(sample).transformed(inverse(dataset.world_from_ego(sample)))
        occupancy = np.zeros_like(bev.occupancy)
        occupancy[ROAD] = 1
        empty = replace(bev, occupancy=occupancy, objects=objects_of_boxes(boxes))
        assert not empty.on[VEHICLE].any()
        empty.save(bev_path(tiny.root, "model", sample.token))
    result = track_scene(dataset, dataset.scenes[0], "model")
    assert [[(track.id, track.kind) for track in states] for states in result.tracks] == [
        [(1, "car"), (2, "pedestrian")],
        [(1, "car"), (2, "pedestrian")],
        [(1, "car")],
    ]
    np.testing.assert_allclose(result.tracks[0][0].position_world_m, [100, 210, 0], atol=0.1)
    assert result.tracks[0][0].height_m == pytest.approx(1.6)
    scores = score_scene(dataset, result)
    assert scores is not None
    assert (scores["metrics"].MOTA, scores["metrics"].GT, scores["metrics"].FP) == (1.0, 3, 0)
