from __future__ import annotations

import numpy as np
import pytest
from made_truth_town import made_ground, made_street

from appocc.bevmap import LANE, ROAD, VEHICLE
from appocc.checks import FloatArray
from appocc.geometry import quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.rasterise import polygon_cover
from appocc.simulation.truth.objects import ActorBoxes, objects_near
from appocc.simulation.truth.occupancy import exact_occupancy, ground_shares, vehicle_cells

CAR = ("car", "sedan", (4.6, 1.8, 1.5))
NOBODY = objects_near((), made_street([]).state, np.zeros(2), np.inf)


def pose(x: float, y: float, yaw: float) -> FloatArray:
    return transform(quaternion_from_yaw(yaw), np.array([x, y, 0.0]))


def objects(*rows: tuple[float, float, float], what: tuple[str, str, tuple[float, float, float]] = CAR) -> ActorBoxes:
    street = made_street([(*what, *row) for row in rows])
    return objects_near(street.actors, street.state, np.zeros(2), np.inf)


def test_road_and_line_are_where_they_are_painted() -> None:
    grid = BEVGrid(-20, 20, -20, 20)
    truth = exact_occupancy(made_ground(), grid, pose(0, 0, 0), NOBODY)
    y = grid.centres()[0, :, 1]
    assert (truth.occupancy[ROAD] == (np.abs(y) < 4)).all()
    assert (truth.occupancy[LANE] == (np.abs(y) < 0.4)).all()  # 0.1 m of line in each of two cells of 0.4 m
    assert truth.valid.all()


def test_left_of_the_ego_is_left_in_the_layer() -> None:
    # The ego is 10 m south of the road and faces east: the road is to its left, at high y.
    grid = BEVGrid(-20, 20, -20, 20)
    road = exact_occupancy(made_ground(), grid, pose(0, -10, 0), NOBODY).occupancy[ROAD]
    assert road[50, grid.cell_of([0.2, 10.2])[1]] == 1
    assert road[:, :50].sum() == 0
    # It faces north: the road is ahead, at high x.
    road = exact_occupancy(made_ground(), grid, pose(0, -10, np.pi / 2), NOBODY).occupancy[ROAD]
    assert road[grid.cell_of([10.2, 0.2])[0], 50] == 1
    assert road[:50].sum() == 0


def test_shares_come_close_to_the_exact_cover() -> None:
    grid, at = BEVGrid(-20, 20, -20, 20), pose(3.3, 1.7, 0.61)
    road, lane, known = ground_shares(made_ground(), grid, at)
    for share, (low, high) in ((road, (-4.0, 4.0)), (lane, (-0.1, 0.1))):
        strip = np.array([[-50, low], [50, low], [50, high], [-50, high]])
        exact = polygon_cover(grid, (strip - at[:2, 3]) @ at[:2, :2])
        assert np.abs(share - exact).max() < 0.17
        assert np.abs(share - exact)[exact > 0].mean() < 0.03
    assert known.all()


def test_ground_beyond_the_raster_is_unknown() -> None:
    truth = exact_occupancy(made_ground(), BEVGrid.surround(), pose(40, 0, 0), objects((52, 0, 0)))
    x = BEVGrid.surround().centres()[..., 0]
    assert (truth.valid[ROAD] == (x < 10)).all()
    assert (truth.valid[LANE] == (x < 10)).all()
    assert truth.valid[VEHICLE].all()
    assert truth.occupancy[VEHICLE].sum() > 0
    assert not truth.occupancy[ROAD][x > 10].any()


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.1])
def test_vehicle_cells_are_those_half_covered_by_its_box(yaw: float) -> None:
    grid, at = BEVGrid.surround(), pose(5, 3, 1.0)
    car = objects((12, 6, yaw))
    owner = vehicle_cells(grid, at, car)
    outline = (car.footprints()[0] - at[:2, 3]) @ at[:2, :2]
    assert ((owner == 0) == (polygon_cover(grid, outline) >= 0.5 - 1e-9)).all()
    assert (owner == 0).sum() * 0.16 == pytest.approx(4.6 * 1.8, rel=0.15)


def test_a_vehicle_at_the_edge_of_the_grid_is_cut() -> None:
    owner = vehicle_cells(BEVGrid.surround(), pose(0, 0, 0), objects((40, 0.0, 0), (-41, 0, 0), (45, 0, 0)))
    assert set(np.unique(owner)) == {-1, 0, 1}
    assert (owner[-5:] == 0).any()
    assert (owner[:3] == 1).any()


def test_one_cell_of_a_vehicle_is_enough() -> None:
    grid = BEVGrid.surround()
    for place in ((42.0, 0.5, 0.0), (0.5, -40.6, 0.0), (-42.1, 40.6, 0.0)):  # of its box, a strip of 0.3 m or less
        owner = vehicle_cells(grid, np.eye(4), objects(place))
        assert (owner >= -1).all()
    owner = vehicle_cells(grid, np.eye(4), objects((-42.0, -40.6, 0.0)))
    assert (owner == 0).sum() == 1
    assert owner[0, 0] == 0


def test_vehicle_categories() -> None:
    grid = BEVGrid.surround()
    bicycle = objects((5, 0, 0), what=("bicycle", "bicycle", (1.8, 0.8, 1.7)))
    person = objects((5, 0, 0), what=("pedestrian", "adult", (0.9, 0.9, 1.7)))
    motorcycle = objects((5, 0, 0), what=("motorcycle", "motorcycle", (2.2, 0.8, 1.6)))
    assert (vehicle_cells(grid, np.eye(4), bicycle) == -1).all()
    assert (vehicle_cells(grid, np.eye(4), person) == -1).all()
    assert (vehicle_cells(grid, np.eye(4), motorcycle) == 0).any()


def test_the_ego_and_distant_actors_are_excluded() -> None:
    street = made_street([(*CAR, 0, 0, 0), (*CAR, 10, 0, 0), (*CAR, 100, 0, 0)])
    near = objects_near(street.actors, street.state, np.zeros(2), 80.0, ego=0)
    assert near.number.tolist() == [1]
    assert [actor.name for actor in near.actors] == ["actor-1"]
