from __future__ import annotations

import numpy as np
import pytest
from made_pair import GRID, bev
from tiny_dataset import TinyDataset, token

from appocc.bevmap import VEHICLE
from appocc.boxes import Boxes
from appocc.evaluation.vehicles import delta_e, score_vehicles, true_vehicles, visibility_levels
from appocc.nuscenes import Dataset

EVERYWHERE = np.ones(GRID.shape, np.bool_)
CARS = {VEHICLE: np.s_[30:34, 19:21]}


def test_a_vehicle_is_scored_by_its_own_cells() -> None:
    truth, predicted = bev(CARS, rgb=(200, 30, 30)), bev({VEHICLE: np.s_[31:40, 10:30]}, 0.6, rgb=(200, 30, 30))
    vehicles = true_vehicles(truth, None, None)
    (score,) = score_vehicles(predicted, truth, vehicles, EVERYWHERE, 0.5, {})
    assert score.cell_recall == 0.75
    assert score.detected
    assert score.distance_m == pytest.approx(12.0)
    assert (score.colour_l1, score.delta_e) == (0, 0)
    (missed,) = score_vehicles(predicted, truth, vehicles, EVERYWHERE, 0.7, {})
    assert missed.cell_recall == 0
    assert not missed.detected


def test_simulated_truth_separates_touching_vehicles() -> None:
    truth = bev(CARS, meta={"instances": ["a", "b", "c"]})
    owner = np.full(GRID.shape, -1, np.int64)
    owner[30:32, 19:21], owner[32:34, 19:21] = 2, 0
    owner[0, 0] = 1  # not on in the layer
    vehicles = true_vehicles(truth, owner, None)
    scores = score_vehicles(truth, truth, vehicles, EVERYWHERE, 0.5, {"c": "v0-40", "a": "v80-100"})
    assert [score.visibility for score in scores] == ["v80-100", "v0-40"]
    assert len(score_vehicles(truth, truth, true_vehicles(truth, None, None), EVERYWHERE, 0.5, {})) == 1


def test_annotated_boxes_separate_vehicles() -> None:
    truth = bev(CARS)
    boxes = Boxes(
        centre_m=np.array([[11.0, 0.0, 0.8], [13.0, 0.0, 0.8], [12.0, 0.0, 0.8]]),
        size_wlh_m=np.full((3, 3), 2.0),
        rotation=np.broadcast_to(np.eye(3), (3, 3, 3)).copy(),
        category=("vehicle.car", "vehicle.truck", "human.pedestrian.adult"),
        instance=("a", "b", "walker"),
        token=("1", "2", "3"),
        velocity_mps=np.zeros((3, 2)),
        lidar_points=np.zeros(3, np.int64),
    )
    vehicles = true_vehicles(truth, None, boxes)
    assert [vehicles.owner[30, 19], vehicles.owner[33, 20], vehicles.owner[0, 0]] == [0, 1, -1]
    assert vehicles.instance == ("a", "b")


def test_cells_out_of_range_are_no_part_of_a_vehicle() -> None:
    truth = bev(CARS)
    near = GRID.centres()[..., 0] < 11
    vehicles = true_vehicles(truth, None, None)
    (score,) = score_vehicles(truth, truth, vehicles, near, 0.5, {})
    assert score.distance_m == pytest.approx(10.5)
    assert score_vehicles(truth, truth, vehicles, ~EVERYWHERE, 0.5, {}) == []


def test_the_colour_of_a_vehicle_is_its_mean_colour() -> None:
    checked = np.array([[0, 100], [0, 100], [0, 100]], np.uint8)
    plain = np.full((3, 5), 50, np.uint8)
    assert delta_e(checked, plain) == pytest.approx(0, abs=1e-9)
    red, blue = (np.array(rgb, np.uint8)[:, None] for rgb in ((255, 0, 0), (0, 0, 255)))
    assert delta_e(red, blue) == pytest.approx(52.9, abs=0.1)  # known of these primaries
    assert np.isnan(delta_e(plain[:, :0], plain[:, :0]))


def test_visibility_is_that_of_the_annotation(tiny: TinyDataset) -> None:
    tiny.row("sample_annotation", token("walker", 0))["visibility_token"] = ""
    dataset = Dataset(tiny.write())
    assert visibility_levels(dataset, dataset.sample(token("sample", 0))) == {token("car"): "v80-100"}
