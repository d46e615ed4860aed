"""Model bodies from sheets of quadrilaterals, and turn them into templates that fit any size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray, frozen
from appocc.simulation.actors.materials import Finish
from appocc.simulation.mesh import Material

Finishes = Finish | Sequence[Sequence[Finish | None]]
Size = tuple[float, float, float]
# Faces of one material that meet at less than this angle form a smooth curve.
_CREASE_COS = float(np.cos(np.radians(42.0)))
_THINNEST_M2 = 1e-7


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyTemplate:
    """A body without a size: x is `coordinates[0] * length + coordinates[3] * height`, y and z scale.

    The last column keeps round parts round when a body is stretched: wheels and their arches.

    Attributes:
        size_lwh_m: size at which the body was modelled; `normals` hold for it.
        coordinates: (V, 4) float32.
        normals: (V, 3) float32, unit.
        faces: (F, 3) int32, counter-clockwise from outside.
        material: (F,) uint8.
        tint: (F, 3) uint8.
        painted: (F,) whether the actor's paint replaces the tint.
    """

    size_lwh_m: Size
    coordinates: Float32Array
    normals: Float32Array
    faces: NDArray[np.int32]
    material: ByteArray
    tint: ByteArray
    painted: BoolArray

    def __post_init__(self) -> None:
        """Make the arrays read-only: templates are shared."""
        for array in (self.coordinates, self.normals, self.faces, self.material, self.tint, self.painted):
            frozen(array)


class Modeller:
    """Collects the faces of a body at its usual size: metres, x forward, y left, z up, origin bottom centre."""

    def __init__(self, size_lwh_m: Size) -> None:
        """Start an empty body."""
        self.size_lwh_m = size_lwh_m
        self._corners: list[FloatArray] = []  # (F, 3, 4): x, y, z and the anchor of x
        self._finishes: list[Finish] = []

    def add_sheet(
        self,
        points_m: ArrayLike,
        finishes: Finishes,
        inside_m: ArrayLike | None = None,
        anchor_m: ArrayLike | None = None,
        mirror: bool = True,
        hollow: bool = False,
    ) -> None:
        """Add a grid of quadrilaterals.

        Args:
            points_m: (N, M, 3).
            finishes: of all cells, or (N - 1, M - 1) of each; None leaves a hole.
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
        cells = [[finishes] * a.shape[1] for _ in range(a.shape[0])] if isinstance(finishes, Finish) else finishes
        flat = [finish for row in cells for finish in row for _ in range(2)]
        keep = np.array([finish is not None for finish in flat])
        self.add_triangles(
            quads.reshape(-1, 3, 4)[keep], [k for k in flat if k is not None], inside_m, mirror, hollow
        )

    def add_triangles(
        self,
        corners: FloatArray,
        finishes: Sequence[Finish],
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
        corners, kept = corners[solid], [finish for finish, on in zip(finishes, solid, strict=True) if on]
        self._corners.append(corners)
        self._finishes += kept
        if mirror:
            self._corners.append((corners * [1.0, -1.0, 1.0, 1.0])[:, ::-1])
            self._finishes += [_mirrored_finish(finish) for finish in kept]

    def add_fan(
        self, ring_m: ArrayLike, finish: Finish, inside_m: ArrayLike, anchor_m: float | None, mirror: bool
    ) -> None:
        """Add the area inside a convex ring (N, 3)."""
        ring = np.asarray(ring_m, np.float64)
        anchor = ring[:, :1] if anchor_m is None else np.full((len(ring), 1), anchor_m)
        ring = np.concatenate([ring, anchor], axis=1)
        corners = np.stack([np.broadcast_to(ring[0], ring[2:].shape), ring[1:-1], ring[2:]], axis=1)
        self.add_triangles(corners, [finish] * len(corners), inside_m, mirror)

    def add_box(
        self, low_m: ArrayLike, high_m: ArrayLike, finish: Finish, mirror: bool = False, skip: str = ""
    ) -> None:
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
                self.add_sheet(points, finish, middle, mirror=mirror)

    def add_tube(
        self,
        ends_m: ArrayLike,
        radii_m: ArrayLike,
        finish: Finish,
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
        self.add_sheet(rings, finish, ends.mean(axis=0), mirror=mirror)
        for ring in (rings[0, :-1], rings[-1, :-1]) if closed else ():
            self.add_fan(ring, finish, ends.mean(axis=0), None, mirror)

    def to_template(self, reference: Modeller) -> BodyTemplate:
        """Return the collected faces as a template, scaled such that `reference` fills its box exactly."""
        corners = np.concatenate(self._corners)
        coordinates = _scaled(self._coordinates(), reference._coordinates(), self.size_lwh_m[2] / self.size_lwh_m[0])
        normals = _smooth_normals(corners[..., :3], np.array([finish.material for finish in self._finishes]))
        rows = np.concatenate([np.round(coordinates, 6), np.round(normals, 3)], axis=-1).reshape(-1, 7)
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        return BodyTemplate(
            size_lwh_m=self.size_lwh_m,
            coordinates=np.ascontiguousarray(coordinates.reshape(-1, 4)[first], np.float32),
            normals=np.ascontiguousarray(normals.reshape(-1, 3)[first], np.float32),
            faces=np.ascontiguousarray(inverse.reshape(-1, 3), np.int32),
            material=np.array([finish.material for finish in self._finishes], np.uint8),
            tint=np.array([finish.tint for finish in self._finishes], np.uint8),
            painted=np.array([finish.painted for finish in self._finishes], np.bool_),
        )

    def _coordinates(self) -> FloatArray:
        """Return (F, 3, 4) corners as shares of the size, see `BodyTemplate.coordinates`."""
        corners = np.concatenate(self._corners)
        x, y, z, anchor = np.moveaxis(corners, -1, 0)
        length, width, height = self.size_lwh_m
        return np.stack([anchor / length, y / width, z / height, (x - anchor) / height], axis=-1)


def _mirrored_finish(finish: Finish) -> Finish:
    return (
        finish._replace(material=Material.INDICATOR_RIGHT) if finish.material == Material.INDICATOR_LEFT else finish
    )


def _area_normals(corners: FloatArray) -> FloatArray:
    """Return (F, 3) normals of triangles; their length is twice the area."""
    (ax, ay, az), (bx, by, bz) = (np.moveaxis(corners[:, k, :3] - corners[:, 0, :3], -1, 0) for k in (1, 2))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _scaled(coordinates: FloatArray, reference: FloatArray, height_per_length: float) -> FloatArray:
    """Return coordinates scaled such that `reference` has extents of exactly -1/2..1/2, -1/2..1/2 and 0..1."""
    result = coordinates.copy()
    x = reference[..., 0] + reference[..., 3] * height_per_length
    for column, values, low in ((0, x, -0.5), (1, reference[..., 1], -0.5), (2, reference[..., 2], 0.0)):
        result[..., column] = (coordinates[..., column] - values.min()) / (values.max() - values.min()) + low
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
