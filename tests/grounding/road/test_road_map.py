from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from street import EGO, Street

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray
from appocc.grid import BEVGrid
from grounding.road.free_space import OFF_MAP, OFF_ROAD, TAKEN, UNKNOWN, FreeSpace, gap_m, round_heading
from grounding.road.road_map import RoadMap, align_axis
from grounding.road.sides import TrafficSides

GRID = BEVGrid.surround()
X, Y = np.moveaxis(GRID.centres(), -1, 0)


def road_of(road: BoolArray, street: Street | None = None, soft: bool = False) -> RoadMap:
    street = street or Street()
    street.occupancy[ROAD] = road
    scene = street.scene()
    bev = scene.bev
    assert bev is not None
    if soft:
        occupancy = np.clip(bev.occupancy, 0.1, 0.9)
        bev = BEVMap(bev.grid, occupancy, bev.occupancy_valid, bev.appearance, bev.appearance_valid)
    return RoadMap.from_map(bev, scene.objects, EGO)


def strip(angle_rad: float, half_m: float = 4.0) -> BoolArray:
    """A straight road through the ego's centre at an angle."""
    return np.asarray(np.abs(Y * np.cos(angle_rad) - (X - EGO.centre_m) * np.sin(angle_rad)) < half_m)


@pytest.mark.parametrize("angle_deg", [-60, -25, 0, 10, 45, 80])
def test_the_axis_of_a_straight_road(angle_deg: float) -> None:
    angle = np.radians(angle_deg)
    road = road_of(strip(angle))
    far = strip(angle, 3.0) & (np.hypot(X, Y) > 12) & (np.hypot(X, Y) < 34)
    off = np.abs(np.sin(road.tracer.axis_rad[far] - angle))
    assert np.degrees(off.max()) < 4
    assert road.axis_confidence[far].min() > 0.8


def test_direction_of_travel_along_a_ring() -> None:
    ring = np.asarray(np.abs(np.hypot(X - EGO.centre_m, Y - 20) - 20) < 4)
    road = road_of(ring)
    for angle_deg in (-80, -40, 40, 80, 120):
        angle = np.radians(angle_deg)
        at = np.array([EGO.centre_m + 20 * np.sin(angle), 20 - 20 * np.cos(angle)])
        assert abs(np.sin((road.direction_at(at) - angle) / 2)) < 0.06, angle_deg


def test_direction_of_travel_on_side_roads_leads_away_from_the_ego() -> None:
    cross = strip(0) | ((np.abs(X - 20) < 4) & (Y > 0)) | ((np.abs(X - 10) < 4) & (Y < 0))
    road = road_of(np.asarray(cross))
    assert road.direction_at(np.array([20.0, 25.0])) == pytest.approx(np.pi / 2, abs=0.06)
    assert road.direction_at(np.array([10.0, -25.0])) == pytest.approx(-np.pi / 2, abs=0.06)
    assert road.direction_at(np.array([36.0, 0.0])) == pytest.approx(0, abs=0.06)
    i, j = GRID.cell_of([20.0, 2.0])
    assert road.axis_confidence[i, j] < 0.6 < road.axis_confidence[tuple(GRID.cell_of([20.0, 25.0]))]


def test_direction_of_travel_is_kept_in_a_wide_junction() -> None:
    corners = [np.hypot(X - x, Y - y) > 7 for x in (8, 32) for y in (-12, 12)]
    cross = (
        strip(0, 5.0) | (np.abs(X - 20) < 5) | ((np.abs(X - 20) < 12) & (np.abs(Y) < 12) & np.all(corners, axis=0))
    )
    road = road_of(np.asarray(cross))
    reached = np.isfinite(road.paths.length_m)
    beyond = reached & (X > 34) & (np.abs(Y) < 4)
    assert np.cos(road.direction_rad[beyond]).min() > 0.9
    left = reached & (Y > 16) & (np.abs(X - 20) < 4)
    assert np.sin(road.direction_rad[left]).min() > 0.9
    behind = reached & (X < -8) & (np.abs(Y) < 4)
    assert np.cos(road.direction_rad[behind]).min() > 0.9


def test_direction_of_travel_is_kept_around_obstacles() -> None:
    road = road_of(strip(0, 4.5), Street().car("c", 14, 0).car("d", 14, 3.2).car("e", 22, -3))
    reached = np.isfinite(road.paths.length_m)
    assert np.cos(road.direction_rad[reached & (X > -20) & (X < 36)]).min() > 0.9


def test_vehicles_show_the_axis_without_edges() -> None:
    street = Street()
    for number in range(4):
        street.car(f"c{number}", 5 + 6 * number, 6 + 4 * number, yaw_rad=np.arctan2(4, 6))
    road = road_of(np.ones(GRID.shape, np.bool_), street)
    assert road.direction_at(np.array([17.0, 14.0])) == pytest.approx(np.arctan2(4, 6), abs=0.1)


def test_a_vehicle_across_a_clear_road_does_not_vote() -> None:
    road = road_of(strip(0), Street().car("c", 15, 0, yaw_rad=np.pi / 2))
    assert road.direction_at(np.array([15.0, 0.0])) == pytest.approx(0, abs=0.02)


def test_paths_are_as_wide_as_the_ego() -> None:
    gate = strip(0) & ~((np.abs(X - 10) < 1) & (np.abs(Y) > 0.7))
    wide = strip(0) & ~((np.abs(X - 10) < 1) & (np.abs(Y) > 1.3))
    there = tuple(GRID.cell_of([20.0, 0.0]))
    assert not np.isfinite(road_of(np.asarray(gate)).paths.length_m[there])
    assert road_of(np.asarray(wide)).paths.length_m[there] == pytest.approx(20 - EGO.centre_m, abs=0.6)


def test_small_holes_are_filled_for_paths_on_predicted_maps_only() -> None:
    holes = strip(0, 2.0) & ~((np.abs(X - 10) < 0.3) & (np.abs(Y) < 0.6))
    there = tuple(GRID.cell_of([20.0, 0.0]))
    assert not np.isfinite(road_of(np.asarray(holes)).paths.length_m[there])
    soft = road_of(np.asarray(holes), soft=True)
    assert np.isfinite(soft.paths.length_m[there])
    assert soft.free_space.flags(GRID.cell_of([[10.0, 0.0]]), np.zeros(1)).tolist() == [OFF_ROAD]


def test_paths_start_at_the_nearest_free_cell() -> None:
    beside = np.asarray(np.abs(Y - 5) < 3)
    road = road_of(beside)
    assert road.paths.length_m.min() == 0
    start = GRID.centre_of(np.argwhere(road.paths.length_m == 0)[0])
    assert start == pytest.approx([1.4, 3.0], abs=0.45)
    assert not len(road_of(np.asarray(np.abs(Y - 20) < 3)).paths.cells)


def test_the_ego_lane_follows_a_bend_and_crosses_a_junction_straight() -> None:
    bend = np.asarray(np.abs(np.hypot(X - EGO.centre_m, Y - 30) - 30) < 4)
    own = road_of(bend).ego_lane
    for along in (10, 20, 30):
        at = np.array([EGO.centre_m + 30 * np.sin(along / 30), 30 - 30 * np.cos(along / 30)])
        assert own.project(at) == pytest.approx((along, 0), abs=1.0)
    cross = road_of(np.asarray(strip(0) | (np.abs(X - 15) < 5))).ego_lane
    assert np.abs(cross.points_m[:, 1]).max() < 0.5
    assert cross.end_m == pytest.approx(40 - EGO.centre_m, abs=1.5)
    assert not cross.at_road_end


def test_the_ego_lane_ends_with_the_road() -> None:
    own = road_of(np.asarray(strip(0) & (X < 20))).ego_lane
    assert own.at_road_end
    assert own.end_m == pytest.approx(20 - EGO.centre_m, abs=1.5)


def test_lane_coordinates_of_a_cell() -> None:
    road = road_of(strip(0))
    cell = tuple(GRID.cell_of([15.0, 3.0]))
    assert (road.along_m[cell], road.lateral_m[cell]) == pytest.approx(
        GRID.centre_of(cell) - [EGO.centre_m, 0], abs=1e-6
    )


def test_distance_to_the_road_edge() -> None:
    road = road_of(np.asarray((Y > -4) & (Y < 7)))
    cells = GRID.cell_of([[10.0, 0.2], [10.0, 20.0], [30.0, 0.2]])
    left, right = (road.edge_distance_m(cells, np.full(3, turn)) for turn in (np.pi / 2, -np.pi / 2))
    assert left == pytest.approx([6.8, 0, 6.8], abs=0.21)
    assert right == pytest.approx([4.2, 0, 4.2], abs=0.21)
    assert road.edge_distance_m(cells, np.full(3, np.pi / 2), max_distance_m=3.0).max() == pytest.approx(3)


def test_the_side_of_traffic() -> None:
    assert road_of(strip(0)).traffic_side == 1
    oncoming = Street().car("c", 20, -3.5, yaw_rad=np.pi, speed_mps=5)
    assert road_of(strip(0, 6.0), oncoming).traffic_side == -1
    assert road_of(strip(0, 6.0), Street().car("c", 20, 3.5, yaw_rad=np.pi, speed_mps=5)).traffic_side == 1
    standing = Street().car("c", 20, -3.5, yaw_rad=np.pi)
    assert road_of(strip(0, 6.0), standing).traffic_side == 1


def test_flags_of_invalid_poses() -> None:
    street = Street().car("c", 20, 0)
    street.road_known[X < -30] = False
    scene = street.scene()
    assert scene.bev is not None
    free_space = FreeSpace.from_map(scene.bev, scene.objects, EGO)
    places = np.array([[0.2, 0.2], [20.2, 0.2], [0.2, 7.4], [-31.0, 0.2], [38.2, 0.2], [16.6, 0.2]])
    flags = free_space.flags(GRID.cell_of(places), np.zeros(len(places))).tolist()
    assert flags == [0, TAKEN, OFF_ROAD, UNKNOWN, OFF_MAP, TAKEN]


def test_a_footprint_partly_outside_the_map_is_off_the_map() -> None:
    scene = Street().scene()
    assert scene.bev is not None
    free_space = FreeSpace.from_map(scene.bev, (), EGO)
    cells = np.stack([np.arange(190, 200), np.full(10, 100)], axis=-1)
    off = free_space.flags(cells, np.zeros(10)) & OFF_MAP
    assert (off > 0).tolist() == (GRID.centre_of(cells)[:, 0] + 2.3 > 40).tolist()


def test_a_turned_footprint_covers_cells_by_their_centres() -> None:
    chance = np.random.default_rng(4)
    street = Street()
    street.occupancy[VEHICLE] = chance.random(GRID.shape) < 0.004
    street.occupancy[ROAD] = chance.random(GRID.shape) > 0.004
    scene = street.scene_without_boxes()
    assert scene.bev is not None
    bev, free_space = scene.bev, FreeSpace.from_map(scene.bev, (), EGO)
    cells = chance.integers(10, 190, (300, 2))
    headings = round_heading(chance.uniform(-np.pi, np.pi, 300))
    for cell, heading, flags in zip(cells, headings, free_space.flags(cells, headings), strict=True):
        offset = GRID.centres() - GRID.centre_of(cell)
        along = np.abs(offset @ [np.cos(heading), np.sin(heading)])
        across = np.abs(offset @ [-np.sin(heading), np.cos(heading)])
        assert bool(flags & OFF_ROAD) == bool((~bev.on[ROAD] & (along <= 2.3) & (across <= 0.95)).any())
        assert bool(flags & TAKEN) == bool((bev.on[VEHICLE] & (along <= 2.6) & (across <= 1.25)).any())


def test_gaps_to_a_vehicle() -> None:
    item = Street().car("c", 20, 0).scene().objects[0]
    places = np.array([[12.0, 0.0], [20.0, 4.0], [20.0, 1.0], [30.0, 0.0]])
    assert gap_m(item, EGO, places, np.zeros(4)) == pytest.approx([3.5, 2.15, -0.85, 5.5])
    assert gap_m(item, EGO, places[:1], np.array([np.pi / 2])) == pytest.approx([8 - 2.2 - 0.95])
    scene = Street().car("c", 20, 0).scene()
    assert scene.bev is not None
    assert FreeSpace.from_map(scene.bev, scene.objects, EGO).nearest_object(places[0], 0.0)[1] == pytest.approx(3.5)
    assert FreeSpace.from_map(scene.bev, (), EGO).nearest_object(places[0], 0.0) == (None, np.inf)


def test_align_axis() -> None:
    assert align_axis(0.2, 0.0) == pytest.approx(0.2)
    assert align_axis(0.2, np.pi) == pytest.approx(0.2 - np.pi)


def test_markings_alone_show_the_axis() -> None:
    street = Street()
    street.occupancy[LANE] = np.abs((X - EGO.centre_m) * np.sin(0.4) - Y * np.cos(0.4)) % 3.5 < 0.3
    road = road_of(np.ones(GRID.shape, np.bool_), street)
    assert road.direction_at(np.array([20.0, 8.0])) == pytest.approx(0.4, abs=0.05)


def test_direction_at_an_obstacle_that_is_reached_from_beyond() -> None:
    """The only path around it comes back along our road from the other side."""
    loop = (np.abs(X - 6) < 3) & (np.abs(Y + 8) < 10)
    loop |= (np.abs(X - 34) < 3) & (np.abs(Y + 8) < 10)
    loop |= (np.abs(Y + 15) < 3) & (X > 3) & (X < 37)
    street = Street().car("bus", 18, 0, size_wlh_m=(2.9, 11.0, 3.2))
    road = road_of((np.abs(Y) < 2.4) | loop, street)
    far = road.paths.length_m[tuple(GRID.cell_of([26.0, 0.0]))]
    assert far > 40
    assert abs(road.direction_at(np.array([18.0, 0.0]))) < 0.1


def test_a_hole_of_six_cells_is_filled_and_one_of_seven_is_not() -> None:
    small, large = strip(0, 6.0), strip(0, 6.0)
    small[150, 97:103] = large[150, 97:104] = False
    assert road_of(small, soft=True).drivable[150, 97:103].all()
    assert not road_of(large, soft=True).drivable[150, 97:104].any()


def test_our_half_of_the_road_is_on_the_side_of_traffic() -> None:
    """On a road of 16 m its middle is 4 m from the edge."""
    road = RoadMap.from_map(Street().bev(), (), EGO)
    cells = GRID.cell_of([[10.0, -4.1], [10.0, 3.9]])
    ahead = np.zeros(2)
    np.testing.assert_allclose(road.half_road_offset_m(cells, ahead), [0, 8], atol=0.5)
    np.testing.assert_allclose(
        replace(road, sides=TrafficSides(-1)).half_road_offset_m(cells, ahead), [8, 0], atol=0.5
    )


def test_a_blended_heading_is_between_the_axis_and_the_preferred_one() -> None:
    road, cell = RoadMap.from_map(Street().bev(), (), EGO), np.array([[125, 95]])
    assert road.tracer.axis_rad[125, 95] == pytest.approx(0, abs=0.01)
    for like in (0.4, -0.4, np.pi - 0.4):
        (heading,) = road.blend_headings(cell, np.array([like]))
        axis = 0.0 if abs(like) < 1 else np.pi
        assert 0 < (heading - axis) / (like - axis) < 0.7


def test_a_wide_road_has_sides_and_ends_ours_where_vehicles_come_towards_us() -> None:
    # Four lanes and room to park at both kerbs; a yard on the left hides the kerb.
    wide = np.asarray(np.abs(Y - 7) < 10)
    yard = (np.abs(X - 20) < 8) & (np.abs(Y - 20) < 10)
    cells = np.array([[GRID.cell_of([20.0, y])[axis] for axis in (0, 1)] for y in (0.0, 4.0, 12.0)])
    with_us = np.zeros(3)
    assert road_of(wide).is_oncoming_side(cells, with_us).tolist() == [False, False, True]
    coming = Street().car("c", 15, 4.5, yaw_rad=np.pi, speed_mps=9)
    seen = road_of(wide | yard, coming)
    assert seen.is_oncoming_side(cells, with_us).tolist() == [False, True, True]
    assert not seen.is_oncoming_side(cells, with_us + np.pi)[1:].any()
