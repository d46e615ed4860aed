"""Mesh builder of flat quads and triangles; instances of small meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from appocc.checks import BoolArray, FloatArray
from appocc.simulation.mesh import Material, Mesh

Tint = tuple[int, int, int]
UNIT_UV = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
_SIDES = "lrfbdt"  # left, right, front, back, down, top
_CORNERS = np.array(  # corners of each side of a box: 0 low, 1 high along (s, d, z), counter-clockwise from outside
    [
        [[0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 1, 1]],
        [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
        [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[1, 1, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]],
        [[0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    ]
)


@dataclass(frozen=True, eq=False)
class LocalFrame:
    """A local frame on the ground: s to the right as seen from the street, d away from it, z up (right-handed).

    Attributes:
        origin_m: (2,) origin, town frame.
        along: (2,) unit direction of s; d is 90 degrees to its left.
    """

    origin_m: FloatArray
    along: FloatArray

    @property
    def inward(self) -> FloatArray:
        """(2,) unit direction of d."""
        return np.array([-self.along[1], self.along[0]])

    def at(self, s: float, d: float) -> FloatArray:
        """Return the (2,) town position of a point."""
        return np.asarray(self.origin_m + s * self.along + d * self.inward)

    def moved(self, s: float, d: float, quarter_turns: int = 0) -> LocalFrame:
        """Return the frame moved to another point of this one and rotated to the left."""
        along = (self.along, self.inward, -self.along, -self.inward)[quarter_turns % 4]
        return LocalFrame(self.at(s, d), along)

    def corners(self, s0: float, s1: float, d0: float, d1: float) -> FloatArray:
        """Return the (4, 2) town corners of a rectangle, counter-clockwise."""
        return self.to_town(np.array([[s0, d0], [s1, d0], [s1, d1], [s0, d1]]))

    def to_town(self, local: FloatArray) -> FloatArray:
        """Return the (..., 2) town positions of points (..., 2) given as s and d."""
        return np.asarray(self.origin_m + local @ np.array([self.along, self.inward]))


class Builder:
    """Collects faces; normals follow from the winding, vertices are not shared."""

    def __init__(self) -> None:
        """Start an empty mesh."""
        self._quads: list[tuple[LocalFrame, FloatArray, FloatArray | None]] = []
        self._triangles: list[tuple[LocalFrame, FloatArray, None]] = []
        self._quad_attributes: list[tuple[int, ArrayLike, ArrayLike, int]] = []
        self._triangle_attributes: list[tuple[int, ArrayLike, ArrayLike, int]] = []

    def add_quads(
        self,
        frame: LocalFrame,
        local: ArrayLike,
        material: ArrayLike,
        tint: ArrayLike,
        tag: int = -1,
        uv: FloatArray | None = None,
    ) -> None:
        """Add (N, 4, 3) quads of local points, counter-clockwise; `uv` (4, 2) or (N, 4, 2), by default metres."""
        corners = np.asarray(local, np.float64).reshape(-1, 4, 3)
        self._quads.append((frame, corners, uv))
        self._quad_attributes.append((len(corners), material, tint, tag))

    def add_triangles(
        self, frame: LocalFrame, local: ArrayLike, material: Material, tint: ArrayLike, tag: int = -1
    ) -> None:
        """Add (N, 3, 3) triangles of local points, counter-clockwise."""
        corners = np.asarray(local, np.float64).reshape(-1, 3, 3)
        self._triangles.append((frame, corners, None))
        self._triangle_attributes.append((len(corners), material, tint, tag))

    def add_boxes(
        self,
        frame: LocalFrame,
        low: ArrayLike,
        high: ArrayLike,
        material: Material,
        tint: ArrayLike,
        tag: int = -1,
        sides: str = "lrfbt",
    ) -> None:
        """Add boxes between local corners (N, 3), with the sides of l, r, f, b, d, t that are listed."""
        ends = np.stack([np.reshape(np.asarray(v, np.float64), (-1, 3)) for v in (low, high)], axis=1)
        which = _CORNERS[[_SIDES.index(side) for side in sides]]
        self.add_quads(frame, ends[:, which, np.arange(3)], material, tint, tag)

    def mesh(self) -> Mesh:
        """Return the mesh of all collected faces."""
        quads, triangles = _in_town(self._quads, 4), _in_town(self._triangles, 3)
        quad_uv, quad_normal = _metric_uv(quads)
        start = 0
        for _, corners, uv in self._quads:
            if uv is not None:
                quad_uv[start : start + len(corners)] = uv
            start += len(corners)
        triangle_uv, triangle_normal = _metric_uv(triangles)
        faces = np.arange(4 * len(quads)).reshape(-1, 4)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
        rest = 4 * len(quads) + np.arange(3 * len(triangles)).reshape(-1, 3)
        attributes = [
            np.concatenate([np.repeat(a, 2, axis=0), b])
            for a, b in zip(_attributes(self._quad_attributes), _attributes(self._triangle_attributes), strict=True)
        ]
        return Mesh(
            vertices_m=np.concatenate([quads.reshape(-1, 3), triangles.reshape(-1, 3)]).astype(np.float32),
            normals=np.concatenate([np.repeat(quad_normal, 4, axis=0), np.repeat(triangle_normal, 3, axis=0)]).astype(
                np.float32
            ),
            uv=np.concatenate([quad_uv.reshape(-1, 2), triangle_uv.reshape(-1, 2)]).astype(np.float32),
            faces=np.concatenate([faces, rest]).astype(np.int32),
            material=attributes[0].astype(np.uint8),
            tint=attributes[1].astype(np.uint8),
            tag=attributes[2].astype(np.int32),
        )


def _in_town(parts: Sequence[tuple[LocalFrame, FloatArray, FloatArray | None]], corners: int) -> FloatArray:
    """Transform faces to (N, corners, 3) in the town frame, vectorized over all local frames."""
    local = np.concatenate([np.zeros((0, corners, 3)), *(part for _, part, _ in parts)])
    frames = np.array([[*frame.origin_m, *frame.along] for frame, _, _ in parts]).reshape(-1, 4)
    x, y, cos, sin = np.repeat(frames, [len(part) for _, part, _ in parts], axis=0).T[..., None]
    s, d = local[..., 0], local[..., 1]
    return np.stack([x + s * cos - d * sin, y + s * sin + d * cos, local[..., 2]], axis=-1)


def _metric_uv(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (N, K, 2) metres along and across the first edge, and (N, 3) unit normals, of (N, K, 3) flat faces."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0])
    if corners.shape[1] == 4:  # the diagonals, in case two corners coincide
        across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    first = corners[:, 1] - corners[:, 0]
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    offset = corners - corners[:, :1]
    axes = np.stack([first, np.cross(normal, first)], axis=-1)
    return np.asarray(offset @ axes), normal


def _attributes(attributes: list[tuple[int, ArrayLike, ArrayLike, int]]) -> tuple[NDArray[np.int64], ...]:
    """Return material (N,), tint (N, 3) and tag (N,) of each face."""
    total = sum(count for count, *_ in attributes)
    material, tint, tag = np.zeros(total, np.int64), np.zeros((total, 3), np.int64), np.zeros(total, np.int64)
    start = 0
    for count, *style in attributes:
        part = slice(start, start + count)
        material[part], tint[part], tag[part] = style
        start += count
    return material, tint, tag


def instance_mesh(
    template: Mesh,
    xyz_m: FloatArray,
    yaw_rad: FloatArray,
    scale: FloatArray,
    tint: NDArray[np.integer] | None = None,
    tinted: BoolArray | None = None,
) -> Mesh:
    """Return K instances of a mesh: each scaled (K, 3), rotated (K,) about z, and translated by (K, 3), town frame.

    Args:
        template: mesh around its own origin.
        xyz_m: (K, 3) positions of the origins.
        yaw_rad: (K,).
        scale: (K, 3) along the template's own axes.
        tint: (K, 3) sRGB that replaces the template's tint in the faces of `tinted`.
        tinted: (F,) which faces get the tint.
    """
    count, corners, faces = len(xyz_m), len(template.vertices_m), len(template.faces)
    cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]

    def turned(x: FloatArray) -> FloatArray:
        return np.stack([cos * x[..., 0] - sin * x[..., 1], sin * x[..., 0] + cos * x[..., 1], x[..., 2]], axis=-1)

    vertices = turned(template.vertices_m * scale[:, None]) + xyz_m[:, None]
    normals = turned(template.normals / scale[:, None])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    colours = np.broadcast_to(template.tint, (count, faces, 3))
    if tint is not None and tinted is not None:
        colours = np.where(tinted[None, :, None], tint[:, None], colours)
    return Mesh(
        vertices_m=vertices.reshape(-1, 3).astype(np.float32),
        normals=normals.reshape(-1, 3).astype(np.float32),
        uv=np.tile(template.uv, (count, 1)),
        faces=(template.faces + (np.arange(count) * corners)[:, None, None]).reshape(-1, 3).astype(np.int32),
        material=np.tile(template.material, count),
        tint=colours.reshape(-1, 3).astype(np.uint8),
        tag=np.tile(template.tag, count),
    )


def tapered_rod(
    start: FloatArray,
    end: FloatArray,
    radii_m: tuple[float, float],
    sides: int,
    material: Material,
    tint: Tint,
    capped: bool = False,
) -> Mesh:
    """Return a round, tapered rod between two points (3,), open at both ends or closed at its second one."""
    axis = (end - start) / np.linalg.norm(end - start)
    one = np.cross(axis, [0.31, 0.93, 0.2])
    one /= np.linalg.norm(one)
    two = np.cross(axis, one)
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * two
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    around, length = np.append(angle, angle) * radii_m[0], float(np.linalg.norm(end - start))
    vertices, normals = [start + radii_m[0] * ring, end + radii_m[1] * ring], [ring, ring]
    faces = [np.stack([i, j, j + sides], axis=1), np.stack([i, j + sides, i + sides], axis=1)]
    uv = np.stack([around, np.repeat([0.0, length], sides)], axis=1)
    if capped:
        vertices.append(end + radii_m[1] * ring)
        normals.append(np.tile(axis, (sides, 1)))
        k = np.arange(1, sides - 1)
        faces.append(2 * sides + np.stack([np.zeros_like(k), k, k + 1], axis=1))
        uv = np.concatenate([uv, radii_m[1] * np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    count = sum(len(part) for part in faces)
    return Mesh(
        vertices_m=np.concatenate(vertices).astype(np.float32),
        normals=np.concatenate(normals).astype(np.float32),
        uv=uv.astype(np.float32),
        faces=np.concatenate(faces).astype(np.int32),
        material=np.full(count, material, np.uint8),
        tint=np.tile(np.array(tint, np.uint8), (count, 1)),
        tag=np.full(count, -1, np.int32),
    )
