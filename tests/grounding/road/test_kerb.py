from __future__ import annotations

import numpy as np
from street import EGO, Street

from appocc.bevmap import ROAD
from grounding.road.kerb import kerb_gap_m
from grounding.road.road_map import RoadMap


def gap_m(street: Street, y_m: float) -> float:
    scene = street.scene()
    assert scene.bev is not None
    road = RoadMap.from_map(scene.bev, scene.objects, EGO)
    cell = np.array([street.grid.cell_of([20.0, y_m])])
    return float(kerb_gap_m(road, cell, np.zeros(1), -1, 4.0)[0])


def test_the_gap_to_a_free_kerb() -> None:
    assert abs(gap_m(Street(), -6.5) - (1.5 - EGO.width_m / 2)) < 0.4


def test_beside_a_parked_vehicle_there_is_no_kerb() -> None:
    for y_m in (-7.0, -8.6):  # on the road, and beyond its edge on a map that takes its cells for no road
        assert gap_m(Street().car("p", 21, y_m), y_m + 2.4) == np.inf


def test_what_nobody_sees_is_no_kerb() -> None:
    street = Street()
    beyond = (np.abs(street.grid.centres()[..., 0] - 20) < 8) & (street.grid.centres()[..., 1] < -5)
    street.road_known[beyond] = False
    street.occupancy[ROAD][beyond] = 0
    assert gap_m(street, -3.6) == np.inf
