"""Road, parking and pavement areas of the road network and the car parks, drawn as labels."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.polylines import clean, strip
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.road_segments import ROADWAY
from appocc.simulation.network import Edge, Lane, LaneKind, RoadNetwork
from appocc.simulation.plan import CarPark, TownPlan
from appocc.simulation.surface import CELL_M, ROAD_SURFACES, Surface, surface_table

BAY_M = (5.0, 2.5)
MARGIN_M = 60.0
_BAY_LINE_M = 0.1
# Shoulders and verges are not road: draw_surroundings makes them pavement by distance.
_SURFACE: dict[LaneKind, Surface] = {
    "walking": Surface.PAVEMENT,
    "driving": Surface.ROAD,
    "parking": Surface.PARKING,
    "cycling": Surface.CYCLE_PATH,
}
# Gaps between lanes up to this width become road, and so do islands up to this area.
_CLOSE_M = 1.1
_SLIVER_M2 = 3.0
# Strips overlap their neighbours by this, so that no cell centre is left between them.
_OVERLAP_M = 0.01


def empty_canvas(plan: TownPlan) -> Canvas:
    """Return an empty label canvas around the streets and car parks of a town."""
    places = [plan.network.low_m, plan.network.high_m, *(c.outline_m for c in plan.car_parks)]
    points = np.concatenate([np.atleast_2d(place) for place in places])
    low = np.floor((points.min(axis=0) - MARGIN_M) / CELL_M).astype(np.int64)
    high = np.ceil((points.max(axis=0) + MARGIN_M) / CELL_M).astype(np.int64)
    width, height = (high - low).tolist()
    return Canvas(low / round(1 / CELL_M), np.full((height, width, 1), Surface.GRASS, np.uint8))


def draw_streets(canvas: Canvas, network: RoadNetwork) -> None:
    """Draw the lanes of the streets, the junctions, their inner lanes, and separate pavements."""
    for kind, surface in _SURFACE.items():
        lanes = [lane for edge in network.edges if has_cars(edge) for lane in edge.lanes if lane.kind == kind]
        canvas.fill((lane_areas(lane) for lane in lanes), surface)
    inside = (lane for lane in network.inner_lanes if lane.kind in ROADWAY)
    canvas.fill((lane_areas(lane) for lane in inside), Surface.ROAD)
    # Where only pavements or verges meet, there is no road.
    met = {name for e in network.edges if has_cars(e) for name in (e.from_junction, e.to_junction)}
    crossings = (j.outline_m for j in network.junctions if j.name in met and len(j.outline_m) > 2)
    canvas.fill((outline for outline in crossings if _mean_width_m(outline) > _CLOSE_M), Surface.ROAD)
    _close_gaps(canvas.raster[:, :, 0])


def _mean_width_m(outline_m: FloatArray) -> float:
    """Return area divided by length: small where two streets merely meet; such an outline may cross a median."""
    x, y = outline_m.T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    return area / max(float(np.hypot(*(outline_m[:, None] - outline_m[None]).T).max()), _CLOSE_M)


def has_cars(edge: Edge) -> bool:
    """Return whether cars drive along an edge."""
    return any(lane.kind == "driving" for lane in edge.lanes)


def lane_areas(lane: Lane) -> FloatArray:
    """Return (K, 4, 2) areas that together cover the lane."""
    half = lane.width_m / 2 + _OVERLAP_M
    return strip(clean(lane.centre_m), half, -half)


def draw_car_park(canvas: Canvas, car_park: CarPark) -> None:
    """Draw a car park with the lines between its bays; existing street surfaces are kept."""
    rows, columns = _cells_around(canvas, car_park.outline_m)
    part = canvas.raster[rows, columns, 0]
    before = part.copy()
    canvas.fill([car_park.outline_m], Surface.PARKING)
    canvas.fill(bay_lines(car_park), Surface.BAY_LINE)
    street = before >= Surface.ROAD
    part[street] = before[street]


def bay_lines(car_park: CarPark) -> list[FloatArray]:
    """Return the areas (4, 2) of the lines on both long sides of each bay; neighbours share theirs."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * [BAY_M[0], _BAY_LINE_M]
    lines = []
    for x, y, yaw in car_park.bays:
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        for side in (-0.5, 0.5):
            lines.append((corners + np.array([0.0, side * BAY_M[1]])) @ turn.T + np.array([x, y]))
    return lines


def road_mask(label: ByteArray) -> ByteArray:
    """Return (H, W) uint8, 1 where cars may drive."""
    return np.asarray(cv2.LUT(label, surface_table(ROAD_SURFACES).astype(np.uint8)), dtype=np.uint8)


def disc_kernel(radius_m: float) -> ByteArray:
    """Return an elliptical morphology kernel."""
    size = 2 * round(radius_m / CELL_M) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), dtype=np.uint8)


def _close_gaps(label: ByteArray) -> None:
    """Close gaps between lanes and tiny islands: they become road."""
    road = road_mask(label)
    closed = np.asarray(cv2.morphologyEx(road, cv2.MORPH_CLOSE, disc_kernel(_CLOSE_M / 2)), dtype=np.uint8)
    label[(closed > 0) & (road == 0)] = Surface.ROAD
    for rows, columns, island in find_islands(closed, 2, 0.0, _SLIVER_M2):
        part = label[rows, columns]
        part[island & (part < Surface.ROAD)] = Surface.ROAD


def find_islands(
    road: ByteArray, coarse: int, least_m2: float, most_m2: float
) -> list[tuple[slice, slice, BoolArray]]:
    """Find ground enclosed by roads within an area range, in coarse cells: rows, columns and a mask of each."""
    small = cv2.resize(road, None, fx=1 / coarse, fy=1 / coarse, interpolation=cv2.INTER_NEAREST)
    _, number, stats, _ = cv2.connectedComponentsWithStats(1 - small, connectivity=4)
    cell_m2 = (coarse * CELL_M) ** 2
    found = []
    for k in range(1, len(stats)):
        x, y, w, h, area = stats[k].tolist()
        if not least_m2 <= area * cell_m2 <= most_m2:
            continue
        cells = (number[y : y + h, x : x + w] == k).astype(np.uint8)
        inside = np.kron(cells, np.ones((coarse, coarse), np.uint8)).astype(np.bool_)
        rows, columns = (
            slice(coarse * v, min(coarse * (v + n), m)) for v, n, m in zip((y, x), (h, w), road.shape, strict=True)
        )
        found.append((rows, columns, inside[: rows.stop - rows.start, : columns.stop - columns.start]))
    return found


def _cells_around(canvas: Canvas, points_m: FloatArray) -> tuple[slice, slice]:
    """Return rows and columns of the canvas around the points."""
    cells = (points_m - canvas.low_m) / CELL_M
    low = np.maximum(np.floor(cells.min(axis=0)).astype(np.int64) - 1, 0)
    high = np.ceil(cells.max(axis=0)).astype(np.int64) + 2
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))
