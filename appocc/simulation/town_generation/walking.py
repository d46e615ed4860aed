"""Pedestrians who walk on the pavements around blocks."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from appocc.checks import FloatArray
from appocc.polylines import arc_m
from appocc.simulation.town_generation.bodies import ADULT, CHILD, draw_size
from appocc.simulation.town_generation.carriageway import Carriageway
from appocc.simulation.traffic import Actor

_SHORTEST_M = 90.0
_SMOOTH_CELLS = 5.0  # of the raster
# Pedestrians of one direction keep to one side of the pavement.
_SIDES_M = (1.15, 1.85)


def draw_walkers(
    carriageway: Carriageway, count: int, times_s: FloatArray, rng: np.random.Generator
) -> tuple[list[Actor], FloatArray, FloatArray]:
    """Draw pedestrians, their positions (T, count, 2) and headings (T, count) at times (T,)."""
    loops = [[_loop(line) for line in carriageway.contours(side)] for side in _SIDES_M]
    loops = [[ring for ring in rings if ring[-1, 2] > _SHORTEST_M] for rings in loops]
    actors: list[Actor] = []
    places, headings = np.zeros((len(times_s), count, 2)), np.zeros((len(times_s), count))
    if not all(loops):
        return [], places[:, :0], headings[:, :0]
    for k in range(count):
        side = int(rng.integers(2))
        lengths = np.array([ring[-1, 2] for ring in loops[side]])
        ring = loops[side][int(rng.choice(len(lengths), p=lengths / lengths.sum()))]
        body = CHILD if rng.uniform() < 0.12 else ADULT
        speed = rng.uniform(1.0, 1.6) * (1 if side else -1)
        places[:, k], headings[:, k] = _walk(ring, rng.uniform(0, ring[-1, 2]), speed, times_s)
        actors.append(Actor(f"pedestrian_{k}", body.kind, body.name, draw_size(rng, body)))
    return actors, places, headings


def _loop(line_m: FloatArray) -> FloatArray:
    """Return a closed line as (N + 1, 3): x, y and arc length; the raster steps are smoothed."""
    smooth = np.stack([gaussian_filter1d(line_m[:, axis], _SMOOTH_CELLS, mode="wrap") for axis in (0, 1)], axis=1)
    closed = np.concatenate([smooth, smooth[:1]])
    return np.concatenate([closed, arc_m(closed)[:, None]], axis=1)


def _walk(ring: FloatArray, start_m: float, speed_mps: float, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions (T, 2) and headings (T,); pedestrians turn gradually around corners."""
    at = start_m + speed_mps * times_s
    way = float(np.copysign(0.6, speed_mps))
    before, here, ahead = (_interpolate(ring, at + shift) for shift in (-way, 0.0, way))
    return here, np.arctan2(*(ahead - before).T[::-1])


def _interpolate(ring: FloatArray, along_m: FloatArray) -> FloatArray:
    wrapped = np.mod(along_m, ring[-1, 2])
    return np.stack([np.interp(wrapped, ring[:, 2], ring[:, axis]) for axis in (0, 1)], axis=1)
