"""Places that a driver would not choose unless asked, and what no driver should do."""

from __future__ import annotations

import numpy as np
import pytest
from goal_plans import LENGTHWISE_M, has_reason, make_query, object_named, plan_in, target_of
from street import EGO, RED, Street

from appocc.bevmap import LANE, ROAD
from grounding.goal.planner import plan_goal
from grounding.query import Referent
from grounding.road.pose import Pose2D
from grounding.road.road_map import RoadMap


def crossroads(at_m: float = 20.0) -> Street:
    """Two streets of 12 m width that cross ahead, with a marking in the middle of ours."""
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD] = (np.abs(y - 2) < 6) | (np.abs(x - at_m) < 6)
    street.occupancy[LANE, (np.abs(y - 2) < 0.3) & (np.abs(x - at_m) > 8)] = 1
    return street


def road_of(street: Street, left_hand_traffic: bool | None = None) -> RoadMap:
    scene = street.scene()
    assert scene.bev is not None
    return RoadMap.from_map(scene.bev, scene.objects, EGO, left_hand_traffic=left_hand_traffic)


def test_the_crossing_of_two_streets_is_a_junction() -> None:
    road = road_of(crossroads())
    cells = road.grid.cell_of(np.array([[20.0, 2.0], [5.0, 0.0], [20.0, -20.0]]))
    assert road.junctions[tuple(cells.T)].tolist() == [True, False, False]
    assert not road_of(Street()).junctions.any()


def test_nobody_parks_in_a_junction() -> None:
    target = target_of(plan_in(crossroads(12.0), make_query("park"), None))
    assert abs(target.ego_m[0] - 12.0) > 6


def test_the_side_of_oncoming_traffic() -> None:
    cells = road_of(crossroads()).grid.cell_of(np.array([[5.0, 0.0], [5.0, 5.0]]))
    ahead = np.zeros(2)
    assert road_of(crossroads()).is_oncoming_side(cells, ahead).tolist() == [False, True]
    assert road_of(crossroads()).is_oncoming_side(cells, ahead + np.pi).tolist() == [True, False]
    assert road_of(crossroads(), left_hand_traffic=True).is_oncoming_side(cells, ahead).tolist() == [True, False]


def test_beside_a_vehicle_on_the_other_side_we_head_with_its_traffic() -> None:
    street = Street().car("car", 28, 6.5, RED, yaw_rad=np.pi)
    target = target_of(plan_in(street, make_query("park", "in_front_of")))
    assert np.cos(target.heading_ego_rad) < -0.99


def test_a_place_far_behind_us_is_asked_about() -> None:
    made = plan_in(Street().car("car", -14, -6, RED), make_query("park", "behind"))
    assert made.target is None
    assert "behind us" in made.question
    assert made.nearest is not None
    asked = make_query("park", "behind", referent=Referent("car", "car", None, ("behind_ego",)))
    assert not plan_in(Street().car("car", -14, -6, RED), asked).question


@pytest.mark.parametrize(
    ("action", "relation", "asks"),
    [("stop", "next_to", True), ("park", "behind", True), ("stop", "behind", False), ("approach", "behind", False)],
)
def test_a_vehicle_that_drives_is_no_place_to_stand(action: str, relation: str, asks: bool) -> None:
    made = plan_in(Street().car("car", 25, 0, RED, speed_mps=7), make_query(action, relation))
    assert ("follow" in made.question) == asks


def test_to_stop_behind_a_vehicle_that_drives_before_us_is_to_follow_it_until_it_stands() -> None:
    made = plan_in(Street().car("car", 30, 0, RED, speed_mps=7), make_query("stop", "behind"))
    assert has_reason(made, "we follow it until it stands")
    assert target_of(made).ego_m[0] < 30 - LENGTHWISE_M - 10


def test_to_stop_beside_a_vehicle_that_comes_towards_us_is_refused() -> None:
    oncoming = Street().car("car", 30, 3, RED, yaw_rad=np.pi, speed_mps=7)
    for action, relation in (("stop", "behind"), ("approach", "next_to")):
        made = plan_in(oncoming, make_query(action, relation))
        assert (made.refused, made.question) == (True, "it comes towards us: shall we let it pass?")


@pytest.mark.parametrize(
    ("manoeuvre", "reason"), [("pavement", "people on foot"), ("red_light", "stop"), ("push", "not to be touched")]
)
def test_what_no_driver_should_do_is_refused(manoeuvre: str, reason: str) -> None:
    made = plan_in(Street(), make_query("other", manoeuvre=manoeuvre), None)
    assert made.target is None
    assert has_reason(made, reason)


def test_manoeuvres_in_our_lane() -> None:
    back = plan_in(Street(), make_query("other", manoeuvre="back", distance_m=2.0, distance_of="ego"), None)
    assert target_of(back).ego_m[0] == pytest.approx(EGO.centre_m - 2, abs=0.41)
    assert back.way is not None
    assert back.way.backwards_m == pytest.approx(2, abs=0.5)
    assert target_of(plan_in(Street(), make_query("other", manoeuvre="onward"), None)).ego_m[0] > 15
    assert target_of(plan_in(Street(), make_query("slow_down", manoeuvre="creep"), None)).ego_m[0] < 6


def test_the_nth_branch() -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    for middle_m in (10, 28):
        street.occupancy[ROAD, (np.abs(x - middle_m) < 4) & (y > 0)] = 1
    street.occupancy[LANE, (np.abs(y) < 0.2) & (x % 4 < 2)] = 1
    second = target_of(plan_in(street, make_query("turn", direction="left", count=2), None))
    assert abs(second.ego_m[0] - 28) < 4
    made = plan_in(street, make_query("turn", direction="left", count=3), None)
    assert has_reason(made, "only 2 roads that branch off to the left")


def test_a_plan_from_another_pose() -> None:
    scene = Street().car("car", 30, -3, RED).scene()
    assert scene.road is not None
    later = plan_goal(make_query("stop"), scene, scene.road, start=Pose2D(10.0, 0.0))
    assert target_of(later).ego_m[0] == pytest.approx(18, abs=0.41)
    turned = plan_goal(make_query("stop"), scene, scene.road, start=Pose2D(10.0, 3.0, np.pi))
    assert target_of(turned).ego_m[0] == pytest.approx(2, abs=0.41)
    assert np.cos(target_of(turned).heading_ego_rad) == pytest.approx(-1)
    assert turned.route is not None
    assert turned.route[0] == pytest.approx([10, 3], abs=0.01)
    assert object_named(scene, "car").id == "car"


def test_a_place_in_the_second_row_is_told() -> None:
    parked = Street().car("car", 20, -6.8, RED)
    told = "others have to drive around us"
    assert has_reason(plan_in(parked, make_query("park", "left_of")), told)
    assert not has_reason(plan_in(parked, make_query("park", "behind")), told)
    assert not has_reason(plan_in(parked, make_query("stop", "left_of")), told)


def test_driving_back_costs_more_than_a_gap_that_is_short() -> None:
    """Who is a little too near to follow a vehicle waits instead of driving back."""
    street = Street().car("lead", 13.5, 0, RED, speed_mps=2.0)
    target = target_of(plan_in(street, make_query("follow"), "lead"))
    assert target.ego_m[0] > EGO.centre_m - 0.4


def test_one_does_not_park_beside_a_vehicle_that_creeps() -> None:
    creeping = plan_in(Street().car("car", 14, 0, RED, speed_mps=1.5), make_query("park", "near"), "car")
    assert creeping.target is None
    assert "follow it" in creeping.question
    assert plan_in(Street().car("car", 14, -5, RED), make_query("park", "near"), "car").target is not None
