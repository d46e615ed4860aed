"""Moving cars that become trucks, buses, motorcycles and bicycles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import footprints
from appocc.simulation.surface import CELL_M, ROAD_SURFACES, Ground, surface_table
from appocc.simulation.town_generation.bodies import VEHICLES, BodyType, draw_size
from appocc.simulation.town_generation.motion import vehicle_motion
from appocc.simulation.town_generation.overlaps import overlapping
from appocc.simulation.traffic import Actor
from appocc.simulation.variation.excerpt import Excerpt

# Share of the moving cars within a range of the ego that change in each of some rounds, and what they become.
_SHARE, _ROUNDS, _RANGE_M = 0.35, 2, 70.0
_BODIES = {"box_truck": 0.32, "bus": 0.4, "motorcycle": 0.18, "bicycle": 0.1}
# Bicycles replace slow cars only.
_CYCLING_MPS = 6.5
_MOVING_M = 1.0
_GAP_M = (1.0, 0.3)


def exchange_bodies(scene: Excerpt, ground: Ground, random: np.random.Generator) -> Excerpt:
    """Return the scene with other bodies for some moving cars, wherever they fit on the road and touch nobody.

    The front bumper keeps its path; the rear axle follows it as far behind as the new length demands.
    """
    for _ in range(_ROUNDS):
        scene = _exchange_some(scene, ground, random)
    return scene


def _exchange_some(scene: Excerpt, ground: Ground, random: np.random.Generator) -> Excerpt:
    """Return the scene with other bodies for some of the cars that it still has."""
    changed, exchanged = scene, []
    for row in _moving_cars(scene):
        if random.random() < _SHARE:
            body = _draw_body(scene, row, random)
            changed = _exchanged(changed, row, body, draw_size(random, body))
            exchanged.append(row)
    misfits = {row for row in exchanged if not _is_on_road(changed, row, ground)} | _touching(changed, exchanged)
    for row in misfits:
        changed = _restored(changed, row, scene)
    return changed


def _moving_cars(scene: Excerpt) -> list[int]:
    way_m = np.nansum(np.hypot(*np.moveaxis(np.diff(scene.xy_m, axis=0), -1, 0)), axis=0)
    near = scene.near_ego(_RANGE_M) & (way_m > _MOVING_M)
    return [int(row) for row in np.flatnonzero(near) if row != scene.ego and scene.actors[row].kind in ("car", "van")]


def _draw_body(scene: Excerpt, row: int, random: np.random.Generator) -> BodyType:
    name = str(random.choice(list(_BODIES), p=list(_BODIES.values())))
    speed = np.hypot(*np.diff(scene.xy_m[:, row], axis=0).T) / scene.step_s
    if name == "bicycle" and np.nanmax(speed) > _CYCLING_MPS:
        name = "motorcycle"
    return next(body for body in VEHICLES if body.name == name)


def _exchanged(scene: Excerpt, row: int, body: BodyType, size_lwh_m: tuple[float, float, float]) -> Excerpt:
    there = np.isfinite(scene.yaw_rad[:, row])
    yaw = scene.yaw_rad[there, row]
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    front = scene.xy_m[there, row] + ahead * scene.size_m[row, 0] / 2
    centre, turned, _ = vehicle_motion(front[:, None], yaw[:, None], np.array(size_lwh_m[:1]))
    xy, headings = scene.xy_m.copy(), scene.yaw_rad.copy()
    xy[there, row], headings[there, row] = centre[:, 0], turned[:, 0]
    actors = list(scene.actors)
    actors[row] = Actor(actors[row].name, body.kind, body.name, size_lwh_m)
    return replace(scene, actors=tuple(actors), xy_m=xy, yaw_rad=headings)


def _restored(scene: Excerpt, row: int, original: Excerpt) -> Excerpt:
    xy, yaw, actors = scene.xy_m.copy(), scene.yaw_rad.copy(), list(scene.actors)
    xy[:, row], yaw[:, row], actors[row] = original.xy_m[:, row], original.yaw_rad[:, row], original.actors[row]
    return replace(scene, actors=tuple(actors), xy_m=xy, yaw_rad=yaw)


def _is_on_road(scene: Excerpt, row: int, ground: Ground) -> bool:
    """Return whether the corners of a body stay on the carriageway."""
    there = np.isfinite(scene.yaw_rad[:, row])
    if not np.isfinite(scene.xy_m[there, row]).all():
        return False
    corners = footprints(scene.xy_m[there, row], scene.yaw_rad[there, row], scene.size_m[row])
    return bool(surface_table(ROAD_SURFACES)[labels_at(ground, corners)].all())


def labels_at(ground: Ground, points_m: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """Return the `Surface` (...) at points (..., 2) of the town frame; beyond the ground, that of its border."""
    cell = np.floor((points_m - ground.low_m) / CELL_M).astype(np.int64)
    high, wide = ground.label.shape
    return np.asarray(ground.label[np.clip(cell[..., 1], 0, high - 1), np.clip(cell[..., 0], 0, wide - 1)])


def _touching(scene: Excerpt, exchanged: list[int]) -> set[int]:
    """Return which of the exchanged bodies, enlarged by a gap, overlap another body."""
    rows = np.flatnonzero(scene.near_ego(_RANGE_M + 30.0))
    actors = [scene.actors[row] for row in rows]
    for k, row in enumerate(rows):
        if row in exchanged:
            length, width, height = actors[k].size_lwh_m
            actors[k] = replace(actors[k], size_lwh_m=(length + _GAP_M[0], width + _GAP_M[1], height))
    pairs = overlapping(actors, scene.xy_m[:, rows], scene.yaw_rad[:, rows], scene.parked[rows])
    return {int(rows[k]) for pair in pairs for k in pair} & set(exchanged)
