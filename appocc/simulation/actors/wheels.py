"""Wheels with tyre, rim and spokes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.simulation.actors.materials import RUBBER, Finish
from appocc.simulation.actors.modelling import Modeller

_SEGMENTS = (10, 8, 4)


def add_wheels(
    model: Modeller,
    axles_x_m: Sequence[float],
    radius_m: float,
    outer_y_m: float,
    width_m: float,
    hub: Finish,
    detail: int,
) -> None:
    """Add wheels on both sides of the axles; their outer faces are at +-`outer_y_m`."""
    segments = _SEGMENTS[detail]
    turn = np.arange(segments + 1) * (2 * np.pi / segments)
    ring = np.stack([np.cos(turn), np.zeros(segments + 1), np.sin(turn)], axis=1)
    if detail == 2:
        ring = np.array([[0.7, 0.0, -1.0], [0.8, 0.0, 0.5], [-0.8, 0.0, 0.5], [-0.7, 0.0, -1.0], [0.7, 0.0, -1.0]])
    for axle in axles_x_m:
        middle = np.array([axle, outer_y_m, radius_m])
        inner = middle - [0.0, width_m, 0.0]
        tyre = middle + radius_m * ring
        if detail:
            model.add_fan(tyre[:-1], RUBBER, inner, axle, mirror=True)
            if detail == 1:
                hub_ring = middle + [0.0, 0.004, 0.0] + 0.6 * radius_m * ring
                model.add_fan(hub_ring[:-1], hub, inner, axle, mirror=True)
            continue
        rim = middle - [0.0, 0.006, 0.0] + 0.68 * radius_m * ring
        centre = np.broadcast_to(middle - [0.0, 0.03, 0.0], rim.shape)
        model.add_sheet(np.stack([inner + radius_m * ring, tyre, rim], axis=1), RUBBER, inner, axle)
        model.add_fan((inner + 0.95 * radius_m * ring)[:-1:2], RUBBER, middle, axle, mirror=True)
        spokes = [[hub if k % 2 else RUBBER] for k in range(segments)]
        model.add_sheet(np.stack([rim, centre], axis=1), spokes, inner, axle)
