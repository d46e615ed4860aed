"""Street furniture along the streets: lamps, signs, bins, benches, shelters; positions of street trees."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.simulation.mesh import Mesh
from appocc.simulation.network import RoadNetwork
from appocc.simulation.scenery import furniture
from appocc.simulation.scenery.builder import instance_mesh
from appocc.simulation.scenery.roadside import Roadside, along_streets, keep_distance, outer_lanes, place_behind_kerb
from appocc.simulation.scenery.site import Site, lanes_across

_LAMP_STEP_M = 56.0  # on each side; the sides alternate
_TREE_STREETS = {"old": 0.3, "modern": 0.5, "suburb": 0.45, "industrial": 0.12}


class StreetFurnisher:
    """Places things along the streets; each keeps its distance from earlier ones."""

    def __init__(self, site: Site, network: RoadNetwork, occupied_m: FloatArray) -> None:
        """Start with occupied positions (N, 2)."""
        self.site, self.network = site, network
        self.occupied_m = occupied_m.reshape(-1, 2)
        self.meshes: list[Mesh] = []

    def place_copies(self, template: Mesh, side: Roadside, facing: FloatArray, least_m: float) -> Roadside:
        """Place instances at free, large enough positions, and occupy these; fronts face along `facing` (N, 2)."""
        yaw = np.arctan2(facing[:, 1], facing[:, 0]) + np.pi / 2
        fits = self._off_road(template, side.xy_m, yaw)
        side, yaw = side.select(fits), yaw[fits]
        far = keep_distance(side.xy_m, self.occupied_m, least_m)
        side, yaw = side.select(far), yaw[far]
        self.occupied_m = np.concatenate([self.occupied_m, side.xy_m])
        if len(side):
            xyz = np.concatenate([side.xy_m, np.zeros((len(side), 1))], axis=1)
            self.meshes.append(instance_mesh(template, xyz, yaw, np.ones((len(side), 3))))
        return side

    def _off_road(self, template: Mesh, xy_m: FloatArray, yaw_rad: FloatArray) -> BoolArray:
        """Return (N,) whether a template at each position stays off the carriageway, up to the height of a truck."""
        low = template.vertices_m[template.vertices_m[:, 2] < 4.0, :2].astype(np.float64)
        (x0, y0), (x1, y1) = low.min(axis=0) - 0.1, low.max(axis=0) + 0.1
        corners = np.array([[x, y] for x in np.linspace(x0, x1, 5) for y in (y0, (y0 + y1) / 2, y1)])
        cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
        at = np.stack([cos * corners[:, 0] - sin * corners[:, 1], sin * corners[:, 0] + cos * corners[:, 1]], axis=-1)
        on = self.site.is_set((at + xy_m[:, None]).reshape(-1, 2), self.site.road)
        return np.asarray(~on.reshape(len(xy_m), len(corners)).any(axis=1))


def furnish_streets(
    site: Site, network: RoadNetwork, style: str, occupied_m: FloatArray, rng: np.random.Generator
) -> tuple[list[Mesh], FloatArray, FloatArray]:
    """Furnish the streets; also return the lamps' light sources (L, 3) and the positions of street trees (N, 2)."""
    streets = StreetFurnisher(site, network, occupied_m)
    lamps = along_streets(site, network, _LAMP_STEP_M, 0.6, True, 7.0)
    template, light = furniture.street_lamp(style == "old")
    lamps = streets.place_copies(template, lamps, -lamps.outward, 4.0)
    lights = np.concatenate([lamps.xy_m + light[1] * lamps.outward, np.full((len(lamps), 1), light[2])], axis=1)
    _place_signs(streets, rng)
    trees = _place_street_trees(streets, style, rng)
    _place_furniture(streets, style, rng)
    return streets.meshes, lights, trees


def _place_street_trees(streets: StreetFurnisher, style: str, rng: np.random.Generator) -> FloatArray:
    """Return positions of tree rows on the pavements of some streets, on both sides."""
    step = float(rng.uniform(9.0, 12.0))
    side = along_streets(streets.site, streets.network, step, 0.8, False, 13.0)
    names = [edge.name for edge in streets.network.edges]
    both = {}
    for number, edge in enumerate(streets.network.edges):
        opposite = streets.network.opposite(edge)
        both[number] = min(number, names.index(opposite.name)) if opposite else number
    street = np.array([both[int(number)] for number in side.edge], np.int64)
    green = rng.random(len(names) + 1) < _TREE_STREETS[style]
    keep = green[street] & (rng.random(len(side)) < 0.88) & (side.behind_m > 0.8)
    side = side.select(keep)
    side = side.select(keep_distance(side.xy_m, streets.occupied_m, 3.0))
    streets.occupied_m = np.concatenate([streets.occupied_m, side.xy_m])
    return side.xy_m


def _place_signs(streets: StreetFurnisher, rng: np.random.Generator) -> None:
    """Place stop and yield signs, speed limits, parking signs and street names."""
    network = streets.network
    kinds = {junction.name: junction.kind for junction in network.junctions}
    most: dict[str, int] = {}
    for edge in network.edges:
        most[edge.to_junction] = max(most.get(edge.to_junction, -1), edge.priority)
    rows: dict[str, list[tuple[FloatArray, FloatArray, int]]] = {}
    for number, edge, lane, side in outer_lanes(network):
        if side > 0 or len(lane.centre_m) < 2:
            continue
        kind, minor = kinds.get(edge.to_junction, ""), edge.priority < most[edge.to_junction]
        last, first = _point_before_end(lane.centre_m, 1.0), _point_after_start(lane.centre_m, 14.0)
        if kind == "priority" and minor:
            rows.setdefault("stop" if number % 3 == 0 else "yield", []).append((*last, number))
        elif kind in ("priority", "right_before_left", "traffic_light") and rng.random() < 0.35:
            rows.setdefault("name", []).append((*last, number))
        limit = min((30, 50, 60), key=lambda v: abs(v - edge.lanes[-1].speed_mps * 3.6))
        if rng.random() < 0.4:
            rows.setdefault(f"limit{limit}", []).append((*first, number))
        if any(other.kind == "parking" for other in edge.lanes) and rng.random() < 0.5:
            rows.setdefault("parking", []).append((*_point_after_start(lane.centre_m, 24.0), number))
        if kind == "traffic_light" and lanes_across(network, edge) < 3 and rng.random() < 0.5:
            rows.setdefault("crossing", []).append((*_point_before_end(lane.centre_m, 6.0), number))
    templates: dict[str, Callable[[], Mesh]] = {
        "stop": furniture.stop_sign,
        "yield": furniture.yield_sign,
        "name": furniture.name_sign,
        "parking": furniture.parking_sign,
        "crossing": furniture.crossing_sign,
        **{f"limit{number}": make for number, make in furniture.LIMITS.items()},
    }
    for name in sorted(rows):
        xy, heading = np.array([row[0] for row in rows[name]]), np.array([row[1] for row in rows[name]])
        edges = np.array([row[2] for row in rows[name]])
        right = np.stack([heading[:, 1], -heading[:, 0]], axis=1)
        places = place_behind_kerb(streets.site, xy, heading, right, edges, 0.55)
        streets.place_copies(templates[name](), places, -places.heading, 1.2)


def _point_before_end(line_m: FloatArray, back_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the point of a line some distance before its end, and the direction there."""
    heading = (line_m[-1] - line_m[-2]) / max(float(np.linalg.norm(line_m[-1] - line_m[-2])), 1e-9)
    return line_m[-1] - back_m * heading, heading


def _point_after_start(line_m: FloatArray, ahead_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the point some distance after the start of a line, at most at its middle, and the direction there."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m, axis=0), axis=1))])
    at = min(ahead_m, length[-1] / 2)
    i = min(int(np.searchsorted(length, at)), len(line_m) - 1)
    i = max(i, 1)
    heading = (line_m[i] - line_m[i - 1]) / max(float(length[i] - length[i - 1]), 1e-9)
    return line_m[i - 1] + (at - length[i - 1]) * heading, heading


def _place_furniture(streets: StreetFurnisher, style: str, rng: np.random.Generator) -> None:
    """Place bins, benches, cabinets, hydrants, letter boxes, planters, bollards, shelters and billboards."""
    town = style in ("old", "modern")
    # Template, metres of kerb per item, distance behind the kerb, paved depth it needs behind it.
    rows: tuple[tuple[Mesh, float, float, float], ...] = (
        (furniture.shelter(), 260.0, 1.55, 0.9),
        (furniture.bench(), 90.0 if town else 220.0, 1.7, 0.5),
        (furniture.litter_bin(), 70.0 if town else 160.0, 0.65, 0.3),
        (furniture.power_box(), 130.0, 2.0, 0.3),
        (furniture.hydrant(), 150.0, 0.6, 0.3),
        (furniture.letter_box(), 240.0, 0.7, 0.3),
        (furniture.planter(), 120.0 if town else 500.0, 1.9, 0.4),
    )
    for template, apart, back, needs in rows:
        side = along_streets(streets.site, streets.network, 7.0, back, False, 12.0)
        chosen = (rng.random(len(side)) < 7.0 / apart) & (side.behind_m >= needs)
        side = side.select(chosen)
        streets.place_copies(template, side, -side.outward, 3.6 if apart > 250 else 2.0)
    if town:
        _place_bollards(streets, rng)
    _place_billboards(streets, 0.5 if style == "industrial" else 0.12, rng)


def _place_bollards(streets: StreetFurnisher, rng: np.random.Generator) -> None:
    """Place rows of bollards where streets meet junctions."""
    side = along_streets(streets.site, streets.network, 1.6, 0.45, False, 1.0)
    ends = np.zeros(len(side), np.bool_)
    for number in np.unique(side.edge):
        rows = np.flatnonzero(side.edge == number)
        if rng.random() < 0.3:
            ends[rows[:4] if rng.random() < 0.5 else rows[-4:]] = True
    side = side.select(ends)
    streets.place_copies(furniture.bollard(), side, -side.outward, 1.3)


def _place_billboards(streets: StreetFurnisher, share: float, rng: np.random.Generator) -> None:
    """Place billboards behind the pavement, facing the traffic."""
    side = along_streets(streets.site, streets.network, 60.0, 4.6, False, 20.0)
    chosen = rng.random(len(side)) < share
    away = streets.site.distance_at(side.xy_m, streets.site.to_paved_m)
    clear = np.ones(len(side), np.bool_)
    for reach in (-2.6, -1.3, 0.0, 1.3, 2.6):
        across = side.xy_m + reach * side.outward
        clear &= ~streets.site.is_set(across, streets.site.road)
        clear &= ~streets.site.is_set(across + side.outward * 2.6, streets.site.occupied)
    side = side.select(chosen & clear & (away > 0.4))
    moved = Roadside(side.xy_m + 2.6 * side.outward, side.heading, side.outward, side.behind_m, side.edge)
    streets.place_copies(furniture.billboard(), moved, -moved.heading, 4.0)
