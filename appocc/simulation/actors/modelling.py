"""Model bodies from sheets of quadrilaterals, and turn them into templates that fit any size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray, frozen
from appocc.simulation.actors.materials import Look
from appocc.simulation.mesh import Material

Looks = Look | Sequence[Sequence[Look | None]]
Size = tuple[float, float, float]
# Faces of one material that meet at less than this angle form a smooth curve.
_CREASE_COS = float(np.cos(np.radians(42.0)))
_THINNEST_M2 = 1e-7


@dataclass(frozen=True)
class Template:
    """A body without a size: x is `coordinates[0] * length + coordinates[3] * height`, y and z scale.

    The last column keeps round parts round when a body is stretched: wheels and their arches.

    Attributes:
        size_lwh_m: size at which the body was modelled; `normals` hold for it.
        places: (V, 4) float32.
        normals: (V, 3) float32, unit.
        faces: (F, 3) int32, counter-clockwise from outside.
        material: (F,) uint8.
        tint: (F, 3) uint8.
        painted: (F,) whether the actor's paint replaces the tint.
    """

    size_lwh_m: Size
    places: Float32Array
    normals: Float32Array
    faces: NDArray[np.int32]
    material: ByteArray
    tint: ByteArray
    painted: BoolArray

    def __post_init__(self) -> None:
        """Make the arrays read-only: templates are shared."""
        for array in (self.places, self.normals, self.faces, self.material, self.tint, self.painted):
            frozen(array)


class Modeller:
    """Collects the faces of a body at its usual size: metres, x forward, y left, z up, origin bottom centre."""

    def __init__(self, size_lwh_m: Size) -> None:
        """Start an empty body."""
        self.size_lwh_m = size_lwh_m
        self._corners: list[FloatArray] = []  # (F, 3, 4): x, y, z and the anchor of x
        self._looks: list[Look] = []

    def sheet(
        self,
        points_m: ArrayLike,
        looks: Looks,
        inside_m: ArrayLike | None = None,
        anchor_m: ArrayLike | None = None,
        mirror: bool = True,
        hollow: bool = False,
    ) -> None:
        """Add a grid of quadrilaterals.

        Args:
            points_m: (N, M, 3).
            looks: of all cells, or (N - 1, M - 1) of each; None leaves a hole.
            inside_m: (3,) a point behind the sheet; the middle of the body by default.
            anchor_m: origin of x for parts that stay round, (N, M) or a number; x itself by default.
            mirror: also add the sheet on the other side of the car.
            hollow: the sheet is seen from the side of `inside_m`.
        """
        points = np.asarray(points_m, np.float64)
        anchor = points[..., 0] if anchor_m is None else np.broadcast_to(np.asarray(anchor_m), points.shape[:2])
        grid = np.concatenate([points, anchor[..., None]], axis=-1)
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        quads = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2)
        cells = [[looks] * a.shape[1] for _ in range(a.shape[0])] if isinstance(looks, Look) else looks
        flat = [look for row in cells for look in row for _ in range(2)]
        keep = np.array([look is not None for look in flat])
        self.triangles(quads.reshape(-1, 3, 4)[keep], [k for k in flat if k is not None], inside_m, mirror, hollow)

    def triangles(
        self,
        corners: FloatArray,
        looks: Sequence[Look],
        inside_m: ArrayLike | None,
        mirror: bool,
        hollow: bool = False,
    ) -> None:
        """Add triangles (F, 3, 4) of equal winding and orient them outward; the last column is the anchor of x."""
        normal = _area_normals(corners)
        inside = np.array([0.0, 0.0, 0.45 * self.size_lwh_m[2]]) if inside_m is None else np.asarray(inside_m)
        if (np.sum(normal * (corners[..., :3].mean(axis=1) - inside)) < 0) != hollow:
            corners = corners[:, ::-1]
        solid = np.linalg.norm(normal, axis=1) > _THINNEST_M2
        corners, kept = corners[solid], [look for look, on in zip(looks, solid, strict=True) if on]
        self._corners.append(corners)
        self._looks += kept
        if mirror:
            self._corners.append((corners * [1.0, -1.0, 1.0, 1.0])[:, ::-1])
            self._looks += [_other_side(look) for look in kept]

    def fan(self, ring_m: ArrayLike, look: Look, inside_m: ArrayLike, anchor_m: float | None, mirror: bool) -> None:
        """Add the area inside a convex ring (N, 3)."""
        ring = np.asarray(ring_m, np.float64)
        anchor = ring[:, :1] if anchor_m is None else np.full((len(ring), 1), anchor_m)
        ring = np.concatenate([ring, anchor], axis=1)
        corners = np.stack([np.broadcast_to(ring[0], ring[2:].shape), ring[1:-1], ring[2:]], axis=1)
        self.triangles(corners, [look] * len(corners), inside_m, mirror)

    def box(self, low_m: ArrayLike, high_m: ArrayLike, look: Look, mirror: bool = False, skip: str = "") -> None:
        """Add a box; `skip` names sides to leave out: f(ront) r(ear) s(ides: left and right) t(op) b(ottom)."""
        (x0, y0, z0), (x1, y1, z1) = np.asarray(low_m, np.float64), np.asarray(high_m, np.float64)
        middle = [(x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2]
        sides = {
            "f": [[[x1, y0, z0], [x1, y1, z0]], [[x1, y0, z1], [x1, y1, z1]]],
            "r": [[[x0, y0, z0], [x0, y1, z0]], [[x0, y0, z1], [x0, y1, z1]]],
            "s": [[[x0, y1, z0], [x1, y1, z0]], [[x0, y1, z1], [x1, y1, z1]]],
            "S": [[[x0, y0, z0], [x1, y0, z0]], [[x0, y0, z1], [x1, y0, z1]]],
            "t": [[[x0, y0, z1], [x1, y0, z1]], [[x0, y1, z1], [x1, y1, z1]]],
            "b": [[[x0, y0, z0], [x1, y0, z0]], [[x0, y1, z0], [x1, y1, z0]]],
        }
        for name, points in sides.items():
            if name.lower() not in skip:
                self.sheet(points, look, middle, mirror=mirror)

    def tube(
        self,
        ends_m: ArrayLike,
        radii_m: ArrayLike,
        look: Look,
        sides: int,
        mirror: bool = False,
        closed: bool = True,
    ) -> None:
        """Add a tube with flat ends along points (N, 3) with a radius at each."""
        ends = np.asarray(ends_m, np.float64)
        along = ends[-1] - ends[0]
        along = along / np.linalg.norm(along)
        across = np.cross(along, [0.0, 1.0, 0.0] if abs(along[1]) < 0.9 else [1.0, 0.0, 0.0])
        across /= np.linalg.norm(across)
        third = np.cross(along, across)
        turn = np.arange(sides + 1) * (2 * np.pi / sides) + np.pi / sides
        circle = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * third
        rings = ends[:, None] + np.asarray(radii_m)[:, None, None] * circle
        self.sheet(rings, look, ends.mean(axis=0), mirror=mirror)
        for ring in (rings[0, :-1], rings[-1, :-1]) if closed else ():
            self.fan(ring, look, ends.mean(axis=0), None, mirror)

    def template(self, filling: Modeller) -> Template:
        """Return the collected faces as a template, scaled such that `filling` fills its box exactly."""
        corners = np.concatenate(self._corners)
        places = _filled(self._places(), filling._places(), self.size_lwh_m[2] / self.size_lwh_m[0])
        normals = _smooth_normals(corners[..., :3], np.array([look.material for look in self._looks]))
        rows = np.concatenate([np.round(places, 6), np.round(normals, 3)], axis=-1).reshape(-1, 7)
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        return Template(
            self.size_lwh_m,
            np.ascontiguousarray(places.reshape(-1, 4)[first], np.float32),
            np.ascontiguousarray(normals.reshape(-1, 3)[first], np.float32),
            np.ascontiguousarray(inverse.reshape(-1, 3), np.int32),
            np.array([look.material for look in self._looks], np.uint8),
            np.array([look.tint for look in self._looks], np.uint8),
            np.array([look.painted for look in self._looks], np.bool_),
        )

    def _places(self) -> FloatArray:
        """Return (F, 3, 4) corners as shares of the size, see `BodyTemplate.coordinates`."""
        corners = np.concatenate(self._corners)
        x, y, z, anchor = np.moveaxis(corners, -1, 0)
        length, width, height = self.size_lwh_m
        return np.stack([anchor / length, y / width, z / height, (x - anchor) / height], axis=-1)


def _other_side(look: Look) -> Look:
    return look._replace(material=Material.INDICATOR_RIGHT) if look.material == Material.INDICATOR_LEFT else look


def _area_normals(corners: FloatArray) -> FloatArray:
    """Return (F, 3) normals of triangles; their length is twice the area."""
    (ax, ay, az), (bx, by, bz) = (np.moveaxis(corners[:, k, :3] - corners[:, 0, :3], -1, 0) for k in (1, 2))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _filled(places: FloatArray, filling: FloatArray, height_per_length: float) -> FloatArray:
    """Return coordinates scaled such that `filling` has extents of exactly -1/2..1/2, -1/2..1/2 and 0..1."""
    result = places.copy()
    x = filling[..., 0] + filling[..., 3] * height_per_length
    for column, values, low in ((0, x, -0.5), (1, filling[..., 1], -0.5), (2, filling[..., 2], 0.0)):
        result[..., column] = (places[..., column] - values.min()) / (values.max() - values.min()) + low
    return result


def _smooth_normals(corners: FloatArray, material: IntArray) -> FloatArray:
    """Return (F, 3, 3) unit normals of the corners: smooth between faces of a material at a small angle."""
    area = _area_normals(corners)
    unit = area / np.linalg.norm(area, axis=1, keepdims=True)
    _, place = np.unique(np.round(corners.reshape(-1, 3), 4), axis=0, return_inverse=True)
    # A row of `table` holds the corners at one position.
    order = np.argsort(place, kind="stable")
    counts = np.bincount(place)
    rank = np.arange(len(order)) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.full((len(counts), counts.max()), -1)
    table[place[order], rank] = order
    face, there = table // 3, table >= 0
    alike = unit[face] @ unit[face].swapaxes(1, 2) > _CREASE_COS
    alike &= (material[face][:, :, None] == material[face][:, None, :]) & there[:, None, :]
    normals = np.empty((len(corners) * 3, 3))
    normals[table[there]] = (alike @ area[face])[there]
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True)).reshape(-1, 3, 3)
