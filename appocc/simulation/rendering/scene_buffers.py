"""Town and actors in one set of triangle buffers for the kernels."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array
from appocc.nuscenes.view_targets import ViewClass
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.rendering.compiled import inlined

_KINDS = {
    ViewClass.BUILDING: (
        Material.BRICK,
        Material.PLASTER,
        Material.CONCRETE,
        Material.WINDOW,
        Material.SHOPFRONT,
        Material.ROOF_TILES,
        Material.FLAT_ROOF,
    ),
    ViewClass.VEGETATION: (Material.FOLIAGE, Material.BARK, Material.HEDGE),
    ViewClass.POLE_OR_SIGN: (Material.METAL, Material.STREET_LAMP, Material.SIGNAL, Material.SIGN),
}


class Triangles(NamedTuple):
    """The town's triangles, followed by those of the actors; arrays as in `Mesh`.

    Attributes:
        normals: (V, 3) float32.
        uv: (V, 2) float32.
        faces: (F, 3) int32.
        material: (F,) uint8.
        tint: (F, 3) uint8.
        tag: (F,) int32.
        kind: (F,) uint8 `ViewClass`.
    """

    normals: Float32Array
    uv: Float32Array
    faces: NDArray[np.int32]
    material: ByteArray
    tint: ByteArray
    tag: NDArray[np.int32]
    kind: ByteArray


@inlined
def normal_at(triangles: Triangles, face: int, u: float, v: float) -> tuple[float, float, float]:
    """Interpolate the unit normal between the vertices of a face."""
    a, b, c = triangles.faces[face]
    one, two, three = triangles.normals[a], triangles.normals[b], triangles.normals[c]
    w = 1 - u - v
    x = w * one[0] + u * two[0] + v * three[0]
    y = w * one[1] + u * two[1] + v * three[1]
    z = w * one[2] + u * two[2] + v * three[2]
    scale = 1 / math.sqrt(x * x + y * y + z * z + 1e-12)
    return x * scale, y * scale, z * scale


class SceneBuffers:
    """Buffers with the town's triangles at the front and room for the actors behind them."""

    def __init__(self, solid: Mesh) -> None:
        """Copy the town's triangles."""
        self.town_vertices, self.town_faces = len(solid.normals), len(solid.faces)
        self.triangles = _arrays(self.town_vertices, self.town_faces)
        self._write(solid, 0, 0, _static_kinds(solid))

    def set_actors(self, actors: Mesh) -> None:
        """Replace the actors behind the town's triangles."""
        vertices, faces = self.town_vertices + len(actors.normals), self.town_faces + len(actors.faces)
        if vertices > len(self.triangles.normals) or faces > len(self.triangles.faces):
            old, self.triangles = self.triangles, _arrays(vertices * 5 // 4, faces * 5 // 4)
            array: Any
            for name, array in self.triangles._asdict().items():
                array[: len(getattr(old, name))] = getattr(old, name)
        self._write(actors, self.town_vertices, self.town_faces, _actor_kinds(actors))

    def set_town_tints(self, tint: ByteArray) -> None:
        """Replace the tints (F, 3) uint8 of the town's triangles."""
        self.triangles.tint[: self.town_faces] = tint

    def _write(self, mesh: Mesh, vertex: int, face: int, kinds: ByteArray) -> None:
        rows, own = slice(vertex, vertex + len(mesh.normals)), slice(face, face + len(mesh.faces))
        self.triangles.normals[rows] = mesh.normals
        self.triangles.uv[rows] = mesh.uv
        np.add(mesh.faces, np.int32(vertex), out=self.triangles.faces[own])
        self.triangles.material[own] = mesh.material
        self.triangles.tint[own] = mesh.tint
        self.triangles.tag[own] = mesh.tag
        self.triangles.kind[own] = kinds


def _arrays(vertices: int, faces: int) -> Triangles:
    return Triangles(
        normals=np.empty((vertices, 3), np.float32),
        uv=np.empty((vertices, 2), np.float32),
        faces=np.empty((faces, 3), np.int32),
        material=np.empty(faces, np.uint8),
        tint=np.empty((faces, 3), np.uint8),
        tag=np.empty(faces, np.int32),
        kind=np.empty(faces, np.uint8),
    )


def _static_kinds(mesh: Mesh) -> ByteArray:
    table = np.full(256, ViewClass.OTHER, np.uint8)
    for kind, materials in _KINDS.items():
        table[list(materials)] = kind
    kinds = table[mesh.material]
    # Faces with a tag are parts of a building (awnings, rails, metal walls), or lamps of signals.
    kinds[(mesh.material != Material.SIGNAL) & (mesh.tag >= 0)] = ViewClass.BUILDING
    return kinds


def _actor_kinds(mesh: Mesh) -> ByteArray:
    """Classify actors by material: glass marks a vehicle, rubber without glass a two-wheeler, neither a person."""
    count = int(mesh.tag.max(initial=-1)) + 2
    panes = np.bincount(mesh.tag[mesh.material == Material.GLASS] + 1, minlength=count) > 0
    tyres = np.bincount(mesh.tag[mesh.material == Material.RUBBER] + 1, minlength=count) > 0
    kinds = np.where(panes, ViewClass.VEHICLE, np.where(tyres, ViewClass.TWO_WHEELER, ViewClass.PERSON))
    return kinds.astype(np.uint8)[mesh.tag + 1]
