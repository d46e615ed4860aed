from __future__ import annotations

import numpy as np

from tracking.instances.watershed import split_by_watershed, suppress_below_peak


def test_each_group_has_its_own_peak() -> None:
    probability = np.array([[0.6, 0.8, 0.9, 0.0, 0.5, 0.6]], np.float32)
    labels = np.array([[1, 1, 1, 0, 2, 2]])
    assert suppress_below_peak(labels, 2, probability, 0.8) == 2
    assert labels.tolist() == [[0, 1, 1, 0, 2, 2]]


def test_what_falls_apart_is_cut() -> None:
    probability = np.array([[0.9, 0.5, 0.8]], np.float32)
    labels = np.array([[1, 1, 1]])
    assert suppress_below_peak(labels, 1, probability, 0.75) == 2
    assert labels.tolist() == [[1, 0, 2]]


def test_cells_at_the_share_itself_stay() -> None:
    labels = np.array([[1, 1]])
    assert suppress_below_peak(labels, 1, np.array([[1.0, 0.75]], np.float32), 0.75) == 1
    assert labels.tolist() == [[1, 1]]


def test_no_groups_stay_none() -> None:
    labels = np.zeros((3, 4), np.int64)
    nothing = np.zeros((3, 4), np.float32)
    assert suppress_below_peak(labels, 0, nothing, 0.75) == 0
    assert split_by_watershed(labels, 0, nothing, 0.4) == 0


def test_a_valley_is_where_the_cut_goes() -> None:
    """Two cars of 12 x 5 cells in one row, and one cell of low probability between them."""
    labels = np.zeros((29, 9), np.int64)
    labels[2:27, 2:7] = 1
    probability = np.where(labels > 0, 0.95, 0.0).astype(np.float32)
    probability[14, 2:7] = 0.75
    assert split_by_watershed(labels, 1, probability, 0.4) == 2
    assert np.unique(labels[2:14, 2:7]).tolist() == [1]
    assert np.unique(labels[15:27, 2:7]).tolist() == [2]
    assert np.bincount(labels.ravel())[1:].sum() == 125


def test_a_lorry_with_a_peak_over_its_cab_is_one_lorry() -> None:
    """21 x 6 cells, 8.4 m x 2.4 m."""
    labels = np.zeros((25, 10), np.int64)
    labels[2:23, 2:8] = 1
    probability = np.where(labels > 0, 0.95, 0.0).astype(np.float32)
    probability[8, 2:8] = 0.75
    assert split_by_watershed(labels, 1, probability, 0.4) == 1


def test_small_and_flat_components_are_not_split() -> None:
    labels = np.zeros((40, 20), np.int64)
    labels[2:14, 2:6] = 1  # 7.7 m2
    labels[16:36, 2:14] = 2
    before = labels.copy()
    probability = np.where(labels > 0, 0.9, 0.0).astype(np.float32)
    probability[8, 2:6] = 0.6
    assert split_by_watershed(labels, 2, probability, 0.4) == 2
    np.testing.assert_array_equal(labels, before)


def test_a_ripple_is_no_valley() -> None:
    labels = np.zeros((29, 9), np.int64)
    labels[2:27, 2:7] = 1
    probability = np.where(labels > 0, 0.95, 0.0).astype(np.float32)
    probability[14, 2:7] = 0.945
    assert split_by_watershed(labels, 1, probability, 0.4) == 1


def test_saturated_probabilities_have_no_valleys() -> None:
    labels = np.zeros((29, 9), np.int64)
    labels[2:27, 2:7] = 1
    probability = np.where(labels > 0, 1.0, 0.0).astype(np.float32)
    probability[14, 2:7] = 0.999
    assert split_by_watershed(labels, 1, probability, 0.4) == 1
