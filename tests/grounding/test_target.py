from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from street import BLACK, HALF_ROAD_M, RED, WHITE, WORLD_FROM_EGO, Street

from appocc.bevmap import LANE, ROAD, VEHICLE
from appocc.checks import BoolArray
from appocc.drawing import EGO_LENGTH_M, EGO_WIDTH_M
from appocc.grid import BEVGrid
from grounding.query import Query, Referent
from grounding.road import Road
from grounding.scene import EGO_CENTRE_M, Scene, SceneObject
from grounding.target import Plan, Target, plan

HALF_CELL_M = 0.2 + 1e-9
# Half a car (4.4 m x 1.8 m) and half the ego; from the middle of the road to an ego parked at its edge.
LENGTHWISE_M, SIDEWAYS_M = (4.4 + EGO_LENGTH_M) / 2, (1.8 + EGO_WIDTH_M) / 2
EDGE_M = HALF_ROAD_M - EGO_WIDTH_M / 2 - 0.3


def asked(action: str, relation: str = "none", **more: object) -> Query:
    """A query as a parser would make it, with 'the car' where a relation needs one."""
    if relation != "none":
        more = {"referent": Referent("car", "car"), "landmark": "referent", **more}
    return replace(Query("", action, (action,), relation), **more)  # type: ignore[arg-type]


def named(scene: Scene, name: str) -> SceneObject:
    return next(item for item in scene.objects if item.id == name)


def planned(street: Street, query: Query, name: str | None = "car", partner: str | None = None) -> Plan:
    """The plan beside a vehicle of a street, checked for what holds of every plan."""
    scene = street.scene()
    assert scene.bev is not None
    road = Road.of(scene.bev, scene.objects)
    item = None if name is None else named(scene, name)
    made = plan(query, scene, road, item, None if partner is None else named(scene, partner))
    check_invariants(made, scene, road)
    return made


def check_invariants(made: Plan, scene: Scene, road: Road) -> None:
    """What holds for every plan, worked out apart from the code that made it."""
    bev = scene.bev
    assert bev is not None
    assert made.reasons
    places = [one for one in (made.target, made.nearest, *made.runners_up) if one is not None]
    for place in places:
        assert bev.grid.centre_of(place.cell) == pytest.approx(place.ego_m)
        assert (WORLD_FROM_EGO @ [*place.ego_m, 0, 1])[:2] == pytest.approx(place.world_m)
        assert np.cos(place.heading_rad - place.heading_ego_rad - np.pi / 2) == pytest.approx(1)
        assert 0 < place.score <= 1
        under = cells_under(place, bev.grid)
        assert not bev.on[VEHICLE][under].any()
        assert bev.on[ROAD][under].all()
        assert bev.occupancy_valid[:2, under].all()
        assert bev.grid.contains(bev.grid.cell_of(place.footprint())).all()
        assert not any(item.covers(place.footprint(), 0.29).any() for item in scene.objects)
        assert np.isfinite(road.ways.length_m[place.cell])
    for one, other in ((a, b) for a in made.runners_up for b in (made.target, *made.runners_up) if a is not b):
        assert other is not None
        assert np.hypot(*(one.ego_m - other.ego_m)) >= EGO_LENGTH_M
    assert (made.route is not None) == (made.target is not None)
    if made.target is not None and made.route is not None and made.field is not None:
        assert made.nearest is None
        assert made.route[-1] == pytest.approx(made.target.ego_m)
        assert np.isfinite(made.field[made.target.cell])


def cells_under(target: Target, grid: BEVGrid) -> BoolArray:
    offset = grid.centres() - target.ego_m
    cos, sin = np.cos(target.heading_ego_rad), np.sin(target.heading_ego_rad)
    along, across = offset @ [cos, sin], offset @ [-sin, cos]
    return np.asarray((np.abs(along) <= EGO_LENGTH_M / 2) & (np.abs(across) <= EGO_WIDTH_M / 2))


def found(made: Plan) -> Target:
    assert made.target is not None, made.reasons
    return made.target


def near(target: Target, x_m: float, y_m: float) -> bool:
    """Whether the target is the cell of a place, or one beside it."""
    return bool(np.abs(target.ego_m - [x_m, y_m]).max() <= 2 * HALF_CELL_M)


def said(made: Plan, words: str) -> bool:
    return any(words in reason for reason in made.reasons)


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
    ("slow_down", "none", EGO_CENTRE_M + 10, 0),
    ("wait", "none", EGO_CENTRE_M, 0),
    ("give_way", "none", EGO_CENTRE_M, 0),
    ("wait", "behind", 20 - LENGTHWISE_M - 2.0, -3),
]


@pytest.mark.parametrize(("action", "relation", "x_m", "y_m"), AT_CAR)
def test_places_at_a_car_that_stands_our_way(action: str, relation: str, x_m: float, y_m: float) -> None:
    target = found(planned(Street().car("car", 20, -3), asked(action, relation)))
    assert near(target, x_m, y_m), target
    assert target.heading_ego_rad == pytest.approx(0, abs=0.02)
    assert target.score > 0.8


ALONE = [
    (asked("stop"), EGO_CENTRE_M + 8, 0, 0),
    (asked("stop", distance_m=20.0, distance_of="ego"), EGO_CENTRE_M + 20, 0, 0),
    (asked("other", direction="straight"), EGO_CENTRE_M + 20, 0, 0),
    (asked("turn", direction="straight"), EGO_CENTRE_M + 20, 0, 0),
    (asked("slow_down"), EGO_CENTRE_M + 10, 0, 0),
    (asked("wait"), EGO_CENTRE_M, 0, 0),
    (asked("park"), EGO_CENTRE_M + 5, -EDGE_M, 0),
    (asked("pull_over"), EGO_CENTRE_M + 5, -EDGE_M, 0),
    (asked("park", goal_side="left"), EGO_CENTRE_M + 5, EDGE_M, 0),
    (asked("stop", goal_side="left"), EGO_CENTRE_M + 5, EDGE_M, 0),
    (asked("change_lane", direction="left"), EGO_CENTRE_M + 15, 3.5, 0),
    (asked("change_lane", direction="right"), EGO_CENTRE_M + 15, -3.5, 0),
    (asked("turn", direction="around"), EGO_CENTRE_M + 3, 3.5, np.pi),
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
    assert near(found(made), EGO_CENTRE_M + 8, 0)
    assert said(made, "no vehicle to measure 'before' from")


def test_one_follows_a_moving_vehicle_at_a_second_and_a_half() -> None:
    street = Street().car("car", 30, 0, speed_mps=6)
    made = planned(street, asked("follow"))
    assert near(found(made), 30 - LENGTHWISE_M - 15.0, 0)
    assert said(made, "moves at 6 m/s")


def test_a_place_behind_us_is_told_as_that() -> None:
    made = planned(Street().car("car", 12, 0, speed_mps=6), asked("follow"))
    assert said(made, "behind where we are now")


@pytest.mark.parametrize(
    ("y_m", "x_m"), [(0.0, 30 - LENGTHWISE_M - 5), (2.0, 30 - LENGTHWISE_M - 5), (6.0, EGO_CENTRE_M + 10)]
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


def test_a_turned_car_turns_the_place() -> None:
    yaw = 0.3
    target = found(planned(Street().car("car", 15, 0, yaw_rad=yaw), asked("stop", "behind")))
    away = LENGTHWISE_M + 2.0
    assert near(target, 15 - away * np.cos(yaw), -away * np.sin(yaw))
    assert 0.1 < target.heading_ego_rad < yaw + 0.02


@pytest.mark.parametrize(("relation", "sign"), [("behind", 1), ("in_front_of", -1)])
def test_a_car_that_comes_towards_us_keeps_its_own_front(relation: str, sign: int) -> None:
    made = planned(Street().car("car", 15, 3, yaw_rad=np.pi, speed_mps=8), asked("stop", relation))
    assert near(found(made), 15 + sign * (LENGTHWISE_M + 2.0), 3)
    assert found(made).heading_ego_rad == pytest.approx(0, abs=0.02)
    assert said(made, "it faces us")
    assert said(made, "moves at 8 m/s")


def test_one_that_comes_towards_us_is_followed_its_own_way() -> None:
    made = planned(Street().car("car", 10, 3, yaw_rad=np.pi, speed_mps=2), asked("follow"))
    assert near(found(made), 10 + LENGTHWISE_M + 9.0, 3)
    assert abs(found(made).heading_ego_rad) == pytest.approx(np.pi, abs=0.02)
    assert said(made, "turn around")


def test_one_that_stands_facing_us_in_our_path_is_taken_along_our_way() -> None:
    made = planned(Street().car("car", 15, -3, yaw_rad=np.pi), asked("park", "behind"))
    assert near(found(made), 15 - LENGTHWISE_M - 1.0, -3)
    assert said(made, "our direction of travel")
    far = planned(Street().car("car", 15, 6, yaw_rad=np.pi), asked("park", "behind"))
    assert near(found(far), 15 + LENGTHWISE_M + 1.0, 6)


def test_left_and_right_of_a_car_that_faces_us_are_ours() -> None:
    made = planned(Street().car("car", 15, 2, yaw_rad=np.pi), asked("stop", "right_of"))
    assert near(found(made), 15, 2 - SIDEWAYS_M - 0.8)
    assert said(made, "left and right are ours, as we see the vehicle, which faces us")


def test_one_that_stands_across_our_way_is_passed_at_its_end() -> None:
    made = planned(Street().car("car", 15, 0, yaw_rad=np.pi / 2), asked("stop", "left_of"))
    assert near(found(made), 15, (4.4 + EGO_WIDTH_M) / 2 + 0.8)
    assert found(made).heading_ego_rad == pytest.approx(0, abs=0.03)
    assert said(made, "stands across our way")
    assert said(made, "side to bumper")


@pytest.mark.parametrize("yaw_deg", [0, 30, 60, 89, 91, -91, 120, 150, 180])
def test_left_is_ours_whichever_way_it_stands(yaw_deg: float) -> None:
    street = Street().car("car", 15, 0, RED, yaw_rad=np.radians(yaw_deg))
    left, right = (found(planned(street, asked("stop", side))) for side in ("left_of", "right_of"))
    assert left.ego_m[1] > 1.5
    assert right.ego_m[1] < -1.5
    assert max(abs(left.heading_ego_rad), abs(right.heading_ego_rad)) <= np.pi / 4 + 0.05


def test_a_front_that_is_not_known_is_said() -> None:
    scene = Street().car("car", 15, -3, yaw_rad=np.pi).scene_without_boxes()
    assert scene.bev is not None
    item = replace(scene.objects[0], front_known=False)
    made = plan(asked("stop", "behind"), scene, Road.of(scene.bev, scene.objects), item)
    assert near(found(made), 15 - LENGTHWISE_M - 2.0, -3)
    assert said(made, "its front is not known")


def test_next_to_takes_the_side_towards_us_and_the_other_if_it_must() -> None:
    assert near(found(planned(Street().car("car", 15, 4), asked("stop", "next_to"))), 15, 4 - SIDEWAYS_M - 0.8)
    blocked = Street().car("car", 15, 4, RED).car("x", 14, 1, BLACK).car("y", 18, 1, BLACK)
    blocked.occupancy[ROAD] = 1
    made = planned(blocked, asked("stop", "next_to"))
    assert near(found(made), 15, 4 + SIDEWAYS_M + 0.8)
    assert said(made, "right of it would be better, but the best place there is taken by the black car")


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
    assert found(made).ego_m[0] + EGO_LENGTH_M / 2 <= 15.0  # the middle of the first cell without road
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


def test_the_side_for_the_goal() -> None:
    street = Street().car("car", 15, -0.5, WHITE)
    left, right = (found(planned(street, asked("park", "near", goal_side=side))) for side in ("left", "right"))
    assert left.ego_m[1] > 0 > right.ego_m[1]


def test_what_the_command_rules_out() -> None:
    scene = Street().car("car", 20, -3).car("other", 12, -3, BLACK).scene()
    assert scene.bev is not None
    road = Road.of(scene.bev, scene.objects)
    free = plan(asked("stop", "before"), scene, road, named(scene, "car"))
    made = plan(asked("stop", "before"), scene, road, named(scene, "car"), None, [("next_to", named(scene, "other"))])
    check_invariants(made, scene, road)
    assert near(found(free), 20 - LENGTHWISE_M - 2.0, 0)
    assert not near(found(made), *free.target.ego_m) if free.target else False
    assert said(made, "ruled out by the command")


def test_one_turns_around_to_the_side_of_those_that_come_towards_us() -> None:
    street = Street().car("car", 30, -3.5, yaw_rad=np.pi, speed_mps=5)
    assert near(found(planned(street, asked("turn", direction="around"), None)), EGO_CENTRE_M + 3, -3.5)


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


def test_a_grid_ahead_only() -> None:
    street = Street(BEVGrid.front()).car("car", 20, -3)
    assert near(found(planned(street, asked("stop", "behind"))), 20 - LENGTHWISE_M - 2.0, -3)
    assert near(found(planned(street, asked("stop"), None)), EGO_CENTRE_M + 8, 0)
    here = planned(street, asked("wait"), None)
    assert found(here).ego_m[0] - EGO_LENGTH_M / 2 >= 0
    assert said(here, "leaves the map")


def test_the_ego_at_the_rim_and_beyond_it() -> None:
    near_rim = Street(BEVGrid(1.2, 41.2, -40.0, 40.0)).car("car", 20, -3)
    assert near(found(planned(near_rim, asked("stop", "behind"))), 20 - LENGTHWISE_M - 2.0, -3)
    beyond = Street(BEVGrid(20.0, 60.0, -40.0, 40.0)).car("car", 40, -3)
    made = planned(beyond, asked("stop", "behind"))
    assert made.target is None
    assert said(made, "no free road around us is known")


@pytest.mark.parametrize("action", ["stop", "park"])
@pytest.mark.parametrize(
    "relation", ["behind", "in_front_of", "next_to", "near", "before", "past", "toward", "opposite", "at"]
)
def test_a_mirrored_scene_mirrors_the_place(action: str, relation: str) -> None:
    places = []
    for sign in (1.0, -1.0):
        street = Street().car("car", 20, -3.1 * sign, RED, yaw_rad=0.2 * sign)
        street = street.car("other", 11, 2.2 * sign, BLACK, yaw_rad=-0.1 * sign).car("third", 31, -0.9 * sign, WHITE)
        places.append(found(planned(street, asked(action, relation))))
    assert places[0].ego_m == pytest.approx(places[1].ego_m * [1, -1], abs=0.41)
    assert places[0].heading_ego_rad == pytest.approx(-places[1].heading_ego_rad, abs=0.04)
