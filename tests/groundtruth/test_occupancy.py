from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_street import BLUE, RED, WORLD_FROM_STREET, Plan, Solid, car, make, street_from_ego
from made_surface import surface_of

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.geometry import apply, inverse, quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.groundtruth.colouring import LANE as LANE_LABEL
from appocc.groundtruth.colouring import OTHER, UNLABELLED, ColouredPoints
from appocc.groundtruth.colouring import ROAD as ROAD_LABEL
from appocc.groundtruth.compose import GroundTruthSettings, compose_map, vehicles_near
from appocc.groundtruth.inputs import gather_inputs
from appocc.groundtruth.occupancy import RoadSources, lane_layer, road_layer
from appocc.groundtruth.painting import bodywork_by_box, robust_colours
from appocc.groundtruth.surface import ExposureGains, GroundSurface
from appocc.nuscenes.maps import MaskWindow, VectorMap
from appocc.rasterise import vehicle_owner

GRID = BEVGrid(-8.0, 8.0, -8.0, 8.0, 0.4)
HERE = transform(quaternion_from_yaw(np.pi / 2), [100.0, 200.0, 5.0])  # ego x = world y, ego y = -world x
EVEN = ExposureGains(np.ones((1, 3)))


def surface(*rows: tuple[float, float, int]) -> GroundSurface:
    """A surface of points (ego x, y, label), each the middle of a fine cell."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    world = apply(HERE, np.column_stack([table[:, :2], np.zeros(len(table))]))
    n = len(table)
    points = ColouredPoints(
        (world - HERE[:3, 3]).astype(np.float32),
        np.full((n, 3), 90, np.uint8),
        np.zeros(n, np.uint8),
        table[:, 2].astype(np.uint8),
    )
    return surface_of([points], HERE[:3, 3], EVEN)


def cell(x: int, y: int, *labels: int) -> list[tuple[float, float, int]]:
    """Labelled points, one a fine cell, in the grid cell (x, y)."""
    low = np.array([-8 + 0.4 * x, -8 + 0.4 * y])
    places = [low + 0.05 + 0.1 * np.array([k % 4, k // 4]) for k in range(len(labels))]
    return [(float(p[0]), float(p[1]), label) for p, label in zip(places, labels, strict=True)]


def world(*ego_xy: tuple[float, float]) -> FloatArray:
    return apply(HERE, np.array([(x, y, 0.0) for x, y in ego_xy]))[:, :2]


def square(x: float, y: float, size: float) -> FloatArray:
    return world((x, y), (x + size, y), (x + size, y + size), (x, y + size))


NOTHING = surface()
LABELS = (True, True, "pointlabels")
NO_LABELS = (False, False, "")
VECTOR = VectorMap(((square(-8, -8, 8.0), (square(-4, -4, 2.0),)),), (world((-8, 4), (8, 4)),))


def mask(drivable: bool = True) -> MaskWindow:
    """A mask around the ego: world x < 100 (ego y > 0) is drivable, a corner is not known."""
    grey = np.zeros((400, 400), np.uint8)
    grey[:, :200] = 255 if drivable else 0
    grey[:50] = 127  # world y > 215
    return MaskWindow(grey, (80.0, 180.0), 127, "")


# Vehicles -----------------------------------------------------------------------------------------------------------


def boxes(*rows: tuple[float, float, float, float, float]) -> Boxes:
    """Boxes of (x, y, length, width, yaw)."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    n = len(table)
    turns = np.array([transform(quaternion_from_yaw(row[4]), np.zeros(3))[:3, :3] for row in table]).reshape(-1, 3, 3)
    size = np.column_stack([table[:, 3], table[:, 2], np.full(n, 1.5)])
    names = tuple(map(str, range(n)))
    nan, minus = np.full((n, 2), np.nan), np.full(n, -1)
    return Boxes(
        centre_m=np.column_stack([table[:, :2], np.full(n, 0.7)]),
        size_wlh_m=size,
        rotation=turns,
        category=("vehicle.car",) * n,
        instance=names,
        token=names,
        velocity_mps=nan,
        lidar_points=minus,
    )


def test_a_cell_belongs_to_a_vehicle_that_covers_half_of_it() -> None:
    # x from 0.0 to 2.0 (5 cells), y from -0.2 to 1.0: half a cell, then two and a half.
    assert np.argwhere(vehicle_owner(GRID, boxes((1.0, 0.4, 2.0, 1.2, 0.0))) == 0).tolist() == [
        [x, y] for x in range(20, 25) for y in range(19, 23)
    ]
    # A hair narrower than the half: the outer rows are off.
    narrow = np.argwhere(vehicle_owner(GRID, boxes((1.0, 0.4, 2.0, 1.199, 0.0))) == 0)
    assert np.unique(narrow[:, 1]).tolist() == [20, 21]


@pytest.mark.parametrize("shift", [0.0, 0.4, 1.2, 2.0, 2.8, -3.6])
def test_half_a_cell_is_half_at_any_position(shift: float) -> None:
    for angle in (0.0, np.pi / 2, np.pi):
        owner = vehicle_owner(GRID, boxes((shift, shift, 4.0, 2.0, angle)))
        assert (owner == 0).sum() == 60  # 10 x 5 cells and a half to each side, or 10 and a half by 6


def test_of_two_vehicles_the_one_that_covers_more_gets_the_cell() -> None:
    left, right = (1.0, 1.0, 2.0, 1.5, 0.0), (1.0, -0.3, 2.0, 1.5, 0.0)  # they overlap from y = 0.25 to 0.45
    for pair, near in (((left, right), 0), ((right, left), 1)):
        owner = vehicle_owner(GRID, boxes(*pair))
        assert (owner[21, 21:24] == near).all()
        assert (owner[21, 18:20] == 1 - near).all()
    assert vehicle_owner(GRID, boxes(left, right))[21, 20] == 1  # 0.4 of 0.4 m against 0.15 m


def test_no_vehicles() -> None:
    assert (vehicle_owner(GRID, Boxes.empty()) == -1).all()
    assert (vehicle_owner(GRID, boxes((50, 0, 4, 2, 0))) == -1).all()


# Road ---------------------------------------------------------------------------------------------------------------


def test_the_vector_map_has_priority() -> None:
    road = road_layer(GRID, HERE, RoadSources(VECTOR, mask(False), surface(*cell(30, 30, *[OTHER] * 16)), LABELS))
    assert road.source == "map_expansion"
    assert road.valid.all()
    expected = np.zeros(GRID.shape, np.bool_)
    expected[:20, :20] = True
    expected[10:15, 10:15] = False  # the hole
    assert np.array_equal(road.on, expected)


def test_the_mask_is_used_without_a_vector_map() -> None:
    road = road_layer(GRID, HERE, RoadSources(None, mask(), surface(*cell(3, 3, *[ROAD_LABEL] * 16)), LABELS))
    assert road.source == "mask"
    expected = np.zeros(GRID.shape, np.bool_)
    expected[:, 20:] = True
    assert np.array_equal(road.on, expected & road.valid)
    # Unknown from world y = 215 on is beyond the grid; with the ego 10 m on it is not.
    assert road.valid.all()
    moved = road_layer(
        GRID, transform(HERE[:3, :3], [100.0, 210.0, 5.0]), RoadSources(None, mask(), NOTHING, NO_LABELS)
    )
    assert moved.valid[:32].all()
    assert not moved.valid[33:].any()
    assert not moved.on[33:].any()


def test_beyond_the_mask_nothing_is_known() -> None:
    small = MaskWindow(np.full((20, 20), 255, np.uint8), (99.0, 199.0), None, "")
    road = road_layer(GRID, HERE, RoadSources(None, small, NOTHING, NO_LABELS))
    # 2 m are four cells and a half one on each side; of the corner cells a quarter is known, which is too little.
    assert road.on.sum() == road.valid.sum() == 6 * 6 - 4


def test_a_derived_mask_is_named_as_source() -> None:
    derived = MaskWindow(np.zeros((400, 400), np.uint8), (80.0, 180.0), None, "made from LiDAR")
    assert road_layer(GRID, HERE, RoadSources(None, derived, NOTHING, NO_LABELS)).source == "mask (made from LiDAR)"


def test_labels_are_used_without_maps() -> None:
    rows = cell(3, 4, *[ROAD_LABEL] * 5, *[OTHER] * 5) + cell(5, 6, *[ROAD_LABEL] * 4, *[OTHER] * 5)
    rows += cell(7, 8, ROAD_LABEL, ROAD_LABEL) + cell(9, 10, LANE_LABEL, LANE_LABEL, LANE_LABEL, OTHER)
    rows += cell(11, 12, *[UNLABELLED] * 16)
    road = road_layer(GRID, HERE, RoadSources(None, None, surface(*rows), LABELS))
    assert road.source == "semantic_lidar (pointlabels)"
    assert np.argwhere(road.valid).tolist() == [[3, 4], [5, 6], [9, 10]]  # two or no labelled fine cells are too few
    assert np.argwhere(road.on).tolist() == [[3, 4], [9, 10]]  # half, and markings are road


def test_without_a_source_the_road_is_unknown() -> None:
    rows = cell(3, 4, *[OTHER] * 16)
    for layer in (road_layer, lane_layer):
        unknown = layer(GRID, HERE, RoadSources(None, None, surface(*rows), NO_LABELS))
        assert unknown.source == "none"
        assert not unknown.valid.any()
        assert not unknown.on.any()


# Lanes --------------------------------------------------------------------------------------------------------------


def test_lanes_of_the_vector_map() -> None:
    # The line lies along the border of two rows of cells: 0.075 of 0.4 m in each is less than a fifth.
    assert not lane_layer(GRID, HERE, RoadSources(VECTOR, None, NOTHING, NO_LABELS)).on.any()
    inside = VectorMap(None, (world((-8, 4.2), (0, 4.2)), world((-8, -8), (8, 8))))
    lane = lane_layer(GRID, HERE, RoadSources(inside, None, NOTHING, NO_LABELS))
    assert lane.source == "map_expansion"
    assert lane.valid.all()
    assert lane.on[:20, 30].all()
    assert not lane.on[31:, 30].any()
    assert lane.on.diagonal().all()
    assert lane.on.sum() == 20 + 40


def test_lanes_of_labels() -> None:
    rows = cell(3, 4, *[LANE_LABEL] * 2, *[ROAD_LABEL] * 8) + cell(5, 6, LANE_LABEL, *[ROAD_LABEL] * 8)
    lane = lane_layer(GRID, HERE, RoadSources(None, mask(), surface(*rows), LABELS))
    assert lane.source == "semantic_lidar (pointlabels)"
    assert np.argwhere(lane.on).tolist() == [[3, 4]]  # a fifth
    assert np.argwhere(lane.valid).tolist() == [[3, 4], [5, 6]]


def test_each_class_walks_the_chain_by_itself() -> None:
    labelled = surface(*cell(3, 4, *[LANE_LABEL] * 8))
    roads_only = VectorMap(VECTOR.drivable, None)
    sources = RoadSources(roads_only, mask(), labelled, LABELS)
    assert road_layer(GRID, HERE, sources).source == "map_expansion"
    assert lane_layer(GRID, HERE, sources).source == "semantic_lidar (pointlabels)"
    lines_only = RoadSources(VectorMap(None, VECTOR.markings), mask(), labelled, LABELS)
    assert road_layer(GRID, HERE, lines_only).source == "mask"
    assert lane_layer(GRID, HERE, lines_only).source == "map_expansion"
    # nuScenes-lidarseg knows the road, but no markings.
    no_lanes = RoadSources(None, None, labelled, (True, False, "lidarseg"))
    assert road_layer(GRID, HERE, no_lanes).source == "semantic_lidar (lidarseg)"
    assert lane_layer(GRID, HERE, no_lanes).source == "none"


# Whole maps ---------------------------------------------------------------------------------------------------------


def composed(
    root: Path, plan: Plan, sources: RoadSources | None = None, zones: tuple[FloatArray, ...] = ()
) -> BEVMap:
    """The map of the first sample of a made dataset, with a ground of nothing."""
    dataset = make(root, plan)
    inputs = gather_inputs(dataset, dataset.scenes[0])
    where = sources or RoadSources(None, None, NOTHING, NO_LABELS)
    settings = GroundTruthSettings(BEVGrid(-12.0, 12.0, -12.0, 12.0, 0.4), "robust")
    sample = replace(inputs.samples[0], no_label_zones=zones)
    wanted = vehicles_near(sample, settings.grid)
    painted = robust_colours([sample], [bodywork_by_box(sample, wanted, {})])[0] if inputs.annotated else None
    return compose_map(sample, where, painted, settings)


def street(t: float) -> list[Solid]:
    return [
        car(8, 3.2, RED, "seen"),
        car(-8, -2.8, BLUE, "unseen"),
        Solid((3, -8, 0), (3.6, -7.4, 1.7), BLUE, "human.pedestrian.adult", "w"),
    ]


def test_sources_and_settings_are_recorded(tmp_path: Path) -> None:
    bev = composed(tmp_path, Plan(street, samples=1))
    assert bev.meta["sources"] == {
        "road": "none",
        "vehicle": "cuboids",
        "lane": "none",
        "appearance_static": "none",
        "appearance_vehicle": "cuboids (robust)",
    }
    assert bev.meta["settings"]["paint"] == "robust"
    assert bev.meta["token"]
    assert not bev.occupancy_valid[[ROAD, LANE]].any()
    assert bev.occupancy_valid[VEHICLE].all()


def test_no_vehicle_is_known_in_a_no_label_zone_but_an_annotated_one(tmp_path: Path) -> None:
    outline = np.array([[5.0, 1.0, 0], [9.0, 1.0, 0], [9.0, 6.0, 0], [5.0, 6.0, 0]])
    bev = composed(tmp_path, Plan(street, samples=1), zones=(apply(WORLD_FROM_STREET, outline)[:, :2],))
    corners = np.array([[4.9, 0.9], [9.1, 6.1]])
    place = apply(street_from_ego(0), np.pad(bev.grid.centres(), ((0, 0), (0, 0), (0, 1))))[..., :2]
    inside = ((place > corners[0] + 0.3) & (place < corners[1] - 0.3)).all(axis=-1)
    outside = ((place < corners[0] - 0.3) | (place > corners[1] + 0.3)).any(axis=-1)
    on, valid = bev.occupancy[VEHICLE] > 0, bev.occupancy_valid[VEHICLE]
    assert (inside & on).any()
    assert (valid[inside] == on[inside]).all()
    assert valid[outside].all()
    assert bev.meta["sources"]["vehicle"] == "cuboids"


def test_vehicles_in_a_map(tmp_path: Path) -> None:
    bev = composed(tmp_path, Plan(street, samples=1, cameras=("CAM_FRONT",)))
    assert bev.occupancy[VEHICLE].sum() == 100  # two cars of 10 x 5 cells; the walker is none
    grid = bev.grid
    for x, y, painted in ((8.0, 3.2, True), (-8.0, -2.8, False)):
        i, j = grid.cell_of(apply(inverse(street_from_ego(0)), np.array([x, y, 0.0]))[:2])
        assert bev.occupancy[VEHICLE, i, j] == 1
        assert bev.appearance_valid[i, j] == painted
    assert (bev.appearance[:, bev.appearance_valid].T == RED).all()
    assert bev.appearance_valid.sum() == 50
    assert not bev.appearance[:, ~bev.appearance_valid].any()


def test_a_vehicle_of_unknown_colour_hides_the_ground(tmp_path: Path) -> None:
    """What was seen of the road at another time is not the colour of the car that stands there now."""
    xy = np.mgrid[-12:12:0.1, -12:12:0.1].reshape(2, -1).T + 0.05
    places = apply(WORLD_FROM_STREET, np.pad(xy, ((0, 0), (0, 1)))) - WORLD_FROM_STREET[:3, 3]
    n = len(xy)
    points = ColouredPoints(
        places.astype(np.float32),
        np.where(np.arange(n) % 4 == 0, 90, 91).astype(np.uint8)[:, None].repeat(3, axis=1),
        np.zeros(n, np.uint8),
        np.full(n, UNLABELLED, np.uint8),
    )
    ground = surface_of([points], WORLD_FROM_STREET[:3, 3], EVEN)
    plan = Plan(street, samples=1, cameras=("CAM_FRONT",))
    bev = composed(tmp_path, plan, RoadSources(None, None, ground, NO_LABELS))
    i, j = bev.grid.cell_of(apply(inverse(street_from_ego(0)), np.array([-8.0, -2.8, 0.0]))[:2])
    assert not bev.appearance_valid[i, j]
    road = bev.appearance[:, bev.appearance_valid & (bev.occupancy[VEHICLE] == 0)]
    assert np.median(road) == 91  # 90.75, rounded
    assert road.min() >= 90


def test_a_test_set_has_no_vehicle_layer(tmp_path: Path) -> None:
    bev = composed(tmp_path, Plan(street, samples=1, annotated=False))
    assert not bev.occupancy_valid[VEHICLE].any()
    assert not bev.occupancy[VEHICLE].any()
    assert bev.meta["sources"]["vehicle"] == "none"
    assert bev.meta["sources"]["appearance_vehicle"] == "none"
