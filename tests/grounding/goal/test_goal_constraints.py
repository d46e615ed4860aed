"""Constraints on goal poses, and how violations are reported."""

from __future__ import annotations

import numpy as np
import pytest
from goal_plans import (
    LENGTHWISE_M,
    check_invariants,
    has_reason,
    is_near,
    make_query,
    object_named,
    plan_in,
    target_of,
)
from street import BLACK, EGO, RED, Street

from appocc.bevmap import ROAD
from appocc.grid import BEVGrid
from grounding.goal.exclusions import ExcludedPlace
from grounding.goal.planner import plan_goal
from grounding.query import Query
from grounding.road.road_map import RoadMap


def test_a_place_beyond_another_vehicle_is_not_behind_the_one_that_is_named() -> None:
    street = Street().car("car", 25, -3, RED).car("blocker", 18.5, -3, BLACK)
    made = plan_in(street, make_query("stop", "behind"))
    assert made.target is None
    assert made.nearest is not None
    assert has_reason(made, "no place behind it will do: the best one is taken by the black car")


def test_a_queue_rules_out_parking() -> None:
    street = Street().car("car", 25, -3, RED).car("blocker", 19.5, -3, BLACK)
    made = plan_in(street, make_query("park", "behind"))
    assert made.target is None
    assert made.nearest is not None
    assert has_reason(made, "the nearest place that would do is")


def test_the_goal_is_behind_obstacles_in_the_lane() -> None:
    target = target_of(plan_in(Street().car("car", 24, 0), make_query("other", direction="straight"), None))
    assert 10 < target.ego_m[0] < 24 - LENGTHWISE_M


def test_the_road_edge_moves_the_goal() -> None:
    street = Street().car("car", 20, -3, RED)
    street.occupancy[ROAD, 137:142, :90] = 0  # from 14.8 to 16.8 m ahead, right of y = -4
    made = plan_in(street, make_query("park", "right_of"))
    assert made.target is None or target_of(made).ego_m[1] > -6
    hole = Street().car("car", 20, -3, RED)
    hole.occupancy[ROAD, 137:142, 85:100] = 0
    made = plan_in(hole, make_query("park", "behind"))
    assert target_of(made).ego_m[0] + EGO.length_m / 2 <= 15.0  # the middle of the first cell without road
    assert has_reason(made, "leaves the road")


def test_unknown_cells_are_invalid() -> None:
    street = Street().car("car", 20, -3, RED)
    street.road_known[125:150, :95] = False  # 10 to 20 m ahead, right of y = -2
    made = plan_in(street, make_query("park", "behind"))
    assert made.target is None
    assert has_reason(made, "lies where the map knows nothing")
    nothing = Street().car("car", 20, -3, RED)
    nothing.road_known[:] = False
    made = plan_in(nothing, make_query("park", "behind"))
    assert made.target is made.nearest is None
    assert has_reason(made, "no free road around us is known")


def test_unreachable_cells_are_invalid() -> None:
    street = Street().car("car", 30, 0, RED)
    street.occupancy[ROAD, 135:140, :] = 0  # a trench across the whole road
    made = plan_in(street, make_query("stop", "behind"))
    assert made.target is None
    assert has_reason(made, "cannot be reached as a car drives")
    assert made.nearest is None or made.nearest.ego_m[0] < 14


@pytest.mark.parametrize(
    ("query", "x_m", "y_m", "reason"),
    [
        (make_query("stop", "right_of"), 20, -6.5, "leaves the road"),
        (make_query("stop", "in_front_of"), 34, 0, "no place in front of it will do: the best one leaves the map"),
        (make_query("stop", "past"), 39.9, 0, "no place beyond it on our way, in line with it lies on the map"),
        (
            make_query("stop", "behind", distance_m=60.0, distance_of="referent"),
            10,
            0,
            "no place behind it lies on the map",
        ),
    ],
)
def test_the_violated_constraint_is_named(query: Query, x_m: float, y_m: float, reason: str) -> None:
    made = plan_in(Street().car("car", x_m, y_m), query)
    assert made.target is None
    assert made.nearest is not None
    assert has_reason(made, reason), made.reasons


def test_the_distance_of_the_nearest_valid_pose_is_reported() -> None:
    made = plan_in(Street().car("car", 34, 0), make_query("stop", "behind", distance_m=80.0, distance_of="referent"))
    assert made.nearest is not None
    away_m = np.hypot(*(made.nearest.ego_m - [34, 0]))
    assert away_m < 10
    assert has_reason(made, f"the nearest place that would do is {away_m:.1f} m away from there, at (")


def test_cells_excluded_by_the_command() -> None:
    scene = Street().car("car", 20, -3).car("other", 12, -3, BLACK).scene()
    assert scene.bev is not None
    road = RoadMap.from_map(scene.bev, scene.objects, EGO)
    free = plan_goal(make_query("stop", "before"), scene, road, object_named(scene, "car"))
    excluded = [ExcludedPlace("next_to", object_named(scene, "other"))]
    made = plan_goal(make_query("stop", "before"), scene, road, object_named(scene, "car"), excluded=excluded)
    check_invariants(made, scene, road)
    assert is_near(target_of(free), 20 - LENGTHWISE_M - 2.0, 0)
    place = made.target or made.nearest
    assert place is not None
    assert not is_near(place, *target_of(free).ego_m)
    assert has_reason(made, "ruled out by the command")


def test_the_front_grid() -> None:
    street = Street(BEVGrid.front()).car("car", 20, -3)
    assert is_near(target_of(plan_in(street, make_query("stop", "behind"))), 20 - LENGTHWISE_M - 2.0, -3)
    assert is_near(target_of(plan_in(street, make_query("stop"), None)), EGO.centre_m + 8, 0)
    here = plan_in(street, make_query("give_way"), None)
    assert target_of(here).ego_m[0] - EGO.length_m / 2 >= 0
    assert has_reason(here, "leaves the map")


def test_the_ego_at_and_beyond_the_border_of_the_map() -> None:
    near_rim = Street(BEVGrid(1.2, 41.2, -40.0, 40.0)).car("car", 20, -3)
    assert is_near(target_of(plan_in(near_rim, make_query("stop", "behind"))), 20 - LENGTHWISE_M - 2.0, -3)
    beyond = Street(BEVGrid(20.0, 60.0, -40.0, 40.0)).car("car", 40, -3)
    made = plan_in(beyond, make_query("stop", "behind"))
    assert made.target is None
    assert has_reason(made, "no free road around us is known")


def test_nobody_is_followed_by_driving_back() -> None:
    made = plan_in(Street().car("car", 16, 0, speed_mps=12.0), make_query("follow"))
    assert made.target is not None
    assert made.target.ego_m[0] > -1.0
