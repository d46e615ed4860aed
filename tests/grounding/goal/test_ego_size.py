"""Goals of ego vehicles of different sizes."""

from __future__ import annotations

import numpy as np
import pytest
from goal_plans import LENGTHWISE_M, has_reason, is_near, make_query, object_named, target_of
from street import BLACK, EGO, RED, WORLD_FROM_EGO, Street

from appocc.bevmap import ROAD
from appocc.ego_vehicle import EgoVehicle
from grounding.goal.planner import GoalPlan, plan_goal
from grounding.grounder import Grounder
from grounding.query import Query
from grounding.referent.scene import SceneModel
from grounding.road.free_space import TAKEN, FreeSpace
from grounding.road.visibility import unseen_sides

BUS = EgoVehicle(length_m=12.0, width_m=2.55, rear_overhang_m=3.0, turning_circle_m=21.0)


def scene_for(street: Street, ego: EgoVehicle) -> SceneModel:
    return Grounder(ego=ego).set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)


def plan_for(
    street: Street, query: Query, ego: EgoVehicle, name: str | None = "car", partner: str | None = None
) -> GoalPlan:
    scene = scene_for(street, ego)
    assert scene.road is not None
    item, other = (None if one is None else object_named(scene, one) for one in (name, partner))
    return plan_goal(query, scene, scene.road, item, other)


def test_a_grounder_places_the_footprint_of_its_ego() -> None:
    street = Street().car("car", 30, -3, RED)
    for ego in (EGO, BUS):
        grounder = Grounder(ego=ego)
        assert grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO).ego == ego
        answer = grounder.ground("stop behind the red car")
        assert answer.target is not None
        sides = np.linalg.norm(np.diff(answer.target.footprint(), axis=0), axis=1)
        assert sides == pytest.approx([ego.length_m, ego.width_m, ego.length_m])


def test_a_longer_ego_stops_farther_behind_a_vehicle() -> None:
    street = Street().car("car", 30, -3)
    assert is_near(target_of(plan_for(street, make_query("stop", "behind"), EGO)), 30 - LENGTHWISE_M - 2, -3)
    assert is_near(target_of(plan_for(street, make_query("stop", "behind"), BUS)), 30 - (4.4 + 12) / 2 - 2, -3)


def test_a_wider_ego_keeps_farther_from_the_side_of_a_vehicle_and_the_road_edge() -> None:
    beside = make_query("stop", "next_to")
    for ego in (EGO, BUS):
        target = target_of(plan_for(Street().car("car", 20, -3), beside, ego))
        assert is_near(target, 20, -3 + (1.8 + ego.width_m) / 2 + 0.8)
        parked = target_of(plan_for(Street(), make_query("park"), ego, None))
        assert np.abs(parked.footprint()[:, 1]).max() == pytest.approx(7.7, abs=0.3)


def test_a_bus_does_not_fit_a_gap_where_a_car_does() -> None:
    row = Street().car("car", 10, -6).car("other", 24, -6)  # 9.6 m apart
    between = make_query("park", "between")
    assert is_near(target_of(plan_for(row, between, EGO, "car", "other")), 17, -6)
    made = plan_for(row, between, BUS, "car", "other")
    assert made.target is None
    assert has_reason(made, "comes too close")
    assert target_of(plan_for(Street().car("car", 4, -6).car("other", 24, -6), between, BUS, "car", "other"))


def test_a_gap_that_fits_the_ego_decides_which_pair_is_meant() -> None:
    """Two gaps: 5.6 m in the near row and 15.6 m in the far one."""
    street = Street().car("a", 8, -6).car("b", 18, -6).car("c", 12, 6, BLACK).car("d", 32, 6, BLACK)
    for ego, pair in ((EGO, {"a", "b"}), (BUS, {"c", "d"})):
        grounder = Grounder(ego=ego)
        grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
        first = grounder.ground("park between two cars").candidates[0]
        assert first.partner is not None
        assert {first.item.id, first.partner.id} == pair


def test_a_bus_does_not_pass_a_gate_where_a_car_does() -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD, (np.abs(x - 15) < 1) & (np.abs(y) > 1.3)] = 0  # a gate of 2.4 m
    there = tuple(street.grid.cell_of([25.0, 0.0]))
    for ego, passes in ((EGO, True), (BUS, False)):
        road = scene_for(street, ego).road
        assert road is not None
        assert np.isfinite(road.paths.length_m[there]) == passes


def test_free_space_of_a_longer_footprint() -> None:
    street = Street().car("car", 20, 0)  # its rear is at 17.8 m
    scene = street.scene()
    assert scene.bev is not None
    cells = scene.bev.grid.cell_of([[13.0, 0.2], [11.0, 0.2]])
    flags = [
        FreeSpace.from_map(scene.bev, scene.objects, ego).flags(cells, np.zeros(2)).tolist() for ego in (EGO, BUS)
    ]
    assert flags == [[0, 0], [TAKEN, 0]]


def test_distances_and_sides_count_from_the_centre_of_the_ego() -> None:
    scene = scene_for(Street().car("car", 20, 0), BUS)
    assert BUS.centre_m == 3.0
    assert scene.objects[0].distance_m(scene.ego) == pytest.approx(17)
    assert scene.bev is not None
    assert unseen_sides(scene.bev, scene.ego) == []
