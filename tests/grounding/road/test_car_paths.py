"""Ways of the ego as a car drives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from appocc.checks import BoolArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.grid import BEVGrid
from grounding.road.car_paths import CarPaths, CarRoute
from grounding.road.pose import Pose2D
from grounding.road.reeds_shepp import words_to

GRID, EGO = BEVGrid(-20.0, 40.0, -20.0, 20.0, 0.4), EgoVehicle()
X, Y = np.moveaxis(GRID.centres(), -1, 0)


def cars_on(free: BoolArray, most_back_m: float = 10.0) -> CarPaths:
    clearance = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * GRID.cell_m
    return CarPaths(GRID, EGO, Pose2D(EGO.centre_m, 0.0), clearance, np.zeros(GRID.shape), most_back_m)


def route(cars: CarPaths, x_m: float, y_m: float, heading_rad: float = 0.0) -> CarRoute | None:
    i, j = GRID.cell_of([x_m, y_m]).tolist()
    return cars.route_to((i, j), heading_rad)


def check_drivable(made: CarRoute, free: BoolArray) -> None:
    """The heading follows the way, no bend is tighter than the turning circle, the footprint stays on free cells."""
    ahead = np.stack([np.cos(made.heading_rad), np.sin(made.heading_rad)], axis=-1)
    rear = made.points_m - EGO.centre_m * ahead
    step, turned = np.diff(rear, axis=0), np.diff(made.heading_rad)
    length = np.hypot(*step.T)
    middle = made.heading_rad[:-1] + turned / 2
    along = (step * np.stack([np.cos(middle), np.sin(middle)], axis=-1)).sum(axis=1)
    assert np.abs(along) == pytest.approx(length, abs=0.02)
    assert ((along < 0) == made.backwards[1:])[length > 0.01].all()
    assert (np.abs(turned) <= length * 1.02 / EGO.turning_radius_m + 1e-6).all()
    for centre, unit in zip(made.points_m, ahead, strict=True):
        offset = np.stack([X, Y], axis=-1) - centre
        under = (np.abs(offset @ unit) < EGO.length_m / 2 - 0.5) & (
            np.abs(offset @ [-unit[1], unit[0]]) < EGO.width_m / 2 - 0.25
        )
        assert free[under].all()


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("place", [(3.0, 1.0), (-1.0, 2.0), (0.5, -0.2)])
def test_curves_end_where_they_should(place: tuple[float, float], turn: float) -> None:
    for word in words_to(*place, turn):
        x = y = angle = 0.0
        for length, bend in zip(word[:3], word[3:], strict=True):
            end = angle + length * bend
            if bend:
                x, y = x + (np.sin(end) - np.sin(angle)) / bend, y - (np.cos(end) - np.cos(angle)) / bend
            else:
                x, y = x + length * np.cos(angle), y + length * np.sin(angle)
            angle = end
        assert [x, y] == pytest.approx(place)
        assert np.cos(angle - turn) == pytest.approx(1)


STREET = np.abs(Y) < 6.0
GOALS = [(20.0, 0.0, 0.0), (15.0, 3.0, 0.3), (12.0, 4.0, np.pi), (-8.0, 0.0, 0.0)]


@pytest.mark.parametrize(("x_m", "y_m", "heading_rad"), GOALS)
def test_a_way_ends_at_its_goal_and_can_be_driven(x_m: float, y_m: float, heading_rad: float) -> None:
    made = route(cars_on(STREET), x_m, y_m, heading_rad)
    assert made is not None
    check_drivable(made, STREET)
    assert made.points_m[0] == pytest.approx([EGO.centre_m, 0.0], abs=0.01)
    assert made.points_m[-1] == pytest.approx([x_m, y_m], abs=0.3)
    assert np.cos(made.heading_rad[-1] - heading_rad) == pytest.approx(1, abs=1e-4)
    assert made.length_m == pytest.approx(np.hypot(*np.diff(made.points_m, axis=0).T).sum())


def test_straight_on_needs_no_bend() -> None:
    made = route(cars_on(STREET), 21.4, 0.2)
    assert made is not None
    assert made.length_m == pytest.approx(20.1, abs=0.2)
    assert made.backwards_m == 0


def test_reversing_is_limited() -> None:
    lane = (np.abs(Y) < 1.8) & (X > -18)  # too narrow to turn
    assert route(cars_on(lane), -6.0, 0.0) is not None
    assert route(cars_on(lane), -12.0, 0.0) is None
    far = route(cars_on(lane, most_back_m=20.0), -12.0, 0.0)
    assert far is not None
    assert far.backwards_m == pytest.approx(13.3, abs=0.5)


def test_a_narrow_street_gives_no_room_to_turn_round() -> None:
    assert route(cars_on(np.abs(Y) < 2.0), 15.0, 0.0, np.pi) is None
    turned = route(cars_on(STREET), 3.0, 3.0, np.pi)
    assert turned is not None
    assert turned.turned_rad > np.radians(150)


def test_a_gap_in_a_row_is_entered_backwards() -> None:
    free = STREET & ~((Y < -3.6) & ((np.abs(X - 9) < 2.3) | (np.abs(X - 21) < 2.3)))  # 7.4 m apart
    made = route(cars_on(free), 15.0, -4.8)
    assert made is not None
    check_drivable(made, free)
    assert 0 < made.backwards_m <= 10


def test_costs_tell_what_is_near_a_way() -> None:
    cars = cars_on(STREET & (X < 25))
    cells = GRID.cell_of(np.array([[10.0, 0.0], [20.0, 0.0], [35.0, 0.0]]))
    near, far, beyond = cars.cost_to(cells, np.zeros(3))
    assert near < far < beyond == np.inf


def test_the_ego_begins_beyond_the_map_or_on_a_blocked_cell() -> None:
    assert route(cars_on(STREET & (X > 2.5)), 15.0, 0.0) is not None
    outside = BEVGrid(1.2, 41.2, -8.0, 8.0, 0.4)
    clearance = np.minimum(np.abs(np.abs(outside.centres()[..., 1]) - 8.0), 5.0)
    paths = CarPaths(outside, EGO, Pose2D(EGO.centre_m, 0.0), clearance, np.zeros(outside.shape))
    i, j = outside.cell_of([15.0, 0.2]).tolist()
    assert paths.route_to((i, j), 0.0) is not None


def test_the_turning_radius_of_the_rear_axle() -> None:
    assert EGO.turning_radius_m == pytest.approx(3.81, abs=0.01)
    wide = EgoVehicle(turning_circle_m=13.0)
    assert wide.turning_radius_m > EGO.turning_radius_m
    start: FloatArray = np.zeros(2)
    assert Pose2D(*start).ahead == pytest.approx([1.0, 0.0])


def test_a_place_just_ahead_needs_no_reversing() -> None:
    free = np.asarray(np.abs(Y) < 3)
    for ahead_m in (0.6, 1.4, 2.2):
        made = route(cars_on(free), EGO.centre_m + ahead_m, 0.1)
        assert made is not None
        assert made.backwards_m == 0
        assert made.length_m < ahead_m + 0.5
