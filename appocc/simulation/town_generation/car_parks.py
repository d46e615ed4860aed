"""Car parks of a generated town."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.polylines import arc_m, points_at
from appocc.simulation.network import Edge, RoadNetwork
from appocc.simulation.plan import CarPark
from appocc.simulation.town_generation.carriageway import Carriageway, normals

_BAY_M, _BAY_WIDTH_M, _AISLE_M = 5.0, 2.5, 6.2
_SETBACK_M = 3.4  # the pavement is between the street and the bays
_DRIVEWAY_M = 6.4
_MARGIN_M = 3.0
_APART_M = 90.0
_STRAIGHT_M = 0.5


def draw_car_parks(network: RoadNetwork, carriageway: Carriageway, rng: np.random.Generator) -> tuple[CarPark, ...]:
    """Draw two or three car parks where there is room."""
    found: list[CarPark] = []
    wanted = int(rng.integers(2, 4))
    for k in rng.permutation(len(network.edges)):
        columns = int(rng.choice([3, 4]))
        park = _fit_car_park(network.edges[k], columns, float(rng.uniform(0.4, 0.6)), carriageway)
        if (
            park is None
            or not _is_inside(park, network)
            or any(np.hypot(*(park.bays[0, :2] - p.bays[0, :2])) < _APART_M for p in found)
        ):
            continue
        found.append(park)
        if len(found) == wanted:
            break
    return tuple(found)


def _is_inside(park: CarPark, network: RoadNetwork) -> bool:
    """Return whether a car park is inside the bounds of the streets."""
    return bool(((park.outline_m > network.low_m) & (park.outline_m < network.high_m)).all())


def _fit_car_park(edge: Edge, columns: int, share: float, carriageway: Carriageway) -> CarPark | None:
    """Return a car park right of an edge, `columns` bays on each side of its driveway; None if there is no room."""
    lane = edge.lanes[0]
    border = lane.centre_m - normals(lane.centre_m) * lane.width_m / 2
    end_m = float(arc_m(border)[-1])
    half = _DRIVEWAY_M / 2 + columns * _BAY_WIDTH_M + 0.5
    if end_m * min(share, 1 - share) < half + 6.0:
        return None
    at = end_m * share + np.linspace(-half, half, 9)
    line = points_at(border, at)
    ahead = (line[-1] - line[0]) / np.hypot(*(line[-1] - line[0]))
    town_from_park = np.stack([ahead, np.array([ahead[1], -ahead[0]])])  # rows: along the street, away from it
    local = (line - line[4]) @ town_from_park.T
    deep = _SETBACK_M + 2 * _BAY_M + _AISLE_M + 0.4
    u, v = np.meshgrid(np.arange(-half - _MARGIN_M, half + _MARGIN_M), np.arange(_SETBACK_M, deep + _MARGIN_M))
    room = np.stack([u.ravel(), v.ravel()], axis=1) @ town_from_park + line[4]
    if np.abs(local[:, 1]).max() > _STRAIGHT_M or carriageway.distance_m(room).min() < _SETBACK_M - 1.0:
        return None
    outline, bays = _bay_layout(columns, half, deep)
    yaw = np.arctan2(ahead[1], ahead[0]) - bays[:, 2]
    places = bays[:, :2] @ town_from_park + line[4]
    return CarPark(outline @ town_from_park + line[4], np.concatenate([places, _wrap_angle(yaw)[:, None]], axis=1))


def _bay_layout(columns: int, half: float, deep: float) -> tuple[FloatArray, FloatArray]:
    """Return outline and bays (x, y, yaw); x along the street, y away from it, to the right."""
    gate = _DRIVEWAY_M / 2
    near, far = _SETBACK_M + 0.2 + _BAY_M / 2, deep - 0.2 - _BAY_M / 2
    corners = [(-half, _SETBACK_M), (-half, deep), (half, deep), (half, _SETBACK_M), (gate, _SETBACK_M)]
    outline = np.array([(gate, -0.3), (-gate, -0.3), (-gate, _SETBACK_M), *corners])
    offsets = gate + _BAY_WIDTH_M * (np.arange(columns) + 0.5)
    front = [(x, near, -np.pi / 2) for x in (*-offsets, *offsets)]
    count = int(2 * half / _BAY_WIDTH_M)
    back = [(_BAY_WIDTH_M * (k - (count - 1) / 2), far, np.pi / 2) for k in range(count)]
    return outline, np.array([*front, *back])


def _wrap_angle(yaw_rad: FloatArray) -> FloatArray:
    return np.asarray(np.mod(yaw_rad + np.pi, 2 * np.pi) - np.pi)
