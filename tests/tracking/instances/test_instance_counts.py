"""The counts of `benchmarks.blobs` on maps made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from made_map import BLUE, RED, Car, boxes_of, map_of

from appocc.bevmap import BEVMap
from appocc.rasterise import vehicle_owner
from benchmarks.blobs import Frame, Sums, count, pairs_of
from tracking.instances.instances import InstanceConfig, measure_instances


def counted(bev: BEVMap, cars: list[Car], split: bool = True) -> dict[float, Sums]:
    """Sums within 20 m and 40 m of a map whose true vehicles are some cars."""
    truth = map_of(cars)
    owner = vehicle_owner(truth.grid, boxes_of(cars)).astype(np.int64) + 1
    sums = {20.0: Sums(), 40.0: Sums()}
    count(Frame(bev, truth, owner, measure_instances(truth, owner, len(cars))), InstanceConfig(split=split), sums)
    return sums


def figures(sums: Sums) -> list[int]:
    """Vehicles, instances, pairs, merged, split."""
    return [sums.vehicles, sums.blobs, sums.pairs, sums.merged, sums.split]


def test_the_truth_itself_has_no_errors() -> None:
    cars = [Car(5.0, 0.0, rgb=RED), Car(-10.0, 3.0, 0.3, BLUE), Car(30.0, 3.0)]
    sums = counted(map_of(cars), cars)
    assert figures(sums[20.0]) == [2, 2, 2, 0, 0]
    assert figures(sums[40.0]) == [3, 3, 3, 0, 0]
    np.testing.assert_allclose(np.concatenate(sums[40.0].errors), np.zeros((3, 4)), atol=1e-9)
    assert sums[40.0].row() == ["3", "3", "0", "0", "100.0", "0", "0", "0.00", "0.00", "0.00", "0.00"]


def test_two_in_one_blob_are_merged() -> None:
    cars = [Car(5.0, 0.0), Car(9.6, 0.0)]
    assert figures(counted(map_of(cars), cars, split=False)[20.0]) == [2, 1, 0, 1, 0]


def test_one_in_two_blobs_is_split() -> None:
    halves = [Car(4.0, 0.0, length_m=1.6), Car(6.4, 0.0, length_m=1.6)]
    assert figures(counted(map_of(halves), [Car(5.2, 0.0)])[20.0]) == [1, 2, 1, 0, 1]


def test_missed_and_false_ones_are_counted() -> None:
    sums = counted(map_of([Car(5.0, 0.0), Car(-12.0, 5.0)]), [Car(5.0, 0.0), Car(0.0, -9.0)])
    assert figures(sums[20.0]) == [2, 2, 1, 0, 0]
    assert sums[20.0].row()[2:5] == ["1", "1", "50.0"]


def test_a_map_of_nothing_has_no_errors_to_tell() -> None:
    sums = counted(map_of([]), [])
    assert sums[20.0].row() == ["0", "0", "0", "0", "0.0", "0", "0", "nan", "nan", "nan", "nan"]


def test_pairs_are_near_and_one_to_one() -> None:
    rows, columns = pairs_of(np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]]), np.array([[1.2, 0.0], [6.9, 0.0]]))
    assert (rows.tolist(), columns.tolist()) == ([1], [0])


def test_colour_errors_are_of_the_map_that_is_judged() -> None:
    cars = [Car(5.0, 0.0, rgb=RED)]
    sums = counted(map_of([cars[0]._replace(rgb=BLUE)]), cars)
    place, size, mean, robust = np.concatenate(sums[20.0].errors)[0]
    assert (place, size) == (0.0, 0.0)
    assert mean > 30
    assert mean == pytest.approx(robust)
