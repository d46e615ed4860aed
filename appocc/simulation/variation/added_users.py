"""People who cross the street and cyclists who ride along it, in the gaps of the traffic around the ego."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.polylines import directions_at, length_m, points_at, shifted
from appocc.simulation.network import Lane, RoadNetwork
from appocc.simulation.surface import ROAD_SURFACES, Ground, Surface, surface_table
from appocc.simulation.town import Town
from appocc.simulation.town_generation.bodies import ADULT, CHILD, VEHICLES, draw_size
from appocc.simulation.traffic import Actor
from appocc.simulation.variation.excerpt import Excerpt
from appocc.simulation.variation.exchanged_bodies import labels_at

# Largest numbers that are drawn, and how often a place is drawn for each.
_CROSSING, _CYCLING, _TRIES = 7, 4, 25
_RANGE_M = (4.0, 38.0)
_CHILDREN = 0.2
_WALKING_MPS, _CYCLING_MPS = (0.9, 1.8), (3.2, 6.0)
# People wait this far from the kerb, where street lamps and trees are not; the widest street they cross.
_WAIT_M, _WIDEST_M, _LOOK_M = 1.4, 20.0, 0.25
# Distance of a bicycle from the right edge of its lane; the discs that cover it, and their radius, also a person's.
_EDGE_M, _DISCS_M, _RADIUS_M = 0.55, (-0.6, 0.0, 0.6), 0.35
_SPACING_M, _END_M = 2.0, 1.2


class _Path(NamedTuple):
    """Positions at the steps of the scene (S, 2), and headings (S,)."""

    xy_m: FloatArray
    yaw_rad: FloatArray


class _Places(NamedTuple):
    """Points (N, 2) on the rightmost lanes for cars: the lane (N,) and the distance along it (N,)."""

    lanes: tuple[Lane, ...]
    xy_m: FloatArray
    lane: IntArray
    along_m: FloatArray


def add_users(scene: Excerpt, town: Town, random: np.random.Generator) -> Excerpt:
    """Return the scene with people who cross the street and with cyclists, each clear of everybody else.

    People wait at the kerb, cross at right angles and stay on the other side; cyclists keep to the right edge of a
    lane and wait at its end.
    """
    places = _find_places(town.plan.network)
    bicycle = next(body for body in VEHICLES if body.name == "bicycle")
    for k in range(int(random.integers(1, _CROSSING + 1))):
        body = CHILD if random.random() < _CHILDREN else ADULT
        actor = Actor(f"crossing_{k}", body.kind, body.name, draw_size(random, body))
        scene = _with_user(scene, actor, _draw_crossings(scene, places, town.ground, random), (0.0,))
    for k in range(int(random.integers(0, _CYCLING + 1))):
        actor = Actor(f"cyclist_{k}", bicycle.kind, bicycle.name, draw_size(random, bicycle))
        scene = _with_user(scene, actor, _draw_rides(scene, places, random), _DISCS_M)
    return scene


def _with_user(scene: Excerpt, actor: Actor, paths: Iterable[_Path], discs_m: tuple[float, ...]) -> Excerpt:
    """Return the scene with an actor on the first path that is clear, or without it if none is."""
    for path in paths:
        ahead = np.stack([np.cos(path.yaw_rad), np.sin(path.yaw_rad)], axis=1)
        discs = path.xy_m[:, None] + ahead[:, None] * np.array(discs_m)[:, None]
        if scene.keeps_clear(discs, _RADIUS_M):
            return scene.with_user(actor, *path)
    return scene


def _find_places(network: RoadNetwork) -> _Places:
    driving = ([lane for lane in edge.lanes if lane.kind == "driving"] for edge in network.edges)
    lanes = tuple(min(found, key=lambda lane: lane.index) for found in driving if found)
    lanes = tuple(lane for lane in lanes if length_m(lane.centre_m) > 2 * _END_M)
    along = [np.arange(_END_M, length_m(lane.centre_m) - _END_M, _SPACING_M) for lane in lanes]
    return _Places(
        lanes,
        np.concatenate([np.zeros((0, 2)), *map(points_at, (lane.centre_m for lane in lanes), along)]),
        np.repeat(np.arange(len(lanes)), np.array([len(row) for row in along], np.int64)),
        np.concatenate([np.zeros(0), *along]),
    )


def _draw_meetings(
    scene: Excerpt, places: _Places, random: np.random.Generator
) -> Iterator[tuple[Lane, float, FloatArray]]:
    """Draw places near the ego: the lane, the distance along it, and the seconds (S,) from the time of the place."""
    for _ in range(_TRIES):
        step = int(random.integers(len(scene.xy_m)))
        away = np.hypot(*(places.xy_m - scene.xy_m[step, scene.ego]).T)
        near = np.flatnonzero((away > _RANGE_M[0]) & (away < _RANGE_M[1]))
        if len(near):
            row = int(random.choice(near))
            yield places.lanes[places.lane[row]], float(places.along_m[row]), scene.seconds - scene.seconds[step]


def _draw_crossings(scene: Excerpt, places: _Places, ground: Ground, random: np.random.Generator) -> Iterator[_Path]:
    """Draw ways from kerb to kerb across the street."""
    for lane, along_m, seconds in _draw_meetings(scene, places, random):
        place, ahead = (f(lane.centre_m, np.array([along_m]))[0] for f in (points_at, directions_at))
        across = np.array([-ahead[1], ahead[0]]) * random.choice([-1, 1])
        before_m, beyond_m = (_pavement_m(ground, place, side) for side in (-across, across))
        if before_m + beyond_m > _WIDEST_M:
            continue
        at = np.clip(random.uniform(*_WALKING_MPS) * seconds, -before_m, beyond_m)
        yaw = float(np.arctan2(across[1], across[0]))
        yield _Path(place + at[:, None] * across, np.full(len(at), yaw))


def _pavement_m(ground: Ground, place_m: FloatArray, way: FloatArray) -> float:
    """Return the distance from a point on the road to a place on the pavement in a direction; infinite for none."""
    steps = np.arange(0.0, _WIDEST_M, _LOOK_M)
    road = surface_table(ROAD_SURFACES)[labels_at(ground, place_m + steps[:, None] * way)]
    if road.all():
        return np.inf
    edge = float(steps[np.argmin(road)])
    stand = labels_at(ground, place_m + (edge + _WAIT_M) * way)
    return edge + _WAIT_M if stand == Surface.PAVEMENT else np.inf


def _draw_rides(scene: Excerpt, places: _Places, random: np.random.Generator) -> Iterator[_Path]:
    """Draw ways along the right edge of a lane."""
    for lane, along_m, seconds in _draw_meetings(scene, places, random):
        line = shifted(lane.centre_m, _EDGE_M - lane.width_m / 2)
        at = along_m + random.uniform(*_CYCLING_MPS) * seconds
        at = np.clip(at, _END_M, length_m(line) - _END_M)
        yield _Path(points_at(line, at), np.arctan2(*directions_at(line, at).T[::-1]))
