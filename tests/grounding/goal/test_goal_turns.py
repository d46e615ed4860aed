"""Goals on other roads: turns, and the end of the ego lane."""

from __future__ import annotations

import numpy as np
import pytest
from goal_plans import (
    has_reason,
    is_near,
    make_query,
    plan_in,
    target_of,
)
from street import HALF_ROAD_M, Street

from appocc.bevmap import LANE, ROAD


def test_a_u_turn_goes_to_the_side_of_oncoming_traffic() -> None:
    street = Street().car("car", 30, -3.5, yaw_rad=np.pi, speed_mps=5)
    assert is_near(target_of(plan_in(street, make_query("turn", direction="around"), None)), 5.0, -3.5)


def test_beyond_the_end_of_the_ego_lane_the_goal_is_on_another_road() -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD] = ((np.abs(y) < 3) & (x < 14)) | ((np.abs(x - 10) < 4) & (y > -3))
    made = plan_in(street, make_query("stop", distance_m=25.0, distance_of="ego"), None)
    target = target_of(made)
    assert target.ego_m[1] > 8
    assert target.heading_ego_rad == pytest.approx(np.pi / 2, abs=0.1)
    dead_end = Street()
    dead_end.occupancy[ROAD] = (np.abs(y) < 3) & (x < 8)
    made = plan_in(dead_end, make_query("change_lane", direction="left"), None)
    assert made.target is None
    assert has_reason(made, "our lane ends 6 m ahead")


def crossing(*at_m: float) -> Street:
    """A street with lane markings and side roads of 8 m width to the left, at some distances."""
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    for middle_m in at_m:
        street.occupancy[ROAD, (np.abs(x - middle_m) < 4) & (y > 0)] = 1
    street.occupancy[LANE, (np.abs(y) < 0.2) & (x % 4 < 2)] = 1
    return street


def test_a_turn_leads_to_the_first_side_road() -> None:
    target = target_of(plan_in(crossing(15), make_query("turn", direction="left"), None))
    assert target.heading_ego_rad == pytest.approx(np.pi / 2, abs=0.1)
    assert target.ego_m[1] > HALF_ROAD_M
    assert 15 < target.ego_m[0] < 19  # its right half
    made = plan_in(crossing(15), make_query("turn", direction="right"), None)
    assert made.target is None


@pytest.mark.parametrize(("relation", "x_m"), [("before", 8), ("past", 30), ("next_to", 30)])
def test_a_turn_before_or_past_a_vehicle(relation: str, x_m: float) -> None:
    street = crossing(8, 30).car("car", 22, -5)
    target = target_of(plan_in(street, make_query("turn", relation, direction="left")))
    assert abs(target.ego_m[0] - x_m) < 4
    assert target.ego_m[1] > HALF_ROAD_M


def test_no_road_past_a_vehicle() -> None:
    made = plan_in(crossing(8).car("car", 22, -5), make_query("turn", "past", direction="left"))
    assert made.target is None
    assert has_reason(made, "no road that branches off to the left past it")


@pytest.mark.parametrize("text", ["go round the corner", "nip round the bend", "take us round the next corner"])
def test_the_corner_is_the_only_side_road_there_is(text: str) -> None:
    answer = crossing(15).grounder().ground(text)
    assert answer.target is not None, answer.text()
    assert answer.target.ego_m[1] > HALF_ROAD_M
    assert answer.target.heading_ego_rad == pytest.approx(np.pi / 2, abs=0.3)


def test_a_corner_without_a_side_road_is_told() -> None:
    answer = Street().grounder().ground("go round the corner")
    assert answer.status == "not_found"
    assert "no corner ahead" in answer.text()


def test_where_both_sides_have_a_road_the_side_is_asked_for() -> None:
    street = crossing(15)
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD, (np.abs(x - 15) < 4) & (y < 0)] = 1
    answer = street.grounder().ground("drive round the corner")
    assert answer.status == "not_found"
    assert "to the left and to the right" in answer.text()


def test_our_lane_round_a_bend_is_the_corner() -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD] = ((np.abs(y) < 3) & (x < 18)) | ((np.abs(x - 15) < 3) & (y > -3))
    answer = street.grounder().ground("go round the bend")
    assert answer.target is not None, answer.text()
    assert answer.target.ego_m[1] > 4
