"""Trace rays against town, actors and the ground plane (Embree)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array
from appocc.simulation.mesh import Mesh
from appocc.simulation.rendering.compiled import kernel
from appocc.simulation.rendering.embree import RayScene, build_scene

SKY, GROUND, TOWN, ACTOR = range(4)
_FAR_M = np.float32(1e30)


@dataclass(frozen=True, eq=False)
class Hits:
    """First hits of N rays.

    Attributes:
        distance_m: (N,) float32 along the ray; infinite for the sky.
        source: (N,) uint8: SKY, GROUND (the plane z = 0), TOWN or ACTOR.
        face: (N,) int32 face of the mesh of TOWN or ACTOR, else -1.
        uv: (N, 2) float32 barycentric weights of the face's second and third vertex.
    """

    distance_m: Float32Array
    source: ByteArray
    face: NDArray[np.int32]
    uv: Float32Array


class Tracer:
    """Traces rays in the town frame; the actors' mesh is replaced for every frame."""

    def __init__(self, solid: Mesh) -> None:
        """Build the search tree of the static scenery."""
        self.set_solid(solid)
        self._actors: RayScene | None = None

    def set_solid(self, solid: Mesh) -> None:
        """Replace the static scenery by one with the same faces."""
        self._solid = build_scene(solid)

    def set_actors(self, actors: Mesh) -> None:
        """Replace the actors."""
        self._actors = build_scene(actors)

    def nearest(self, origins: Float32Array, directions: Float32Array) -> Hits:
        """Return the first hits of rays from (N, 3) along unit (N, 3); float32, town frame."""
        distance, source = _trace_plane(origins, directions)
        face = np.full(len(distance), -1, np.int32)
        uv = np.zeros((len(distance), 2), np.float32)
        for number, scene in ((TOWN, self._solid), (ACTOR, self._actors)):
            if scene is not None:
                # Each scene limits the distance for the next one.
                _merge_hits(*scene.nearest(origins, directions, distance), number, source, face, uv)
        distance[source == SKY] = np.inf
        return Hits(distance, source, face, uv)

    def blocked(self, origins: Float32Array, directions: Float32Array) -> BoolArray:
        """Return whether rays from (N, 3) along unit (N, 3) hit the town or an actor (the ground does not count)."""
        blocked = np.zeros(len(origins), np.bool_)
        for scene in (self._solid, self._actors):
            if scene is not None:
                blocked |= scene.blocked(origins, directions)
        return blocked


@kernel
def _trace_plane(origins: Float32Array, directions: Float32Array) -> tuple[Float32Array, ByteArray]:
    """Return the distance to the plane z = 0 and GROUND, or a large distance and SKY."""
    count = len(origins)
    distance, source = np.empty(count, np.float32), np.empty(count, np.uint8)
    for i in range(count):
        down = directions[i, 2]
        meets = down < -1e-6 and origins[i, 2] > 0
        distance[i] = -origins[i, 2] / down if meets else _FAR_M
        source[i] = GROUND if meets else SKY
    return distance, source


@kernel
def _merge_hits(
    found: NDArray[np.int32],
    weights: Float32Array,
    number: int,
    source: ByteArray,
    face: NDArray[np.int32],
    uv: Float32Array,
) -> None:
    """Write the hits of a scene, which are nearer than all earlier ones."""
    for i in range(len(found)):
        if found[i] >= 0:
            source[i], face[i] = number, found[i]
            uv[i, 0], uv[i, 1] = weights[i, 0], weights[i, 1]
