from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_pair import GRID, bev

from appocc.bevmap import ROAD, bev_path
from appocc.errors import DataError
from appocc.evaluation.pairs import read_map_pair
from appocc.grid import BEVGrid

AHEAD = BEVGrid(0.0, 20.0, -20.0, 20.0, 1.0)


def test_maps_and_arrays_are_cropped_to_the_cells_ahead(tmp_path: Path) -> None:
    instance = np.arange(1600, dtype=np.int32).reshape(40, 40)
    bev({ROAD: np.s_[25:30, 3:5]}).save(bev_path(tmp_path, "exact", "a"), {"instance": instance})
    seen = np.eye(20, 40, dtype=np.bool_)
    bev({ROAD: np.s_[5:10, 3:5]}, grid=AHEAD).save(bev_path(tmp_path, "mine", "a"), {"seen": seen})
    pair = read_map_pair(tmp_path, "mine", "exact", "a", ahead=True)
    assert pair.truth.grid == pair.predicted.grid == AHEAD
    assert (pair.truth.occupancy == pair.predicted.occupancy).all()
    assert pair.instance is not None
    assert (pair.instance == instance[20:]).all()
    assert pair.seen is not None
    assert (pair.seen == seen).all()
    with pytest.raises(DataError, match="try --setting 180"):
        read_map_pair(tmp_path, "mine", "exact", "a", ahead=False)


def test_maps_without_more_arrays(tmp_path: Path) -> None:
    bev().save(bev_path(tmp_path, "exact", "a"))
    pair = read_map_pair(tmp_path, "exact", "exact", "a", ahead=False)
    assert (pair.instance, pair.seen) == (None, None)
    assert pair.predicted.grid == GRID


def test_an_array_of_another_shape_is_refused(tmp_path: Path) -> None:
    bev().save(bev_path(tmp_path, "exact", "a"), {"instance": np.zeros((3, 3), np.int32)})
    with pytest.raises(DataError, match="expected 'seen' and 'instance'"):
        read_map_pair(tmp_path, "exact", "exact", "a", ahead=False)


@pytest.mark.parametrize("kept", [{"road": 0.5}, 0.5, {"road": 0.5, "vehicle": 2, "lane": 0.5}])
def test_thresholds_are_shares_of_all_classes(kept: object) -> None:
    with pytest.raises(DataError, match="expected a share for each of road, vehicle, lane"):
        _ = bev(meta={"thresholds": kept}).thresholds
    assert bev().thresholds is None
