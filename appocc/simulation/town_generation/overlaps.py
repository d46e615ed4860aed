"""Find overlapping bodies, and remove as few actors as possible."""

from __future__ import annotations

from collections import Counter

import cv2
import numpy as np

from appocc.checks import BoolArray, FloatArray
from appocc.geometry import footprints
from appocc.simulation.traffic import Actor

MOST_M2 = 0.04


def without_overlaps(actors: list[Actor], xy_m: FloatArray, yaw_rad: FloatArray, parked: BoolArray) -> BoolArray:
    """Return which of A actors to keep so that no two overlap by more than 0.04 m2 at any step.

    Parked actors are removed first, then those with the most overlaps, then those present for the shortest time.

    Args:
        actors: static properties of the actors.
        xy_m: (T, A, 2) centres; NaN while absent.
        yaw_rad: (T, A) headings.
        parked: (A,) whether an actor never moves.
    """
    pairs = overlapping(actors, xy_m, yaw_rad, parked)
    there = np.isfinite(xy_m[..., 0]).sum(axis=0)
    stays = np.ones(len(actors), np.bool_)
    while pairs:
        partners = Counter(k for pair in sorted(pairs) for k in pair)
        worst = max(partners, key=lambda k: (_rank(actors[k], bool(parked[k])), partners[k], -there[k], k))
        stays[worst] = False
        pairs = {pair for pair in pairs if worst not in pair}
    return stays


def _rank(actor: Actor, parked: bool) -> int:
    return 2 if parked else 1 if actor.kind == "pedestrian" else 0


def overlapping(
    actors: list[Actor], xy_m: FloatArray, yaw_rad: FloatArray, parked: BoolArray
) -> set[tuple[int, int]]:
    """Return pairs of actors that overlap by more than 0.04 m2 at some step; see `without_overlaps`."""
    size = np.array([actor.size_lwh_m[:2] for actor in actors]).reshape(-1, 2)
    reach = np.asarray(np.hypot(*size.T) / 2, dtype=np.float32)
    boxes = footprints(xy_m, yaw_rad, size).astype(np.float32)
    place = np.asarray(xy_m, dtype=np.float32)
    moving, found = np.flatnonzero(~parked), set[tuple[int, int]]()
    for t in range(len(xy_m)):
        rows = np.arange(len(actors)) if t == 0 else moving
        apart = place[t, rows, None] - place[t, None]
        near = (apart**2).sum(axis=-1) < (reach[rows, None] + reach[None]) ** 2
        for row, other in zip(*np.nonzero(near), strict=True):
            a, b = sorted((int(rows[row]), int(other)))
            if a != b and (a, b) not in found and cv2.intersectConvexConvex(boxes[t, a], boxes[t, b])[0] > MOST_M2:
                found.add((a, b))
    return found
