"""Streets on a slope: the ground leans relative to gravity, and what is built on it stays upright.

The town frame lies on the ground, where vehicles stand; seen from it, houses, poles and trees lean. A network that
takes the edges of houses for the vertical of the street is wrong by the slope, some degrees in most towns.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.checks import Float32Array
from appocc.simulation.mesh import Material, Mesh

# Standard deviation of the slope along each axis, and its limit: 3.5 % is usual, 9 % is steep.
_USUAL, _MOST = 0.035, 0.09

Slope = tuple[float, float]


def draw_slope(random: np.random.Generator) -> Slope:
    """Draw the slope of a scene: the rise of the ground along x and y of the town, metre a metre."""
    east, north = np.clip(random.normal(0.0, _USUAL, 2), -_MOST, _MOST)
    return float(east), float(north)


def lean_scenery(solid: Mesh, slope: Slope) -> Mesh:
    """Return the static scenery as it stands on a slope, in the frame of the ground.

    Everything leans uphill, by small angles. Houses also keep their floors and roofs horizontal: their uphill sides
    are dug into the ground.

    Args:
        solid: scenery of a town on level ground.
        slope: rise of the ground along x and y, metre a metre.
    """
    if not any(slope):
        return solid
    rise = np.array(slope, np.float32)
    vertices = solid.vertices_m.copy()
    vertices[:, :2] += vertices[:, 2:] * rise
    vertices[:, 2] -= _depth_in_ground(solid, rise)
    return replace(solid, vertices_m=vertices)


def _depth_in_ground(solid: Mesh, rise: Float32Array) -> Float32Array:
    """Return how deep (V,) the ground buries the vertices of houses: its rise since their lowest corner."""
    owner = np.full(len(solid.vertices_m), -1, np.int32)
    houses = (solid.tag >= 0) & (solid.material != Material.SIGNAL)  # lamps of signals have tags too
    owner[solid.faces[houses]] = solid.tag[houses, None]
    own = np.flatnonzero(owner >= 0)
    height = (solid.vertices_m[own, :2] * rise).sum(axis=1)  # a matrix product rounds otherwise on other processors
    lowest = np.full(owner.max(initial=-1) + 1, np.inf, np.float32)
    np.minimum.at(lowest, owner[own], height)
    depth = np.zeros(len(owner), np.float32)
    depth[own] = height - lowest[owner[own]]
    return depth
