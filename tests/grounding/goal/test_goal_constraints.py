"""What keeps the ego off a place, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest
from goal_plans import (
    LENGTHWISE_M,
    asked,
    check_invariants,
    found,
    named,
    near,
    planned,
    said,
)
from street import BLACK, EGO, RED, Street

from appocc.bevmap import ROAD
from appocc.grid import BEVGrid
from grounding.goal.planner import plan_goal
from grounding.query import Query
from grounding.road.road_map import RoadMap


def test_a_taken_place_moves_the_target_and_the_reason_names_what_took_it() -> None:
    street = Street().car("car", 25, -3, RED).car("blocker", 18.5, -3, BLACK)
    made = planned(street, asked("stop", "behind"))
    assert found(made).ego_m[0] < 18.5 - LENGTHWISE_M + 0.4
    assert found(made).score < 0.5
    assert said(made, "moved 5.2 m from the best place, which is taken by the black car")


def test_one_stops_behind_a_queue_and_parks_beside_the_vehicle_or_not_at_all() -> None:
    street = Street().car("car", 25, -3, RED).car("blocker", 19.5, -3, BLACK)
    assert found(planned(street, asked("stop", "behind"))).ego_m[0] < 19.5 - LENGTHWISE_M
    made = planned(street, asked("park", "behind"))
    assert made.target is None
    assert made.nearest is not None
    assert said(made, "the nearest place that would do is")


def test_one_stays_behind_what_stands_in_the_lane() -> None:
    target = found(planned(Street().car("car", 24, 0), asked("other", direction="straight"), None))
    assert 10 < target.ego_m[0] < 24 - LENGTHWISE_M


def test_the_road_moves_the_target() -> None:
    street = Street().car("car", 20, -3, RED)
    street.occupancy[ROAD, 137:142, :90] = 0  # from 14.8 to 16.8 m ahead, right of y = -4
    made = planned(street, asked("park", "right_of"))
    assert made.target is None or found(made).ego_m[1] > -6
    hole = Street().car("car", 20, -3, RED)
    hole.occupancy[ROAD, 137:142, 85:100] = 0
    made = planned(hole, asked("park", "behind"))
    assert found(made).ego_m[0] + EGO.length_m / 2 <= 15.0  # the middle of the first cell without road
    assert said(made, "leaves the road")


def test_what_is_not_known_is_no_place() -> None:
    street = Street().car("car", 20, -3, RED)
    street.road_known[125:150, :95] = False  # 10 to 20 m ahead, right of y = -2
    made = planned(street, asked("park", "behind"))
    assert made.target is None
    assert said(made, "lies where the map knows nothing")
    nothing = Street().car("car", 20, -3, RED)
    nothing.road_known[:] = False
    made = planned(nothing, asked("park", "behind"))
    assert made.target is made.nearest is None
    assert said(made, "no free road around us is known")


def test_a_place_that_cannot_be_reached_is_none() -> None:
    street = Street().car("car", 30, 0, RED)
    street.occupancy[ROAD, 135:140, :] = 0  # a trench across the whole road
    made = planned(street, asked("stop", "behind"))
    assert made.target is None
    assert said(made, "cannot be reached over free road")
    assert made.nearest is not None
    assert made.nearest.ego_m[0] < 14


@pytest.mark.parametrize(
    ("query", "x_m", "y_m", "reason"),
    [
        (asked("stop", "right_of"), 20, -6.5, "leaves the road"),
        (asked("stop", "in_front_of"), 34, 0, "no place in front of it is free: the best one leaves the map"),
        (asked("stop", "past"), 39.9, 0, "no place beyond it on our way, in line with it lies on the map"),
        (
            asked("stop", "behind", distance_m=60.0, distance_of="referent"),
            10,
            0,
            "no place behind it lies on the map",
        ),
    ],
)
def test_where_nothing_fits_the_failed_constraint_is_named(query: Query, x_m: float, y_m: float, reason: str) -> None:
    made = planned(Street().car("car", x_m, y_m), query)
    assert made.target is None
    assert made.nearest is not None
    assert said(made, reason), made.reasons


def test_the_nearest_place_is_so_far_from_the_vehicle() -> None:
    made = planned(Street().car("car", 34, 0), asked("stop", "behind", distance_m=80.0, distance_of="referent"))
    assert made.nearest is not None
    away_m = np.hypot(*(made.nearest.ego_m - [34, 0]))
    assert away_m < 10
    assert said(made, f"the nearest place that would do is {away_m:.1f} m from it, at (")


def test_what_the_command_rules_out() -> None:
    scene = Street().car("car", 20, -3).car("other", 12, -3, BLACK).scene()
    assert scene.bev is not None
    road = RoadMap.from_map(scene.bev, scene.objects, EGO)
    free = plan_goal(asked("stop", "before"), scene, road, named(scene, "car"))
    forbidden = [("next_to", named(scene, "other"))]
    made = plan_goal(asked("stop", "before"), scene, road, named(scene, "car"), forbidden=forbidden)
    check_invariants(made, scene, road)
    assert near(found(free), 20 - LENGTHWISE_M - 2.0, 0)
    assert not near(found(made), *free.target.ego_m) if free.target else False
    assert said(made, "ruled out by the command")


def test_a_grid_ahead_only() -> None:
    street = Street(BEVGrid.front()).car("car", 20, -3)
    assert near(found(planned(street, asked("stop", "behind"))), 20 - LENGTHWISE_M - 2.0, -3)
    assert near(found(planned(street, asked("stop"), None)), EGO.centre_m + 8, 0)
    here = planned(street, asked("wait"), None)
    assert found(here).ego_m[0] - EGO.length_m / 2 >= 0
    assert said(here, "leaves the map")


def test_the_ego_at_the_rim_and_beyond_it() -> None:
    near_rim = Street(BEVGrid(1.2, 41.2, -40.0, 40.0)).car("car", 20, -3)
    assert near(found(planned(near_rim, asked("stop", "behind"))), 20 - LENGTHWISE_M - 2.0, -3)
    beyond = Street(BEVGrid(20.0, 60.0, -40.0, 40.0)).car("car", 40, -3)
    made = planned(beyond, asked("stop", "behind"))
    assert made.target is None
    assert said(made, "no free road around us is known")
