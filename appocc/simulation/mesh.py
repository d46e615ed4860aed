"""Triangle meshes with materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array, check_dtype, check_shape, frozen


class Material(IntEnum):
    """Material of a surface; patterns that follow `uv` are computed when it is shaded."""

    PLAIN = 0  # matt, in the tint
    BRICK = 1  # uv in metres
    PLASTER = 2  # uv in metres
    CONCRETE = 3
    WINDOW = 4  # a pane with its frame; uv 0..1 across the pane; some are lit at night (by `tag`)
    SHOPFRONT = 5  # glass on a ground floor; uv in metres, scaled so that whole panes fit
    ROOF_TILES = 6  # uv in metres, v down the slope
    FLAT_ROOF = 7  # gravel
    FOLIAGE = 8  # leaves: mottled, lets some light through
    BARK = 9
    METAL = 10  # poles, rails
    STREET_LAMP = 11  # lit from dusk to dawn
    SIGNAL = 12  # lamp of a traffic light; tag = 3 * index in `signal_links` + (0 red, 1 yellow, 2 green)
    SIGN = 13  # retro-reflective plate in its tint
    PAINT = 14  # bodywork: clear coat over the actor's paint
    GLASS = 15  # of vehicles
    RUBBER = 16
    CHROME = 17
    HEAD_LAMP = 18
    TAIL_LAMP = 19  # brighter while braking
    INDICATOR_LEFT = 20
    INDICATOR_RIGHT = 21
    TRIM = 22  # dark plastic
    PLATE = 23  # number plate
    CLOTH = 24
    SKIN = 25
    HEDGE = 26


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh:
    """V vertices and F triangles, outward normals; x forward, y left, z up, metres.

    Attributes:
        vertices_m: (V, 3) float32.
        normals: (V, 3) float32, unit; vertices are not shared across sharp edges.
        uv: (V, 2) float32, meaning depends on the material.
        faces: (F, 3) int32, counter-clockwise seen from outside.
        material: (F,) uint8 `Material`.
        tint: (F, 3) uint8 sRGB base colour; the actor's paint replaces it where the material is PAINT.
        tag: (F,) int32 index of the actor (vehicles, people), of the signal lamp or of the building; else -1.
    """

    vertices_m: Float32Array
    normals: Float32Array
    uv: Float32Array
    faces: NDArray[np.int32]
    material: ByteArray
    tint: ByteArray
    tag: NDArray[np.int32]

    def __post_init__(self) -> None:
        """Check shapes and types.

        Raises:
            ShapeError: if one does not fit.
        """
        v, f = len(self.vertices_m), len(self.faces)
        expected: tuple[tuple[str, NDArray[np.generic], tuple[int, ...], type[np.generic]], ...] = (
            ("vertices_m", self.vertices_m, (v, 3), np.float32),
            ("normals", self.normals, (v, 3), np.float32),
            ("uv", self.uv, (v, 2), np.float32),
            ("faces", self.faces, (f, 3), np.int32),
            ("material", self.material, (f,), np.uint8),
            ("tint", self.tint, (f, 3), np.uint8),
            ("tag", self.tag, (f,), np.int32),
        )
        for name, array, shape, dtype in expected:
            check_shape(name, array, shape)
            check_dtype(name, array, dtype)
            frozen(array)


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes into one."""
    offsets = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes)])
    faces = [mesh.faces + np.int32(offset) for mesh, offset in zip(meshes, offsets, strict=False)]
    return Mesh(
        vertices_m=np.concatenate([mesh.vertices_m for mesh in meshes] or [np.zeros((0, 3), np.float32)]),
        normals=np.concatenate([mesh.normals for mesh in meshes] or [np.zeros((0, 3), np.float32)]),
        uv=np.concatenate([mesh.uv for mesh in meshes] or [np.zeros((0, 2), np.float32)]),
        faces=np.concatenate(faces or [np.zeros((0, 3), np.int32)]),
        material=np.concatenate([mesh.material for mesh in meshes] or [np.zeros(0, np.uint8)]),
        tint=np.concatenate([mesh.tint for mesh in meshes] or [np.zeros((0, 3), np.uint8)]),
        tag=np.concatenate([mesh.tag for mesh in meshes] or [np.zeros(0, np.int32)]),
    )
