"""Labels, lines and map of a hand-made crossing: two main streets' arms, a small street, a signal."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import BoolArray, FloatArray
from appocc.errors import NotFoundError
from appocc.grid import BEVGrid
from appocc.rasterise import line_cover, polygon_cover
from appocc.simulation.ground import build_ground
from appocc.simulation.network import Connection, Edge, Junction, Lane, RoadNetwork
from appocc.simulation.plan import CarPark, TownPlan
from appocc.simulation.surface import CELL_M, LANE_SURFACES, ROAD_SURFACES, Ground, Surface, surface_table
from appocc.simulation.town import TownMap

LANE_M = 3.2
LINES = (Surface.LINE_WHITE, Surface.LINE_YELLOW)
# A crossing at the origin with three arms of 90 m: main streets to the west and east, a small one to the north.
HALF_M, LONG_M = 10.0, 90.0


def lane(edge: str, index: int, kind: str, points: list[list[float]], width_m: float = LANE_M) -> Lane:
    return Lane(
        name=f"{edge}_{index}",
        edge=edge,
        index=index,
        kind=kind,  # type: ignore[arg-type]
        width_m=width_m,
        speed_mps=13.9,
        centre_m=np.array(points),
    )


def arm(name: str, direction: FloatArray, across: tuple[tuple[str, float, float], ...]) -> tuple[Edge, Edge]:
    """Both directions of a street from the crossing outwards; lanes as (kind, offset to the right, width)."""
    right = np.array([direction[1], -direction[0]])
    near, far = direction * HALF_M, direction * (HALF_M + LONG_M)
    out = [
        lane(f"{name}_out", k, kind, [(p + right * r).tolist() for p in (near, far)], w)
        for k, (kind, r, w) in enumerate(across)
    ]
    into = [
        lane(f"{name}_in", k, kind, [(p - right * r).tolist() for p in (far, near)], w)
        for k, (kind, r, w) in enumerate(across)
    ]
    return Edge(f"{name}_out", "c", name, 1, tuple(out)), Edge(f"{name}_in", name, "c", 1, tuple(into))


def make_network() -> RoadNetwork:
    main = (("driving", 1.5 * LANE_M, LANE_M), ("driving", 0.5 * LANE_M, LANE_M))
    small = (("parking", LANE_M + 1.15, 2.3), ("driving", 0.5 * LANE_M, LANE_M))
    edges = (
        *arm("west", np.array([-1.0, 0.0]), main),
        *arm("east", np.array([1.0, 0.0]), main),
        *arm("north", np.array([0.0, 1.0]), small),
    )
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [HALF_M, 2 * LANE_M]
    square[2:, 1] = HALF_M
    ways = [("west", "east", "s"), ("east", "west", "s"), ("west", "north", "l"), ("east", "north", "r")]
    ways += [("north", "west", "r"), ("north", "east", "l")]
    links = tuple(Connection(f"{a}_in_1", f"{b}_out_1", "", turn, "lights", k) for k, (a, b, turn) in enumerate(ways))
    low, high = np.array([-100.0, -2 * LANE_M]), np.array([100.0, 100.0])
    crossing = Junction("c", "traffic_light", np.zeros(2), square)
    return RoadNetwork(
        edges=edges,
        inner_lanes=(),
        junctions=(crossing,),
        connections=links,
        low_m=low,
        high_m=high,
        offset_m=np.zeros(2),
    )


CAR_PARK = CarPark(
    np.array(
        [
            [40.0, -40.0],
            [70.0, -40.0],
            [70.0, -20.0],
            [58.0, -20.0],
            [58.0, -6.0],
            [52.0, -6.0],
            [52.0, -20.0],
            [40.0, -20.0],
        ]
    ),
    np.array([[45.0 + 2.5 * k, -37.0, -np.pi / 2] for k in range(8)]),
)
PLAN = TownPlan("Cross", 2, "old", make_network(), (CAR_PARK,))


@pytest.fixture(scope="module")
def built() -> tuple[Ground, TownMap]:
    return build_ground(PLAN)


@pytest.fixture(scope="module")
def ground(built: tuple[Ground, TownMap]) -> Ground:
    return built[0]


def at(ground: Ground, x: float, y: float) -> Surface:
    column, row = np.floor((np.array([x, y]) - ground.low_m) / CELL_M).astype(int)
    return Surface(int(ground.label[row, column]))


def across(ground: Ground, x: float, low: float, high: float, surfaces: tuple[Surface, ...]) -> FloatArray:
    """Return y of the centres of runs of the surfaces along a cut through the town."""
    column = int((x - ground.low_m[0]) / CELL_M)
    on = surface_table(surfaces)[ground.label[:, column]].astype(int)
    y = ground.low_m[1] + np.arange(len(on) + 1) * CELL_M
    change = np.diff(np.concatenate([[0], on, [0]]))
    middle = (y[:-1][change[:-1] > 0] + y[change < 0][: (change > 0).sum()]) / 2
    return np.asarray(middle[(middle > low) & (middle < high)])


def iou(a: BoolArray, b: BoolArray) -> float:
    return float((a & b).sum() / (a | b).sum())


@pytest.mark.parametrize(
    ("x", "y", "surface"),
    [
        (-60.0, -1.6, Surface.ROAD),
        (60.0, 4.8, Surface.ROAD),
        (0.0, 0.0, Surface.ROAD),
        (1.6, 60.0, Surface.ROAD),
        (4.35, 60.0, Surface.PARKING),
        (-4.35, 60.0, Surface.PARKING),
        (-60.0, 6.5, Surface.KERB),
        (-60.0, -8.0, Surface.PAVEMENT),
        (7.5, 60.0, Surface.PAVEMENT),
        (55.0, -15.0, Surface.PARKING),
        (65.0, -30.0, Surface.PARKING),
    ],
)
def test_surface_at_known_points(ground: Ground, x: float, y: float, surface: Surface) -> None:
    assert at(ground, x, y) == surface


def test_main_street_has_a_double_line_in_the_middle(ground: Ground) -> None:
    centre = across(ground, -50.0, -1.0, 1.0, LINES)
    assert len(centre) == 2
    np.testing.assert_allclose(centre, [-0.15, 0.15], atol=0.1)


def test_small_street_has_dashes_in_the_middle_and_a_line_beside_parked_cars(ground: Ground) -> None:
    column = int((0.0 - ground.low_m[0]) / CELL_M)
    rows = slice(*((np.array([45.0, 77.0]) - ground.low_m[1]) / CELL_M).astype(int))
    lines = surface_table(LINES)[ground.label[rows]]
    middle = lines[:, column - 1 : column + 1].any(axis=1)
    assert 0.3 < middle.mean() < 0.45  # 3 m of 8 m
    edge = int((LANE_M - ground.low_m[0]) / CELL_M)
    assert lines[:, edge - 1 : edge + 2].any(axis=1).all()


def test_lines_between_lanes_are_broken_and_before_the_junction_solid(ground: Ground) -> None:
    row = int((-LANE_M - ground.low_m[1]) / CELL_M)  # west arm, towards the junction
    columns = ((np.array([-80.0, -40.0, -33.0, -17.0]) - ground.low_m[0]) / CELL_M).astype(int)
    white = (ground.label[row - 1 : row + 2] == Surface.LINE_WHITE).any(axis=0)
    assert 0.25 < white[columns[0] : columns[1]].mean() < 0.5
    assert white[columns[2] : columns[3]].all()


def test_zebra_is_between_junction_and_stop_line(ground: Ground) -> None:
    zebra = np.argwhere(ground.label == Surface.ZEBRA) * CELL_M + ground.low_m[::-1]
    west = zebra[(zebra[:, 1] < 0) & (np.abs(zebra[:, 0]) < 2 * LANE_M + 0.1)]
    assert -15.0 < west[:, 1].min() < west[:, 1].max() < -HALF_M
    stop = np.argwhere(ground.label == Surface.STOP_LINE) * CELL_M + ground.low_m[::-1]
    stop = stop[(stop[:, 1] < 0) & (np.abs(stop[:, 0]) < 2 * LANE_M + 0.1)]
    assert stop[:, 1].max() < west[:, 1].min()
    assert stop[:, 0].max() < 0.1  # only across the lanes that arrive
    assert stop[:, 1].max() - stop[:, 1].min() == pytest.approx(0.3, abs=0.11)  # four cells


def test_nothing_is_painted_on_the_junction(ground: Ground) -> None:
    low, high = ((np.array(p) - ground.low_m) / CELL_M for p in ((-9.5, -6.0), (9.5, 9.5)))
    inside = ground.label[int(low[1]) : int(high[1]), int(low[0]) : int(high[0])]
    assert np.isin(inside, [Surface.ROAD]).all()


def test_zebras_arrows_and_bay_lines_are_road_but_no_lane_markings(ground: Ground) -> None:
    lane_cells, road_cells = surface_table(LANE_SURFACES)[ground.label], surface_table(ROAD_SURFACES)[ground.label]
    for surface in (Surface.ZEBRA, Surface.ARROW, Surface.BAY_LINE):
        here = ground.label == surface
        assert here.sum() > 50
        assert not lane_cells[here].any()
        assert road_cells[here].all()


def test_arrows_point_where_the_lane_leads(ground: Ground) -> None:
    """The left lane from the west goes straight on and left; the right one has no connection and no arrow."""
    assert np.isin(Surface.ARROW, ground.label[:, : int((-10 - ground.low_m[0]) / CELL_M)])
    arrow_areas = np.argwhere(ground.label == Surface.ARROW) * CELL_M + ground.low_m[::-1]
    west = arrow_areas[(arrow_areas[:, 1] < -10) & (arrow_areas[:, 0] < 0)]
    middle = -LANE_M / 2
    assert west[:, 0].max() - middle > 0.8  # the head to the left
    assert middle - west[:, 0].min() < 0.5


def test_car_park_has_lines_between_its_bays(ground: Ground) -> None:
    row = int((-37.0 - ground.low_m[1]) / CELL_M)
    columns = np.flatnonzero(ground.label[row] == Surface.BAY_LINE) * CELL_M + ground.low_m[0]
    assert len(np.flatnonzero(np.diff(columns) > 0.15)) == 8  # nine lines for eight bays
    np.testing.assert_allclose(columns[[0, -1]], [43.7, 63.7], atol=0.15)


def test_lines_of_the_map_are_the_painted_lines(built: tuple[Ground, TownMap]) -> None:
    ground, vector_map = built
    assert vector_map.lane_dividers
    assert vector_map.road_dividers
    height, width = ground.label.shape
    drawn = np.zeros((width, height))
    for line in (*vector_map.lane_dividers, *vector_map.road_dividers):
        low = np.floor((line.min(axis=0) - ground.low_m) / CELL_M).astype(int) - 3
        high = np.ceil((line.max(axis=0) - ground.low_m) / CELL_M).astype(int) + 3
        (x_low, y_low), (x_high, y_high) = ground.low_m + low * CELL_M, ground.low_m + high * CELL_M
        cover = line_cover(BEVGrid(x_low, x_high, y_low, y_high, CELL_M), line, 0.15)
        drawn[low[0] : low[0] + cover.shape[0], low[1] : low[1] + cover.shape[1]] += cover
    assert iou(drawn.T >= 0.5, surface_table(LINES)[ground.label]) > 0.95


def test_stop_lines_of_the_map_are_the_painted_ones(built: tuple[Ground, TownMap]) -> None:
    ground, vector_map = built
    grid = grid_of(ground)
    drawn = sum(polygon_cover(grid, outline) for outline in (*vector_map.stop_lines, *vector_map.light_lines))
    assert iou(np.asarray(drawn).T >= 0.5, ground.label == Surface.STOP_LINE) > 0.9


def test_drivable_area_of_the_map_is_the_road(built: tuple[Ground, TownMap]) -> None:
    ground, vector_map = built
    grid = grid_of(ground)
    drawn = sum(polygon_cover(grid, outline) for outline in vector_map.drivable)
    assert np.max(drawn) < 1.5  # areas do not overlap
    assert iou(np.asarray(drawn).T >= 0.5, surface_table(ROAD_SURFACES)[ground.label]) > 0.99


def grid_of(ground: Ground) -> BEVGrid:
    (x, y), (height, width) = ground.low_m, ground.label.shape
    return BEVGrid(float(x), float(x + width * CELL_M), float(y), float(y + height * CELL_M), CELL_M)


def test_same_plan_gives_same_bytes_and_another_seed_another_look(built: tuple[Ground, TownMap]) -> None:
    again, vector_map = build_ground(PLAN)
    assert again.label.tobytes() == built[0].label.tobytes()
    assert again.colour.tobytes() == built[0].colour.tobytes()
    assert all(np.array_equal(a, b) for a, b in zip(vector_map.drivable, built[1].drivable, strict=True))
    other, _ = build_ground(TownPlan("Cross", 3, "old", PLAN.network, PLAN.car_parks))
    assert np.mean(other.colour != built[0].colour) > 0.5


def test_road_does_not_depend_on_the_style_and_the_land_does(ground: Ground) -> None:
    shares = {}
    for style in ("old", "suburb"):
        label = build_ground(TownPlan("Cross", 2, style, PLAN.network))[0].label
        shares[style] = np.bincount(label.ravel(), minlength=len(Surface)) / label.size
    assert shares["old"][Surface.YARD] > 2 * shares["suburb"][Surface.YARD]
    assert shares["old"][Surface.PAVEMENT] > shares["suburb"][Surface.PAVEMENT]
    np.testing.assert_array_equal(shares["old"][Surface.ROAD :], shares["suburb"][Surface.ROAD :])


def test_labels_are_in_plausible_shares(ground: Ground) -> None:
    share = np.bincount(ground.label.ravel(), minlength=len(Surface)) / ground.label.size
    assert 0.05 < share[list(ROAD_SURFACES)].sum() < 0.3
    assert 0.002 < share[list(LANE_SURFACES)].sum() < 0.1 * share[list(ROAD_SURFACES)].sum()
    assert 0.02 < share[Surface.PAVEMENT] < 0.2


def test_unknown_style_is_named() -> None:
    with pytest.raises(NotFoundError, match="no style 'baroque'"):
        build_ground(TownPlan("Cross", 2, "baroque", PLAN.network))


def test_colours_separate_paint_from_asphalt_and_asphalt_varies(ground: Ground) -> None:
    grey = ground.colour.mean(axis=2)
    road = grey[ground.label == Surface.ROAD]
    assert grey[ground.label == Surface.LINE_WHITE].mean() > road.mean() + 50
    assert 60 < road.mean() < 130
    assert 4 < road.std() < 25
    yellow = ground.colour[ground.label == Surface.LINE_YELLOW]
    if len(yellow):
        assert (yellow[:, 0].astype(float) - yellow[:, 2]).mean() > 40
    grass = ground.colour[ground.label == Surface.GRASS].mean(axis=0)
    assert grass.argmax() == 1
