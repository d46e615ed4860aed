"""Parked cars along kerbs and in car parks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray
from appocc.polylines import arc_m, points_at
from appocc.simulation.network import Edge, Lane
from appocc.simulation.plan import TownPlan
from appocc.simulation.town_generation.bodies import draw_body, draw_size
from appocc.simulation.traffic import Actor

_CORNER_M = 7.0  # no parking this close to a junction
_OCCUPIED, _IN_BAY, _FLIPPED = 0.8, 0.68, 0.08
_NARROWEST_M, _FASTEST_MPS = 1.9, 14.5
_MOST = 300
_MOUTH_M = 6.5
_KERB_M = 0.22
_LONGEST_IN_BAY_M = 5.1


class ParkedVehicle(NamedTuple):
    """A parked vehicle at (x, y) in metres with a heading."""

    actor: Actor
    x_m: float
    y_m: float
    yaw_rad: float


def draw_parked(plan: TownPlan, rng: np.random.Generator) -> list[ParkedVehicle]:
    """Draw the vehicles in the parking lanes and car parks of a town."""
    found = [
        spot for edge in plan.network.edges for lane in edge.lanes for spot in _park_at_kerb(plan, edge, lane, rng)
    ]
    keep = np.sort(rng.permutation(len(found))[:_MOST])
    spots = [found[k] for k in keep] + [spot for park in plan.car_parks for spot in _park_in_bays(park.bays, rng)]
    return [
        ParkedVehicle(Actor(f"parked_{k}", spot.actor.kind, spot.actor.body, spot.actor.size_lwh_m), *spot[1:])
        for k, spot in enumerate(spots)
    ]


def _draw_vehicle(rng: np.random.Generator) -> Actor:
    body = draw_body(rng, parked=True)
    return Actor("", body.kind, body.name, draw_size(rng, body))


def _allows_parking(edge: Edge, lane: Lane) -> bool:
    """Return whether cars may park in a lane: a parking lane or wide shoulder of a street that is not fast."""
    fastest = max((other.speed_mps for other in edge.lanes if other.kind == "driving"), default=0.0)
    return lane.kind in ("parking", "shoulder") and lane.width_m >= _NARROWEST_M and 0 < fastest < _FASTEST_MPS


def _park_at_kerb(plan: TownPlan, edge: Edge, lane: Lane, rng: np.random.Generator) -> list[ParkedVehicle]:
    if not _allows_parking(edge, lane):
        return []
    line = lane.centre_m
    end_m = float(arc_m(line)[-1])
    one_way = plan.network.opposite(edge) is None
    found: list[ParkedVehicle] = []
    at = _CORNER_M + rng.uniform(0, 3)
    while True:
        actor = _draw_vehicle(rng)
        length, width, _ = actor.size_lwh_m
        if at + length > end_m - _CORNER_M:
            return found
        ends = points_at(line, np.array([at, at + length]))
        yaw = float(np.arctan2(*(ends[1] - ends[0])[::-1]))
        # The wheels are at the kerb: vehicles wider than the lane protrude into the road.
        off = _KERB_M + (width - lane.width_m) / 2 + float(np.clip(rng.normal(0.0, 0.07), -0.12, 0.2))
        side = off if lane.index == 0 or edge.lanes[0].kind != lane.kind else -off
        x, y = ends.mean(axis=0) + side * np.array([-np.sin(yaw), np.cos(yaw)])
        turned = rng.uniform() < (_FLIPPED * 2 if one_way else _FLIPPED)
        yaw += float(rng.normal(0.0, 0.025)) + (np.pi if turned else 0.0)
        if rng.uniform() < _OCCUPIED and not _blocks_driveway(plan, ends.mean(axis=0)):
            found.append(ParkedVehicle(actor, float(x), float(y), float(np.mod(yaw + np.pi, 2 * np.pi) - np.pi)))
            at += length + rng.uniform(0.6, 1.6)
        else:
            at += 5.5


def _blocks_driveway(plan: TownPlan, xy_m: FloatArray) -> bool:
    """Return whether a position at the kerb blocks the driveway of a car park."""
    mouths = [park.outline_m[:2].mean(axis=0) for park in plan.car_parks]
    return any(float(np.hypot(*(mouth - xy_m))) < _MOUTH_M for mouth in mouths)


def _park_in_bays(bays: FloatArray, rng: np.random.Generator) -> list[ParkedVehicle]:
    found = []
    for x, y, yaw in bays:
        actor = _draw_vehicle(rng)
        dx, dy, turn = rng.normal(0.0, 0.15), rng.normal(0.0, 0.06), rng.normal(0.0, 0.02)
        if rng.uniform() < _IN_BAY and actor.size_lwh_m[0] < _LONGEST_IN_BAY_M:
            ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
            centre = np.array([x, y]) + dx * ahead + dy * left
            heading = yaw + turn + (np.pi if rng.uniform() < 0.25 else 0.0)
            heading = float(np.mod(heading + np.pi, 2 * np.pi) - np.pi)
            found.append(ParkedVehicle(actor, float(centre[0]), float(centre[1]), heading))
    return found
