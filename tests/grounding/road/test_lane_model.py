from __future__ import annotations

import numpy as np
import pytest
from street import EGO, Street

from appocc.bevmap import LANE, ROAD
from appocc.checks import FloatArray
from appocc.motion_state import MOVING_MPS, STANDING_MPS
from grounding.road.lane_model import LANE_M, LaneModel, LaneTraffic, lanes_from_map, lanes_from_vehicles
from grounding.road.road_map import RoadMap

BENDS = [0.0, 0.004, -0.006, 0.012]


def traffic(*rows: tuple[float, float, float, float]) -> LaneTraffic:
    """Vehicles from rows of x, y, heading in degrees and speed."""
    values = np.array(rows, dtype=np.float64).reshape(-1, 4)
    known = np.ones(len(values), np.bool_)
    return LaneTraffic(
        values[:, :2], np.radians(values[:, 2]), known, values[:, 3] > MOVING_MPS, values[:, 3] < STANDING_MPS
    )


def without_map(*rows: tuple[float, float, float, float]) -> LaneModel:
    return lanes_from_vehicles(traffic(*rows))


def on_map(street: Street, *rows: tuple[float, float, float, float]) -> LaneModel:
    bev = street.bev()
    road = RoadMap.from_map(bev, (), EGO)
    return lanes_from_map(traffic(*rows), bev, road.ego_lane, road.traffic_side > 0, EGO)


def on_bend(bend_per_m: float, along_m: FloatArray, sideways_m: float) -> tuple[FloatArray, FloatArray]:
    """Positions and directions on a curved road."""
    angle = bend_per_m * along_m
    return np.stack([along_m, bend_per_m * along_m**2 / 2 + sideways_m], axis=1), angle


def test_without_evidence_the_road_is_straight_ahead() -> None:
    found = without_map()
    assert (found.lowest, found.highest, found.oncoming_left) == (0, 0, True)
    along, sideways = found.project(np.array([[12.0, -3.0], [-5.0, 2.0], [110.0, 4.0]]))
    assert along == pytest.approx([12, -5, 110])
    assert sideways == pytest.approx([-3, 2, 4])
    assert found.direction_rad(np.array([[50.0, 8.0]])) == pytest.approx([0])


@pytest.mark.parametrize("bend", BENDS)
def test_vehicles_show_the_curvature(bend: float) -> None:
    rows = []
    for sideways in (-3.5, 0.0, 3.5):
        places, angle = on_bend(bend, np.arange(6.0, 45.0, 8.0), sideways)
        rows += [(x, y, np.degrees(a), 8.0) for (x, y), a in zip(places, angle, strict=True)]
    places, angle = on_bend(bend, np.array([15.0, 30.0]), 3.5)
    found = without_map(*rows)
    assert found.project(places)[1] == pytest.approx([3.5, 3.5], abs=0.7)
    assert found.direction_rad(places) == pytest.approx(angle, abs=0.06)


@pytest.mark.parametrize("bend", [*BENDS, 0.025])
def test_a_map_shows_the_curvature(bend: float) -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    off = y - bend * x**2 / 2
    street.occupancy[ROAD] = np.abs(off) < 7
    for line in (-7.0, -3.5, 1.75, 5.25):
        street.occupancy[LANE][np.abs(off - line) < 0.2] = 1
    places, angle = on_bend(bend, np.array([12.0, 24.0]), 3.5)
    found = on_map(street)
    assert found.project(places)[1] == pytest.approx(3.5 * np.cos(angle), abs=1.2)
    assert found.direction_rad(places) == pytest.approx(np.arctan(angle), abs=0.15)


def test_a_crossing_vehicle_is_ignored() -> None:
    found = without_map((15, 0, 90, 8), (20, 3, -60, 8))
    assert found.direction_rad(np.array([[20.0, 0.0]])) == pytest.approx([0], abs=1e-6)


def test_offset_points_project_back_to_their_offsets() -> None:
    lanes = without_map((10, 0, 5, 8), (22, 2, 10, 8), (34, 6, 16, 8))
    ways = np.array([5.0, 20.0, 40.0])
    for sideways in (-3.5, 0.0, 3.5):
        along, found = lanes.project(lanes.centreline.offset_points(ways, sideways))
        assert found == pytest.approx(np.full(3, sideways), abs=0.1)
        assert along == pytest.approx(ways, abs=0.6)


@pytest.mark.parametrize(("y_m", "left"), [(6.0, True), (-6.0, False)])
def test_oncoming_traffic_shows_the_side_of_traffic(y_m: float, left: bool) -> None:
    assert without_map((20, y_m, 180, 8)).oncoming_left is left
    assert without_map((20, -3.5, 0, 8)).oncoming_left


def test_lanes_driven_in_our_direction_count() -> None:
    found = without_map((15, 3.5, 0, 8), (25, -3.4, 1, 8), (20, 7.2, 180, 8))
    assert (found.lowest, found.highest) == (-1, 1)


def street_of_lanes(lowest: float, highest: float) -> Street:
    """A street with lanes from `lowest` to `highest`; ours is 0."""
    street = Street()
    lane = street.grid.centres()[0, :, 1] / LANE_M
    street.occupancy[ROAD] = 0
    street.occupancy[ROAD][:, (lane > lowest - 0.5) & (lane < highest + 0.5)] = 1
    return street


def test_a_parked_row_is_not_a_lane() -> None:
    street = street_of_lanes(-1, 1)
    assert on_map(street, (15, 3.5, 180, 8)).lowest == -1
    found = on_map(street, (15, 3.5, 180, 8), (12, -3.5, 0, 0), (20, -3.5, 0, 0))
    assert (found.lowest, found.highest) == (0, 0)


def test_half_of_an_empty_road_belongs_to_the_other_direction() -> None:
    street = street_of_lanes(0, 3)
    assert (on_map(street).lowest, on_map(street).highest) == (0, 1)
    assert on_map(street, (15, 7, 0, 8)).highest == 2


def test_a_mirrored_street_has_mirrored_lanes() -> None:
    rows = [(10.0, 3.0, 5.0, 8.0), (22.0, -2.0, 9.0, 8.0), (30.0, 1.0, 14.0, 0.0), (33.0, 8.0, 190.0, 6.0)]
    one, other = without_map(*rows), without_map(*((x, -y, -yaw, speed) for x, y, yaw, speed in rows))
    assert other.centreline.points_m == pytest.approx(one.centreline.points_m * [1, -1], abs=1e-9)
    assert (other.lowest, other.highest, other.oncoming_left) == (-one.highest, -one.lowest, not one.oncoming_left)
