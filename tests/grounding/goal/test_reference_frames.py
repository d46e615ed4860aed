"""Frames of reference for front and left, and mirrored scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from goal_plans import (
    LENGTHWISE_M,
    SIDEWAYS_M,
    has_reason,
    is_near,
    make_query,
    plan_in,
    target_of,
)
from street import BLACK, EGO, RED, WHITE, Street

from grounding.goal.planner import plan_goal
from grounding.road.road_map import RoadMap


def test_a_turned_car_turns_the_goal() -> None:
    yaw = 0.3
    target = target_of(plan_in(Street().car("car", 15, 0, yaw_rad=yaw), make_query("stop", "behind")))
    away = LENGTHWISE_M + 2.0
    assert is_near(target, 15 - away * np.cos(yaw), -away * np.sin(yaw))
    assert 0.1 < target.heading_ego_rad < yaw + 0.02


@pytest.mark.parametrize(("relation", "sign"), [("behind", 1), ("in_front_of", -1)])
def test_an_oncoming_car_keeps_its_own_front(relation: str, sign: int) -> None:
    made = plan_in(Street().car("car", 15, 3, yaw_rad=np.pi, speed_mps=8), make_query("approach", relation))
    assert is_near(target_of(made), 15 + sign * (LENGTHWISE_M + 2.0), 3)
    assert target_of(made).heading_ego_rad == pytest.approx(0, abs=0.02)
    assert has_reason(made, "it faces us")
    assert has_reason(made, "moves at 8 m/s")


def test_an_oncoming_car_is_followed_in_its_own_direction() -> None:
    made = plan_in(Street().car("car", 10, 3, yaw_rad=np.pi, speed_mps=2), make_query("follow"))
    assert is_near(target_of(made), 10 + LENGTHWISE_M + 9.0, 3)
    assert abs(target_of(made).heading_ego_rad) == pytest.approx(np.pi, abs=0.02)
    assert has_reason(made, "turn around")


def test_a_car_standing_in_our_path_and_facing_us_uses_our_direction() -> None:
    made = plan_in(Street().car("car", 15, -3, yaw_rad=np.pi), make_query("park", "behind"))
    assert is_near(target_of(made), 15 - LENGTHWISE_M - 1.0, -3)
    assert has_reason(made, "our direction of travel")
    far = plan_in(Street().car("car", 15, 6, yaw_rad=np.pi), make_query("park", "behind"))
    assert is_near(target_of(far), 15 + LENGTHWISE_M + 1.0, 6)


def test_left_and_right_of_a_car_that_faces_us_are_ours() -> None:
    made = plan_in(Street().car("car", 15, 2, yaw_rad=np.pi), make_query("stop", "right_of"))
    assert is_near(target_of(made), 15, 2 - SIDEWAYS_M - 0.8)
    assert has_reason(made, "left and right are ours, as we see the vehicle, which faces us")


def test_left_of_a_car_across_our_way_is_at_its_end() -> None:
    made = plan_in(Street().car("car", 15, 0, yaw_rad=np.pi / 2), make_query("stop", "left_of"))
    assert is_near(target_of(made), 15, (4.4 + EGO.width_m) / 2 + 0.8)
    assert target_of(made).heading_ego_rad == pytest.approx(0, abs=0.03)
    assert has_reason(made, "stands across our way")
    assert has_reason(made, "side to bumper")


@pytest.mark.parametrize("yaw_deg", [0, 30, 60, 89, 91, -91, 120, 150, 180])
def test_left_is_ours_for_any_yaw(yaw_deg: float) -> None:
    street = Street().car("car", 15, 0, RED, yaw_rad=np.radians(yaw_deg))
    left, right = (target_of(plan_in(street, make_query("stop", side))) for side in ("left_of", "right_of"))
    assert left.ego_m[1] > 1.5
    assert right.ego_m[1] < -1.5
    assert max(abs(left.heading_ego_rad), abs(right.heading_ego_rad)) <= np.pi / 4 + 0.05


def test_an_unknown_front_is_reported() -> None:
    scene = Street().car("car", 15, -3, yaw_rad=np.pi).scene_without_boxes()
    assert scene.bev is not None
    item = replace(scene.objects[0], front_known=False)
    made = plan_goal(make_query("stop", "behind"), scene, RoadMap.from_map(scene.bev, scene.objects, EGO), item)
    assert is_near(target_of(made), 15 - LENGTHWISE_M - 2.0, -3)
    assert has_reason(made, "its front is not known")


@pytest.mark.parametrize("action", ["stop", "park"])
@pytest.mark.parametrize(
    "relation", ["behind", "in_front_of", "next_to", "near", "before", "past", "toward", "opposite", "at"]
)
def test_a_mirrored_scene_mirrors_the_goal(action: str, relation: str) -> None:
    places = []
    for sign in (1.0, -1.0):
        street = Street().car("car", 20, -3.1 * sign, RED, yaw_rad=0.2 * sign)
        street = street.car("other", 11, 2.2 * sign, BLACK, yaw_rad=-0.1 * sign).car("third", 31, -0.9 * sign, WHITE)
        # Where traffic drives on the other side, everything is the other way round.
        places.append(target_of(plan_in(street, make_query(action, relation), left_hand_traffic=sign < 0)))
    assert places[0].ego_m == pytest.approx(places[1].ego_m * [1, -1], abs=0.41)
    assert places[0].heading_ego_rad == pytest.approx(-places[1].heading_ego_rad, abs=0.04)
