"""Other roads: turns, and where our lane ends."""

from __future__ import annotations

import numpy as np
import pytest
from goal_plans import (
    asked,
    found,
    near,
    planned,
    said,
)
from street import EGO, HALF_ROAD_M, Street

from appocc.bevmap import LANE, ROAD


def test_one_turns_around_to_the_side_of_those_that_come_towards_us() -> None:
    street = Street().car("car", 30, -3.5, yaw_rad=np.pi, speed_mps=5)
    assert near(found(planned(street, asked("turn", direction="around"), None)), EGO.centre_m + 3, -3.5)


def test_where_our_lane_ends_one_goes_on_along_another_road() -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD] = ((np.abs(y) < 3) & (x < 14)) | ((np.abs(x - 10) < 4) & (y > -3))
    made = planned(street, asked("stop", distance_m=25.0, distance_of="ego"), None)
    target = found(made)
    assert target.ego_m[1] > 8
    assert target.heading_ego_rad == pytest.approx(np.pi / 2, abs=0.1)
    dead_end = Street()
    dead_end.occupancy[ROAD] = (np.abs(y) < 3) & (x < 8)
    made = planned(dead_end, asked("change_lane", direction="left"), None)
    assert made.target is None
    assert said(made, "our lane ends 6 m ahead")


def crossing(*at_m: float) -> Street:
    """A street with side roads of 8 m width to the left at some distances, and the way there marked."""
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    for middle_m in at_m:
        street.occupancy[ROAD, (np.abs(x - middle_m) < 4) & (y > 0)] = 1
    street.occupancy[LANE, (np.abs(y) < 0.2) & (x % 4 < 2)] = 1
    return street


def test_a_turn_leads_onto_the_first_road_on_that_side() -> None:
    target = found(planned(crossing(15), asked("turn", direction="left"), None))
    assert target.heading_ego_rad == pytest.approx(np.pi / 2, abs=0.1)
    assert target.ego_m[1] > HALF_ROAD_M
    assert 15 < target.ego_m[0] < 19  # its right half
    made = planned(crossing(15), asked("turn", direction="right"), None)
    assert made.target is None


@pytest.mark.parametrize(("relation", "x_m"), [("before", 8), ("past", 30), ("next_to", 30)])
def test_a_turn_before_or_past_a_vehicle(relation: str, x_m: float) -> None:
    street = crossing(8, 30).car("car", 22, -5)
    target = found(planned(street, asked("turn", relation, direction="left")))
    assert abs(target.ego_m[0] - x_m) < 4
    assert target.ego_m[1] > HALF_ROAD_M


def test_no_road_past_a_vehicle() -> None:
    made = planned(crossing(8).car("car", 22, -5), asked("turn", "past", direction="left"))
    assert made.target is None
    assert said(made, "no road that branches off to the left past it")
