from __future__ import annotations

import numpy as np
from made_pair import GRID, bev, without

from appocc.bevmap import LANE, ROAD, VEHICLE
from appocc.evaluation.cells import (
    GROUPS,
    CellCounts,
    cell_group_masks,
    count_cells,
    ious,
    l1_by_class,
    ratio,
    threshold_rows,
)

EVERYWHERE = np.ones(GRID.shape, np.bool_)
MASKS = cell_group_masks(GRID, EVERYWHERE, None)
HALF = threshold_rows(None)


def test_overlap_is_counted_by_class() -> None:
    truth = bev({ROAD: np.s_[0:10, 0:10], VEHICLE: np.s_[20:22, 20:24]})
    predicted = bev({ROAD: np.s_[5:15, 0:10], VEHICLE: np.s_[20:22, 20:24]})
    counts = count_cells(predicted, truth, MASKS, HALF)
    assert counts.overlap[0, 0].tolist() == [[50, 150], [8, 8], [0, 0]]
    found = ious(counts.overlap[0, 0])
    assert found["road"] == 50 / 150
    assert found["vehicle"] == 1
    assert np.isnan(found["lane"])


def test_all_maps_are_compared_on_the_known_cells_of_the_truth() -> None:
    truth, predicted = bev({ROAD: np.s_[0:10, 0:10]}), bev({ROAD: np.s_[0:10, 0:20]}, rgb=(130, 100, 100))
    counts = count_cells(without(predicted, np.s_[:, 10:]), without(truth, np.s_[0:5, :]), MASKS, HALF)
    assert counts.overlap[0, 0, ROAD].tolist() == [
        50,
        100,
    ]  # guesses count too
    assert counts.colour[0, 0].tolist() == [35 * 10 * 10.0, 350]
    assert counts.known.tolist() == [35 * 40, 350]


def test_a_class_without_valid_cells_is_not_evaluated() -> None:
    truth, predicted = bev({ROAD: np.s_[0:10, 0:10]}), bev({})
    assert np.isnan(ious(count_cells(without(predicted, np.s_[:, :]), truth, MASKS, HALF).overlap[0, 0])["road"])
    assert ious(count_cells(predicted, truth, MASKS, HALF).overlap[0, 0])["road"] == 0


def test_thresholds_are_those_of_the_classes() -> None:
    truth, predicted = (
        bev({ROAD: np.s_[0:4, :], LANE: np.s_[0:4, :]}),
        bev({ROAD: np.s_[:, :], LANE: np.s_[:, :]}, 0.4),
    )
    rows = threshold_rows({"road": 0.3, "vehicle": 0.5, "lane": 0.45})
    overlap = count_cells(predicted, truth, MASKS, rows).overlap[:, 0]
    assert overlap[:, ROAD].tolist() == [[0, 160], [160, 1600]]
    assert overlap[:, LANE].tolist() == [[0, 160], [0, 160]]


def test_rings_and_sight_split_the_cells() -> None:
    seen = GRID.centres()[..., 0] > 0
    masks = dict(zip(GROUPS, cell_group_masks(GRID, EVERYWHERE, seen), strict=True))
    assert masks["0-10 m"][20, 20]
    assert not masks["0-10 m"][31, 20]
    assert masks["10-20 m"][31, 20]
    assert masks["20-30 m"][0, 0]
    assert not any(masks[f"{low}-{low + 10} m"][0, 0] for low in (0, 10, 30))
    assert (masks["seen"] ^ masks["unseen"]).all()
    near = np.linalg.norm(GRID.centres(), axis=-1) <= 5
    assert (cell_group_masks(GRID, near, None)[0] == near).all()
    assert not cell_group_masks(GRID, near, None)[-2:].any()


def test_colours_are_compared_by_the_true_class() -> None:
    truth = bev({VEHICLE: np.s_[0:2, 0:2]}, rgb=(10, 20, 30))
    predicted = bev({ROAD: np.s_[:, :]}, rgb=(13, 20, 24))
    counts = count_cells(predicted, truth, MASKS, HALF)
    found = l1_by_class(counts.colour[0])
    assert found["vehicle"] == 3.0
    assert counts.colour[0, 2].tolist() == [12, 4]
    assert np.isnan(found["road"])


def test_sums_of_maps_add_up() -> None:
    pairs = [(bev({ROAD: np.s_[0:n, :]}), bev({ROAD: np.s_[0:5, :]})) for n in (2, 9)]
    total = CellCounts.zeros(1)
    for predicted, truth in pairs:
        total = total.plus(count_cells(predicted, truth, MASKS, HALF))
    assert total.overlap[0, 0, ROAD].tolist() == [(2 + 5) * 40, (5 + 9) * 40]
    assert np.isnan(ratio(0, 0))
