"""The sides of the ego on which no camera sees anything, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.bevmap import BEVMap
from grounding.scene_object import EGO_CENTRE_M

# Each side with the direction of its middle; cells within this angle of it belong to it.
_SIDES = {"ahead of us": 0.0, "on our left": np.pi / 2, "on our right": -np.pi / 2, "behind us": np.pi}
_HALF_SIDE_RAD = np.pi / 6
# A side of which the cameras see a smaller share of the cells is unseen.
_LEAST_SEEN = 0.1


def unseen_sides(bev: BEVMap) -> list[str]:
    """The sides of the ego that no camera of a prediction sees, such as "behind us"; none of other maps."""
    if not bev.unseen.any():
        return []
    x_m, y_m = np.moveaxis(bev.grid.centres(), -1, 0)
    away = (x_m - EGO_CENTRE_M) + 1j * y_m
    unseen = []
    for words, middle_rad in _SIDES.items():
        side = np.abs(np.angle(away * np.exp(-1j * middle_rad))) < _HALF_SIDE_RAD
        if side.any() and bev.unseen[side].mean() > 1 - _LEAST_SEEN:
            unseen.append(words)
    return unseen


def unseen_reason(sides: Sequence[str]) -> str:
    """The sides in a sentence: "behind us and on our left nothing is seen"."""
    *most, last = sides
    return f"{', '.join(most)} and {last} nothing is seen" if most else f"{last} nothing is seen"
