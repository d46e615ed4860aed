"""Sides of the ego that no camera sees, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.bevmap import BEVMap
from appocc.ego_vehicle import EgoVehicle

# Middle direction of each side; cells within this angle of it belong to the side.
_SIDES = {"ahead of us": 0.0, "on our left": np.pi / 2, "on our right": -np.pi / 2, "behind us": np.pi}
_HALF_SIDE_RAD = np.pi / 6
# A side is unseen if the cameras see less than this share of its cells.
_MIN_SEEN = 0.1


def unseen_sides(bev: BEVMap, ego: EgoVehicle) -> list[str]:
    """Return the sides of the ego that no camera of a prediction sees, such as "behind us"; none for other maps."""
    if not bev.unseen.any():
        return []
    x_m, y_m = np.moveaxis(bev.grid.centres(), -1, 0)
    away = (x_m - ego.centre_m) + 1j * y_m
    unseen = []
    for words, middle_rad in _SIDES.items():
        side = np.abs(np.angle(away * np.exp(-1j * middle_rad))) < _HALF_SIDE_RAD
        if side.any() and bev.unseen[side].mean() > 1 - _MIN_SEEN:
            unseen.append(words)
    return unseen


def unseen_reason(sides: Sequence[str]) -> str:
    """Return the sides as a sentence: "behind us and on our left nothing is seen"."""
    *most, last = sides
    return f"{', '.join(most)} and {last} nothing is seen" if most else f"{last} nothing is seen"
