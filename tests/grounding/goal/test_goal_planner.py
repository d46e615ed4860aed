"""Places that commands ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from goal_plans import (
    EDGE_M,
    LENGTHWISE_M,
    SIDEWAYS_M,
    asked,
    found,
    near,
    planned,
    said,
)
from street import BLACK, EGO, HALF_ROAD_M, RED, WHITE, Street

from appocc.bevmap import ROAD
from grounding.query import Query

AT_CAR = [
    ("stop", "behind", 20 - LENGTHWISE_M - 2.0, -3),
    ("park", "behind", 20 - LENGTHWISE_M - 1.0, -3),
    ("pull_over", "behind", 20 - LENGTHWISE_M - 1.5, -3),
    ("follow", "none", 20 - LENGTHWISE_M - 6.0, -3),
    ("follow", "same_as", 20 - LENGTHWISE_M - 6.0, -3),
    ("stop", "in_front_of", 20 + LENGTHWISE_M + 2.0, -3),
    ("stop", "next_to", 20, -3 + SIDEWAYS_M + 0.8),
    ("stop", "left_of", 20, -3 + SIDEWAYS_M + 0.8),
    ("stop", "right_of", 20, -3 - SIDEWAYS_M - 0.8),
    ("stop", "near", 20, -3 + SIDEWAYS_M + 0.8),
    ("approach", "none", 20 - LENGTHWISE_M - 2.0, -3),
    ("stop", "toward", 20 - LENGTHWISE_M - 2.0, -3),
    ("stop", "before", 20 - LENGTHWISE_M - 2.0, 0),
    ("park", "before", 20 - LENGTHWISE_M - 1.0, -3),
    ("stop", "past", 20 + LENGTHWISE_M + 2.0, 0),
    ("drive_past", "none", 20 + LENGTHWISE_M + 6.0, 0),
    ("overtake", "none", 20 + LENGTHWISE_M + 6.0, -3),
    ("park", "opposite", 20, EDGE_M),
    ("stop", "opposite", 20, HALF_ROAD_M / 2),
    ("change_lane", "none", 20 - LENGTHWISE_M - 6.0, -3),
    ("slow_down", "none", EGO.centre_m + 10, 0),
    ("wait", "none", EGO.centre_m, 0),
    ("give_way", "none", EGO.centre_m, 0),
    ("wait", "behind", 20 - LENGTHWISE_M - 2.0, -3),
]


@pytest.mark.parametrize(("action", "relation", "x_m", "y_m"), AT_CAR)
def test_places_at_a_car_that_stands_our_way(action: str, relation: str, x_m: float, y_m: float) -> None:
    target = found(planned(Street().car("car", 20, -3), asked(action, relation)))
    assert near(target, x_m, y_m), target
    assert target.heading_ego_rad == pytest.approx(0, abs=0.02)
    assert target.score > 0.8


ALONE = [
    (asked("stop"), EGO.centre_m + 8, 0, 0),
    (asked("stop", distance_m=20.0, distance_of="ego"), EGO.centre_m + 20, 0, 0),
    (asked("other", direction="straight"), EGO.centre_m + 20, 0, 0),
    (asked("turn", direction="straight"), EGO.centre_m + 20, 0, 0),
    (asked("slow_down"), EGO.centre_m + 10, 0, 0),
    (asked("wait"), EGO.centre_m, 0, 0),
    (asked("park"), EGO.centre_m + 5, -EDGE_M, 0),
    (asked("pull_over"), EGO.centre_m + 5, -EDGE_M, 0),
    (asked("park", goal_side="left"), EGO.centre_m + 5, EDGE_M, 0),
    (asked("stop", goal_side="left"), EGO.centre_m + 5, EDGE_M, 0),
    (asked("change_lane", direction="left"), EGO.centre_m + 15, 3.5, 0),
    (asked("change_lane", direction="right"), EGO.centre_m + 15, -3.5, 0),
    (asked("turn", direction="around"), EGO.centre_m + 3, 3.5, np.pi),
]


@pytest.mark.parametrize(("query", "x_m", "y_m", "heading_rad"), ALONE)
def test_places_without_a_vehicle(query: Query, x_m: float, y_m: float, heading_rad: float) -> None:
    target = found(planned(Street(), query, None))
    assert near(target, x_m, y_m), target
    assert np.cos(target.heading_ego_rad - heading_rad) > 0.999


@pytest.mark.parametrize(
    ("query", "reason"),
    [
        (Query("hello"), "no driving command"),
        (asked("other"), "names no place"),
        (asked("turn"), "which way to turn"),
        (asked("follow"), "names no vehicle to follow"),
        (asked("turn", direction="left"), "no road that branches off to the left"),
    ],
)
def test_what_cannot_be_placed_is_said(query: Query, reason: str) -> None:
    made = planned(Street(), query, None)
    assert made.target is None
    assert made.nearest is None
    assert said(made, reason)


def test_a_place_that_names_no_vehicle_after_all_is_chosen_without_it() -> None:
    made = planned(Street(), replace(asked("stop", "before"), referent=None), None)
    assert near(found(made), EGO.centre_m + 8, 0)
    assert said(made, "no vehicle to measure 'before' from")


def test_one_drives_past_in_ones_own_lane_even_where_another_shortens_the_gap() -> None:
    street = Street().car("car", 12, 6, RED).car("ahead", 25.8, 0, BLACK)
    target = found(planned(street, asked("drive_past")))
    assert target.ego_m[1] == pytest.approx(0, abs=0.41)
    assert 12 + LENGTHWISE_M + 2 <= target.ego_m[0] <= 25.8 - LENGTHWISE_M


def test_a_place_at_the_rim_of_being_level_is_beside() -> None:
    """Lengths may miss each other's middle by a metre and half a cell."""
    rim_m = 25 - 2.2 - 1.0  # from the middle of the red car
    street = Street().car("car", 25, -3, RED).car("blocker", rim_m + LENGTHWISE_M + 0.5, 0, BLACK)
    street = street.car("other side", 24, -6, WHITE)
    target = found(planned(street, asked("stop", "next_to")))
    assert rim_m - 0.21 <= target.ego_m[0] <= rim_m + 0.2


def test_one_follows_a_moving_vehicle_at_a_second_and_a_half() -> None:
    street = Street().car("car", 30, 0, speed_mps=6)
    made = planned(street, asked("follow"))
    assert near(found(made), 30 - LENGTHWISE_M - 15.0, 0)
    assert said(made, "moves at 6 m/s")


def test_a_place_behind_us_is_told_as_that() -> None:
    made = planned(Street().car("car", 12, 0, speed_mps=6), asked("follow"))
    assert said(made, "behind where we are now")


@pytest.mark.parametrize(
    ("y_m", "x_m"), [(0.0, 30 - LENGTHWISE_M - 5), (2.0, 30 - LENGTHWISE_M - 5), (6.0, EGO.centre_m + 10)]
)
def test_one_slows_down_short_of_what_is_in_the_way(y_m: float, x_m: float) -> None:
    street = Street().car("car", 30 if y_m < 5 else 12, y_m)
    assert near(found(planned(street, asked("avoid"))), x_m, 0)


def test_a_named_distance_is_kept_or_refused() -> None:
    free = Street().car("car", 25, -3, RED)
    query = asked("park", "behind", distance_m=4.0, distance_of="referent")
    assert near(found(planned(free, query)), 25 - LENGTHWISE_M - 4.0, -3)
    taken = Street().car("car", 25, -3, RED).car("blocker", 14.5, -3, BLACK)
    made = planned(taken, query)
    assert made.target is None
    assert made.nearest is not None
    assert said(made, "taken by the black car")
    assert found(planned(taken, asked("park", "behind")))
    beside = asked("stop", "next_to", distance_m=2.0, distance_of="referent")
    assert near(found(planned(free, beside)), 25, -3 + SIDEWAYS_M + 2.0)


def test_between_two_cars() -> None:
    row = Street().car("car", 10, -6).car("other", 24, -6)
    assert near(found(planned(row, asked("park", "between"), "car", "other")), 17, -6)
    beside = Street().car("car", 15, -5).car("other", 15, 5)
    assert near(found(planned(beside, asked("stop", "between"), "other", "car")), 15, 0)
    tight = planned(Street().car("car", 12, -3).car("other", 20, -3), asked("park", "between"), "car", "other")
    assert tight.target is None
    assert said(tight, "3.6 m apart")
    assert said(tight, "comes too close")
    alone = planned(row, asked("park", "between"), "car")
    assert alone.target is None
    assert said(alone, "needs two vehicles")


def test_next_to_takes_the_side_towards_us_and_the_other_if_it_must() -> None:
    assert near(found(planned(Street().car("car", 15, 4), asked("stop", "next_to"))), 15, 4 - SIDEWAYS_M - 0.8)
    blocked = Street().car("car", 15, 4, RED).car("x", 14, 1, BLACK).car("y", 18, 1, BLACK)
    blocked.occupancy[ROAD] = 1
    made = planned(blocked, asked("stop", "next_to"))
    assert near(found(made), 15, 4 + SIDEWAYS_M + 0.8)
    assert said(made, "right of it would be better, but the best place there is taken by the black car")


def test_the_side_for_the_goal() -> None:
    street = Street().car("car", 15, -0.5, WHITE)
    left, right = (found(planned(street, asked("park", "near", goal_side=side))) for side in ("left", "right"))
    assert left.ego_m[1] > 0 > right.ego_m[1]


def test_a_score_falls_with_the_square_of_what_moves_a_place() -> None:
    """The cost is a squared distance in standard deviations: the score is a Gaussian's, one at the best place."""
    made = planned(Street().car("car", -14, -6), asked("park", "behind"))
    target = found(made)
    assert made.cost_field is not None
    cost = made.cost_field[target.cell]
    assert cost > 0.05
    assert target.score == pytest.approx(np.exp(-cost / 2))


def test_only_a_place_in_our_own_lane_is_behind_where_we_are() -> None:
    assert said(planned(Street().car("car", -12, 0), asked("park", "behind")), "behind where we are now")
    assert not said(planned(Street().car("car", -12, 5), asked("park", "behind")), "behind where we are now")


def test_a_distance_to_go_is_held_to_within_a_tenth_and_a_metre() -> None:
    made = planned(Street(), asked("stop", distance_m=20.0, distance_of="ego"), None)
    assert made.cost_field is not None
    ahead_m = Street().grid.centres()[..., 0][np.isfinite(made.cost_field)] - EGO.centre_m
    assert 17 <= ahead_m.min() < 17.5
    assert 22.5 < ahead_m.max() <= 23
