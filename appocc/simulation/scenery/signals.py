"""Traffic lights: one head for every link of a signal, facing the approach."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.network import Connection, Edge, RoadNetwork
from appocc.simulation.scenery.builder import Builder, Tint, instance_mesh, tapered_rod
from appocc.simulation.scenery.furniture import ORIGIN, regular_polygon, sign_plate
from appocc.simulation.scenery.roadside import kerb_offset
from appocc.simulation.scenery.site import Site, lanes_across

_BEHIND_KERB_M = 0.75
_HEAD_M = 2.35  # lower edge of a head on a pole
_ARM_M = 5.5  # lower edge of a head above the street
_ASIDE_M = 0.42  # spacing of adjacent heads
_ARM_FROM = 3  # driving lanes in both directions from which heads hang above the street
_COLOURS: tuple[Tint, ...] = ((214, 40, 36), (232, 168, 36), (44, 180, 96))
_BLACK: Tint = (30, 32, 33)
_GREY: Tint = (96, 100, 102)


@dataclass(frozen=True, eq=False)
class SignalHead:
    """A signal head of three lamps: middle of its lower edge (3,), facing direction (2,), index of its link."""

    xyz_m: FloatArray
    towards: FloatArray
    link: int


def signal_names(network: RoadNetwork) -> tuple[str, ...]:
    """Return the names `light/link` of all links of the town's traffic lights, sorted as text.

    A SIGNAL face's tag is 3 * (index in this list) + 0, 1, 2 for red, yellow, green.
    """
    return tuple(sorted({f"{c.signal}/{c.link}" for c in network.connections if c.signal}))


def build_signals(site: Site, network: RoadNetwork) -> tuple[list[Mesh], FloatArray]:
    """Build poles, arms and heads of all traffic lights, and return the positions of the poles (P, 2)."""
    number = {name: index for index, name in enumerate(signal_names(network))}
    edges = {edge.name: edge for edge in network.edges}
    approaches: dict[tuple[str, str], list[Connection]] = {}
    for connection in network.connections:
        if connection.signal:
            key = network.lane(connection.from_lane).edge, connection.signal
            approaches.setdefault(key, []).append(connection)
    heads: list[SignalHead] = []
    poles: list[tuple[FloatArray, float]] = []
    arms: list[tuple[FloatArray, FloatArray]] = []
    for (edge_name, _), connections in approaches.items():
        _build_approach(site, network, edges[edge_name], connections, number, heads, poles=poles, arms=arms)
    return [*_heads(heads), *_poles(poles), *_arms(arms)], np.array([xy for xy, _ in poles]).reshape(-1, 2)


def _build_approach(
    site: Site,
    network: RoadNetwork,
    edge: Edge,
    connections: list[Connection],
    number: Mapping[str, int],
    heads: list[SignalHead],
    poles: list[tuple[FloatArray, float]],
    arms: list[tuple[FloatArray, FloatArray]],
) -> None:
    """Add heads, poles and the arm of one approach."""
    outer = next(lane for lane in edge.lanes if lane.kind != "walking")
    end, heading = _line_end(outer.centre_m, -1)
    # From left to right as the driver sees the links; one head per name.
    order = {"t": 0, "l": 1, "L": 2, "s": 3, "R": 4, "r": 5}
    links = sorted(connections, key=lambda c: (order.get(c.direction, 3), -network.lane(c.from_lane).index, c.link))
    links = list({f"{c.signal}/{c.link}": c for c in links}.values())
    right = np.array([heading[1], -heading[0]])
    over = lanes_across(network, edge) >= _ARM_FROM
    on_pole = [c for c in links if c.direction not in ("l", "L", "t")][-1:] or links[-1:] if over else links
    pole = _kerb_position(site, end, heading, (len(on_pole) - 1) / 2 * _ASIDE_M)
    for k, connection in enumerate(on_pole):
        aside = (k - (len(on_pole) - 1) / 2) * _ASIDE_M
        base = pole + aside * right - 0.12 * heading
        heads.append(
            SignalHead(np.array([*base, _HEAD_M]), -heading, number[f"{connection.signal}/{connection.link}"])
        )
    if over:
        tips = _hang_over_lanes(network, links, pole, heading, number, heads)
        arms.append((pole, tips))
    poles.append((pole, _ARM_M + 1.0 if over else _HEAD_M + 1.1))
    _repeat_beyond_junction(site, network, [c for c in links if c.direction == "s"], number, heads, poles)


def _hang_over_lanes(
    network: RoadNetwork,
    links: list[Connection],
    pole: FloatArray,
    heading: FloatArray,
    number: Mapping[str, int],
    heads: list[SignalHead],
) -> FloatArray:
    """Hang a head for each link above its lane, adjacent if a lane has several; return the end of the arm (2,)."""
    left = np.array([-heading[1], heading[0]])
    lanes = [c.from_lane for c in links]
    farthest = 0.0
    for k, connection in enumerate(links):
        same = [i for i, lane in enumerate(lanes) if lane == connection.from_lane]
        middle = _line_end(network.lane(connection.from_lane).centre_m, -1)[0]
        reach = float((middle - pole) @ left) - (same.index(k) - (len(same) - 1) / 2) * (_ASIDE_M + 0.08)
        farthest = max(farthest, reach)
        base = pole + reach * left - 0.12 * heading
        heads.append(
            SignalHead(np.array([*base, _ARM_M]), -heading, number[f"{connection.signal}/{connection.link}"])
        )
    return np.asarray(pole + (farthest + 0.3) * left)


def _repeat_beyond_junction(
    site: Site,
    network: RoadNetwork,
    straight: list[Connection],
    number: Mapping[str, int],
    heads: list[SignalHead],
    poles: list[tuple[FloatArray, float]],
) -> None:
    """Repeat the head of straight-on traffic beyond the junction, for drivers at the stop line."""
    if not straight:
        return
    connection = min(straight, key=lambda c: network.lane(c.to_lane).index)
    edge = next(e for e in network.edges if e.name == network.lane(connection.to_lane).edge)
    outer = next(lane for lane in edge.lanes if lane.kind != "walking")
    start, heading = _line_end(outer.centre_m, 0)
    pole = _kerb_position(site, start + 1.2 * heading, heading)
    base = pole - 0.12 * heading
    heads.append(SignalHead(np.array([*base, _HEAD_M]), -heading, number[f"{connection.signal}/{connection.link}"]))
    poles.append((pole, _HEAD_M + 1.1))


def _line_end(line_m: FloatArray, which: int) -> tuple[FloatArray, FloatArray]:
    """Return the first (0) or last (-1) point of a line and the unit direction there."""
    a, b = (line_m[0], line_m[1]) if which == 0 else (line_m[-2], line_m[-1])
    return np.asarray(line_m[which]), (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)


def _kerb_position(site: Site, xy_m: FloatArray, heading: FloatArray, half_m: float = 0.0) -> FloatArray:
    """Return the nearest ground behind the kerb to the right of a road point, moved along the street if necessary.

    Args:
        site: ground raster.
        xy_m: (2,) point on the road.
        heading: (2,) unit direction of travel.
        half_m: distance from the pole to the outer heads: all of them stay off the road.
    """
    right = np.array([heading[1], -heading[0]])
    back = _BEHIND_KERB_M + half_m
    for along in (0.0, -1.0, 1.0, -2.0, 2.0, -4.0, 4.0, -6.0, -9.0, -13.0):
        start = xy_m + along * heading
        offset = kerb_offset(site, start[None], right[None], back + half_m + 0.3)[0]
        pole = start + (offset + back) * right
        # Where the kerb bends around a corner, the distance across the street is not the shortest one to the road.
        if np.isfinite(offset) and site.distance_at(pole[None], site.to_road_m)[0] > half_m + 0.4:
            return np.asarray(pole)
    return np.asarray(xy_m + 14.0 * right)


def _heads(heads: list[SignalHead]) -> list[Mesh]:
    """Return housings with three tagged lamps each."""
    if not heads:
        return []
    template = _head()
    at = np.stack([head.xyz_m for head in heads])
    yaw = np.array([np.arctan2(head.towards[1], head.towards[0]) + np.pi / 2 for head in heads])
    mesh = instance_mesh(template, at, yaw, np.ones((len(heads), 3)))
    first = np.repeat(3 * np.array([head.link for head in heads]), len(template.faces))
    return [replace(mesh, tag=np.where(mesh.tag >= 0, mesh.tag + first, -1).astype(np.int32))]


def _head() -> Mesh:
    """Return one head that faces -y, its lower edge at the origin; the lamps' tags are 0, 1, 2."""
    builder = Builder()
    builder.add_boxes(ORIGIN, [-0.16, -0.12, 0.0], [0.16, 0.08, 0.98], Material.TRIM, _BLACK, sides="lrfbdt")
    builder.add_boxes(ORIGIN, [-0.23, 0.0, -0.07], [0.23, 0.02, 1.05], Material.TRIM, _BLACK, sides="lrfbdt")
    parts = []
    for lamp, tint in enumerate(_COLOURS):
        z = 0.81 - 0.32 * lamp
        disc = sign_plate(regular_polygon(10, 0.12), z, tint, -0.13, Material.SIGNAL, back=False)
        parts.append(replace(disc, tag=np.full(len(disc.faces), lamp, np.int32)))
        angle = np.linspace(-0.15, np.pi + 0.15, 5)
        x, up = 0.135 * np.cos(angle), z + 0.135 * np.sin(angle)
        for i in range(4):  # the visor, outside and inside
            near = [
                [x[i], -0.12, up[i]],
                [x[i + 1], -0.12, up[i + 1]],
                [x[i + 1], -0.3, up[i + 1]],
                [x[i], -0.3, up[i]],
            ]
            builder.add_quads(ORIGIN, [near[::-1], near], Material.TRIM, _BLACK)
    return join_meshes([builder.mesh(), *parts])


def _poles(poles: list[tuple[FloatArray, float]]) -> list[Mesh]:
    meshes = []
    for xy, height in poles:
        thick = (0.12, 0.09) if height > 5 else (0.07, 0.06)
        ends = np.array([*xy, 0.0]), np.array([*xy, height])
        meshes.append(tapered_rod(*ends, thick, 8, Material.METAL, _GREY, capped=True))
    return meshes


def _arms(arms: list[tuple[FloatArray, FloatArray]]) -> list[Mesh]:
    """Return the arms from the poles above the lanes."""
    height = _ARM_M + 0.6
    return [
        tapered_rod(
            np.array([*pole, height]),
            np.array([*tip, height + 0.25]),
            (0.08, 0.05),
            6,
            Material.METAL,
            _GREY,
            capped=True,
        )
        for pole, tip in arms
    ]
