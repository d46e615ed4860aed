from __future__ import annotations

import numpy as np

from tracking.tracks import Memory


def test_the_median_forgets_outliers_and_what_is_long_ago() -> None:
    memory = Memory(3)
    for value in (100.0, 4.0, 5.0):
        memory.add(np.array([value]))
    assert memory.median() == [5.0]
    memory.add(np.array([4.5]))
    assert memory.median() == [4.5]


def test_unknown_values_do_not_count() -> None:
    memory = Memory(5)
    memory.add(np.array([np.nan, np.nan]))
    np.testing.assert_array_equal(memory.median(), [np.nan, np.nan])
    memory.add(np.array([2.0, np.nan]))
    np.testing.assert_array_equal(memory.median(), [2.0, np.nan])
