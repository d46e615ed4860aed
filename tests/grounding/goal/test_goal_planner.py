"""Goal poses of commands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from goal_plans import (
    EDGE_M,
    LENGTHWISE_M,
    SIDEWAYS_M,
    has_reason,
    is_near,
    make_query,
    plan_in,
    target_of,
)
from street import BLACK, EGO, HALF_ROAD_M, RED, WHITE, Street

from appocc.bevmap import ROAD
from grounding.query import Query, Referent, RoadSide

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
    ("give_way", "none", EGO.centre_m, 0),
    ("wait", "behind", 20 - LENGTHWISE_M - 2.0, -3),
]


@pytest.mark.parametrize(("action", "relation", "x_m", "y_m"), AT_CAR)
def test_goals_relative_to_a_standing_car(action: str, relation: str, x_m: float, y_m: float) -> None:
    target = target_of(plan_in(Street().car("car", 20, -3), make_query(action, relation)))
    assert is_near(target, x_m, y_m), target
    assert target.heading_ego_rad == pytest.approx(0, abs=0.02)
    assert target.score > 0.8


ALONE = [
    (make_query("stop"), EGO.centre_m + 8, 0, 0),
    (make_query("stop", distance_m=20.0, distance_of="ego"), EGO.centre_m + 20, 0, 0),
    (make_query("other", direction="straight"), EGO.centre_m + 20, 0, 0),
    (make_query("turn", direction="straight"), EGO.centre_m + 20, 0, 0),
    (make_query("slow_down", distance_m=10.0, distance_of="ego"), EGO.centre_m + 10, 0, 0),
    (make_query("give_way"), EGO.centre_m, 0, 0),
    (make_query("park"), 13.8, -EDGE_M, 0),
    (make_query("pull_over"), 13.8, -EDGE_M, 0),
    (make_query("park", goal_side="left"), 14.2, EDGE_M, 0),
    (make_query("stop", goal_side="left"), 14.2, EDGE_M, 0),
    (make_query("change_lane", direction="right"), EGO.centre_m + 15, -3.5, 0),
    (make_query("turn", direction="around"), 5.0, 3.5, np.pi),
]


@pytest.mark.parametrize(("query", "x_m", "y_m", "heading_rad"), ALONE)
def test_goals_without_a_vehicle(query: Query, x_m: float, y_m: float, heading_rad: float) -> None:
    target = target_of(plan_in(Street(), query, None))
    assert is_near(target, x_m, y_m), target
    assert np.cos(target.heading_ego_rad - heading_rad) > 0.999


@pytest.mark.parametrize("item", [None, "car"])
@pytest.mark.parametrize(
    ("query", "pace"),
    [
        (make_query("slow_down"), "slower"),
        (make_query("wait"), "standing"),
        (make_query("other", manoeuvre="faster"), "faster"),
    ],
)
def test_a_speed_or_a_state_is_no_place(query: Query, pace: str, item: str | None) -> None:
    made = plan_in(Street().car("car", 20, 0), query, item)
    assert (made.pace, made.target, made.nearest) == (pace, None, None)
    placed = plan_in(Street().car("car", 20, 0), replace(query, relation="behind", landmark="referent"), "car")
    assert placed.pace is None
    assert placed.target is not None


@pytest.mark.parametrize(
    ("query", "reason"),
    [
        (Query("hello"), "no driving command"),
        (make_query("other"), "names no place"),
        (make_query("turn"), "which way to turn"),
        (make_query("follow"), "names no vehicle to follow"),
        (make_query("turn", direction="left"), "no road that branches off to the left"),
    ],
)
def test_commands_without_a_goal_are_explained(query: Query, reason: str) -> None:
    made = plan_in(Street(), query, None)
    assert made.target is None
    assert made.nearest is None
    assert has_reason(made, reason)


def test_a_vehicle_is_passed_farther_on_where_another_one_stands_beyond_it() -> None:
    street = Street().car("car", 12, -3).car("beyond", 12 + LENGTHWISE_M + 6.0, 0)
    target = target_of(plan_in(street, make_query("drive_past")))
    assert target.ego_m[0] > 12 + LENGTHWISE_M + 6.0
    assert target.score > 0.3


def test_an_oncoming_vehicle_is_not_overtaken() -> None:
    street = Street().car("oncoming", 25, 3, yaw_rad=np.pi, speed_mps=8.0)
    made = plan_in(street, make_query("overtake"), "oncoming")
    assert (made.target, made.instead) == (None, "give_way")
    assert "comes towards us" in made.question
    for other in (
        Street().car("oncoming", 25, 3, yaw_rad=np.pi),  # parked
        Street().car("oncoming", 25, 0, speed_mps=3.0),  # ahead of us
    ):
        assert plan_in(other, make_query("overtake"), "oncoming").instead is None


@pytest.mark.parametrize(("road_side", "sign"), [("kerb", -1.0), ("opposite", 1.0)])
def test_the_kerb_and_the_other_side_of_the_road(road_side: RoadSide, sign: float) -> None:
    made = plan_in(Street(), make_query("park", road_side=road_side), None)
    assert sign * target_of(made).ego_m[1] == pytest.approx(EDGE_M, abs=1.0)


def test_a_relation_without_a_vehicle_is_ignored() -> None:
    made = plan_in(Street(), replace(make_query("stop", "before"), referent=None), None)
    assert is_near(target_of(made), EGO.centre_m + 8, 0)
    assert has_reason(made, "no vehicle to measure 'before' from")


def test_driving_past_stays_in_the_ego_lane_even_if_the_gap_is_shorter() -> None:
    street = Street().car("car", 12, 6, RED).car("ahead", 25.8, 0, BLACK)
    target = target_of(plan_in(street, make_query("drive_past")))
    assert target.ego_m[1] == pytest.approx(0, abs=0.41)
    assert 12 + LENGTHWISE_M + 2 <= target.ego_m[0] <= 25.8 - LENGTHWISE_M


def test_the_tolerance_of_next_to_along_the_vehicle() -> None:
    """The ego may be a metre and half a cell ahead of or behind the vehicle."""
    rim_m = 25 - 2.2 - 1.0  # from the middle of the red car
    street = Street().car("car", 25, -3, RED).car("blocker", rim_m + LENGTHWISE_M + 0.5, 0, BLACK)
    street = street.car("other side", 24, -6, WHITE)
    target = target_of(plan_in(street, make_query("stop", "next_to")))
    assert rim_m - 0.21 <= target.ego_m[0] <= rim_m + 0.2


def test_following_keeps_a_time_gap() -> None:
    street = Street().car("car", 30, 0, speed_mps=6)
    made = plan_in(street, make_query("follow"))
    assert is_near(target_of(made), 30 - LENGTHWISE_M - 15.0, 0)
    assert has_reason(made, "moves at 6 m/s")


def test_a_goal_behind_the_ego_is_reported() -> None:
    query = make_query("stop", "behind", distance_m=12.0, distance_of="referent")
    assert has_reason(plan_in(Street().car("car", 12, 0), query), "behind where we are now")


@pytest.mark.parametrize("y_m", [0.0, 2.0])
def test_what_is_to_be_avoided_in_our_way_is_stopped_short_of(y_m: float) -> None:
    street = Street().car("car", 30, y_m)
    assert is_near(target_of(plan_in(street, make_query("avoid"))), 30 - LENGTHWISE_M - 5, 0)


def test_what_is_beside_our_way_is_passed_with_less_speed() -> None:
    made = plan_in(Street().car("car", 12, 6.0), make_query("avoid"))
    assert (made.pace, made.target) == ("slower", None)
    assert has_reason(made, "it is not in our way")


def test_a_distance_of_the_command_is_kept_or_refused() -> None:
    free = Street().car("car", 25, -3, RED)
    query = make_query("park", "behind", distance_m=4.0, distance_of="referent")
    assert is_near(target_of(plan_in(free, query)), 25 - LENGTHWISE_M - 4.0, -3)
    taken = Street().car("car", 25, -3, RED).car("blocker", 14.5, -3, BLACK)
    made = plan_in(taken, query)
    assert made.target is None
    assert made.nearest is not None
    assert has_reason(made, "taken by the black car")
    assert target_of(plan_in(taken, make_query("park", "behind")))
    beside = make_query("stop", "next_to", distance_m=2.0, distance_of="referent")
    at_the_kerb = Street().car("car", 25, -5, RED)
    assert is_near(target_of(plan_in(at_the_kerb, beside)), 25, -5 + SIDEWAYS_M + 2.0)


def test_between_two_cars() -> None:
    row = Street().car("car", 10, -6).car("other", 24, -6)
    assert is_near(target_of(plan_in(row, make_query("park", "between"), "car", "other")), 17, -6)
    beside = Street().car("car", 15, -5).car("other", 15, 5)
    assert is_near(target_of(plan_in(beside, make_query("stop", "between"), "other", "car")), 15, 0)
    tight = plan_in(Street().car("car", 12, -3).car("other", 20, -3), make_query("park", "between"), "car", "other")
    assert tight.target is None
    assert has_reason(tight, "3.6 m apart")
    assert has_reason(tight, "comes too close")
    alone = plan_in(row, make_query("park", "between"), "car")
    assert alone.target is None
    assert has_reason(alone, "needs two vehicles")


def test_next_to_prefers_the_near_side() -> None:
    assert is_near(
        target_of(plan_in(Street().car("car", 15, 4), make_query("stop", "next_to"))), 15, 4 - SIDEWAYS_M - 0.8
    )
    blocked = Street().car("car", 15, 4, RED).car("x", 14, 1, BLACK).car("y", 18, 1, BLACK)
    blocked.occupancy[ROAD] = 1
    made = plan_in(blocked, make_query("stop", "next_to"))
    assert is_near(target_of(made), 15, 4 + SIDEWAYS_M + 0.8)
    assert has_reason(made, "right of it would be better, but the best place there is taken by the black car")


def test_the_goal_side() -> None:
    street = Street().car("car", 15, -0.5, WHITE)
    left, right = (
        target_of(plan_in(street, make_query("park", "near", goal_side=side))) for side in ("left", "right")
    )
    assert left.ego_m[1] > 0 > right.ego_m[1]


def test_the_score_is_a_gaussian_of_the_cost() -> None:
    """The cost is a squared distance in standard deviations; the score is one for the ideal candidate."""
    made = plan_in(Street().car("car", 24, -6), make_query("park", "behind"))
    target = target_of(made)
    assert made.cost_field is not None
    cost = made.cost_field[target.cell]
    assert cost > 0
    assert target.score == pytest.approx(np.exp(-cost / 2))


def test_only_goals_in_the_ego_lane_are_reported_as_behind() -> None:
    in_front = make_query("stop", "in_front_of", referent=Referent("car", "car", None, ("behind_ego",)))
    assert has_reason(plan_in(Street().car("car", -12, 0), in_front), "behind where we are now")
    assert not has_reason(plan_in(Street().car("car", -12, -5), in_front), "behind where we are now")


def test_the_tolerance_of_a_distance_ahead() -> None:
    made = plan_in(Street(), make_query("stop", distance_m=20.0, distance_of="ego"), None)
    assert made.cost_field is not None
    ahead_m = Street().grid.centres()[..., 0][np.isfinite(made.cost_field)] - EGO.centre_m
    assert 17 <= ahead_m.min() < 17.5
    assert 22.5 < ahead_m.max() <= 23
