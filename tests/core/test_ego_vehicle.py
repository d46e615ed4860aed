from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from appocc.ego_vehicle import EgoVehicle
from appocc.errors import ShapeError
from appocc.grid import BEVGrid


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"length_m": 0.0}, "length_m: expected metres above 0 and below 100, got 0"),
        ({"width_m": -1.9}, "width_m"),
        ({"turning_circle_m": float("nan")}, "turning_circle_m"),
        ({"rear_overhang_m": 4.6}, r"rear_overhang_m: expected less than length_m \(4.6\), got 4.6"),
    ],
)
def test_impossible_dimensions_are_refused(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        EgoVehicle(**changes)


def test_body_cells_are_those_whose_centre_is_below_the_body() -> None:
    body = EgoVehicle(length_m=4.0, width_m=2.0, rear_overhang_m=1.0).body_cells(BEVGrid(-4, 4, -4, 4, 1.0))
    assert np.argwhere(body).tolist() == [[x, y] for x in (3, 4, 5, 6) for y in (3, 4)]


def test_the_centre_is_ahead_of_the_rear_axle() -> None:
    assert EgoVehicle().centre_m == pytest.approx(1.3)
    assert EgoVehicle(length_m=12.0, rear_overhang_m=3.5).centre_m == pytest.approx(2.5)
