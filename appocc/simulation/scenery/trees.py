"""Templates of trees and bushes: trunks, irregular crowns, and tufts of leaves that break their outlines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, FloatArray
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.scenery.builder import tapered_rod

_BARK = (96, 84, 70)
_LEAF = (80, 100, 50)  # replaced when it is instanced
_CLEAR_M = 3.05  # street trees are trimmed for trucks
_GOLDEN = (1 + 5**0.5) / 2


@dataclass(frozen=True, eq=False)
class Tree:
    """A template of a tree with its trunk at the origin.

    Attributes:
        mesh: trunk and crown.
        leaves: (F,) which faces take the leaf colour.
        crown_m: radius of the crown.
        height_m: total height.
    """

    mesh: Mesh
    leaves: BoolArray
    crown_m: float
    height_m: float


@cache
def _sphere(level: int) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the unit icosphere: (V, 3) points and (F, 3) faces; level 0 has 20 faces, level 1 has 80."""
    a, b = 1.0, _GOLDEN
    points = [(-a, b, 0), (a, b, 0), (-a, -b, 0), (a, -b, 0), (0, -a, b), (0, a, b), (0, -a, -b), (0, a, -b)]
    points += [(b, 0, -a), (b, 0, a), (-b, 0, -a), (-b, 0, a)]
    rows = "0b5 051 017 07a 0ab 159 5b4 ba2 a76 718 394 342 326 368 389 495 24b 62a 867 981"
    faces = np.array([[int(corner, 12) for corner in row] for row in rows.split()])
    vertices = np.array(points, np.float64)
    for _ in range(level):
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middle = len(vertices) + index.reshape(-1, 3)
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
        (p, q, r), (pq, qr, rp) = faces.T, middle.T
        faces = np.concatenate([np.stack(t, axis=1) for t in ((p, pq, rp), (q, qr, pq), (r, rp, qr), (pq, qr, rp))])
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def _mesh(vertices: FloatArray, normals: FloatArray, faces: NDArray[np.int64]) -> Mesh:
    """Return a mesh of leaves; faces that point inward after flattening are flipped."""
    corners = vertices[faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (facing * normals[faces].sum(axis=1)).sum(axis=1) < 0
    faces = np.where(inward[:, None], faces[:, ::-1], faces)
    return Mesh(
        vertices_m=vertices.astype(np.float32),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        uv=vertices[:, [0, 2]].astype(np.float32),
        faces=faces.astype(np.int32),
        material=np.full(len(faces), Material.FOLIAGE, np.uint8),
        tint=np.tile(np.array(_LEAF, np.uint8), (len(faces), 1)),
        tag=np.full(len(faces), -1, np.int32),
    )


def _leaf_cluster(
    rng: np.random.Generator,
    centre: FloatArray,
    radii: FloatArray,
    level: int,
    rough: float = 0.16,
    floor_m: float = 0.0,
) -> Mesh:
    """Return a cluster of leaves."""
    points, faces = _sphere(level)
    lumpy = points * (1 + rng.uniform(-rough, rough, (len(points), 1)))
    lumpy[:, 2] = np.maximum(lumpy[:, 2], -0.82)  # flat at the bottom, like crowns
    vertices = lumpy * radii + centre
    vertices[:, 2] = np.maximum(vertices[:, 2], floor_m)
    return _mesh(vertices, points / radii, faces)


def _tufts(
    rng: np.random.Generator, count: int, centre: FloatArray, radii: FloatArray, size_m: float, floor_m: float = 0.05
) -> Mesh:
    """Return twigs with leaves on the surface of a crown: quads at random angles with the normals of the crown."""
    out = rng.normal(size=(count, 3))
    out[:, 2] = np.abs(out[:, 2]) * np.where(rng.random(count) < 0.25, -0.7, 1.0)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    middle = centre + out * radii * rng.uniform(0.86, 1.1, (count, 1))
    facing = out + 0.9 * rng.normal(size=(count, 3))
    facing *= np.where((facing * out).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    one = np.cross(facing, rng.normal(size=(count, 3)))
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    two = np.cross(facing, one)
    size = size_m * rng.uniform(0.6, 1.3, (count, 4, 1))
    turn = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]], np.float64)
    corners = middle[:, None] + size * (turn[:, :1] * one[:, None] + turn[:, 1:] * two[:, None])
    corners[..., 2] += np.maximum(floor_m - corners[..., 2].min(axis=1), 0.0)[:, None]
    faces = (4 * np.arange(count)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return _mesh(corners.reshape(-1, 3), np.repeat(out + 0.4 * facing, 4, axis=0), faces)


def _branch(start: FloatArray, end: FloatArray, thick_m: tuple[float, float], sides: int = 5) -> Mesh:
    return tapered_rod(start, end, thick_m, sides, Material.BARK, _BARK)


def _tree(parts: list[Mesh]) -> Tree:
    mesh = join_meshes(parts)
    leaves = mesh.material == Material.FOLIAGE
    crown = mesh.vertices_m[np.unique(mesh.faces[leaves])]
    return Tree(mesh, leaves, float(np.hypot(crown[:, 0], crown[:, 1]).max()), float(crown[:, 2].max()))


def broad_tree(seed: int, detail: float = 1.0) -> Tree:
    """Return a tree with a round, open crown, about 8 m high; detail 2 for trees close to the street."""
    rng = np.random.default_rng([seed, 1])
    fork = np.array([0.0, 0.0, 2.6])
    parts = [_branch(np.zeros(3), fork, (0.2, 0.13), 6)]
    middle = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(5.1, 5.6)])
    radii = np.array([2.2, 2.2, rng.uniform(2.0, 2.5)]) * rng.uniform(0.9, 1.1, 3)
    fine = detail**-0.4
    parts.append(_leaf_cluster(rng, middle, radii * 0.88, 1 if detail > 0.5 else 0, 0.2, _CLEAR_M))
    parts.append(_tufts(rng, round(42 * detail), middle, radii, 0.58 * fine, _CLEAR_M))
    turn = rng.uniform(0, 2 * np.pi)
    for k in range(3 if detail > 0.5 else 1):
        angle = turn + k * 2.1 + rng.uniform(-0.4, 0.4)
        side = np.array([np.cos(angle) * 1.6, np.sin(angle) * 1.6, rng.uniform(4.0, 5.0)])
        lump = rng.uniform(1.0, 1.35) * np.array([1.0, 1.0, 0.85])
        parts += [
            _leaf_cluster(rng, side, lump * 0.9, 0, 0.15, _CLEAR_M),
            _tufts(rng, round(11 * detail), side, lump, 0.48 * fine, _CLEAR_M),
        ]
        parts.append(_branch(fork - [0, 0, 0.3], side, (0.1, 0.04), 3))
    return _tree(parts)


def columnar_tree(seed: int, detail: float = 1.0) -> Tree:
    """Return a slender tree such as a poplar or hornbeam, about 9 m high."""
    rng = np.random.default_rng([seed, 2])
    middle, radii = np.array([0.0, 0.0, 5.3]), np.array([1.25, 1.25, 3.9]) * rng.uniform(0.9, 1.1, 3)
    parts = [
        _branch(np.zeros(3), np.array([0.0, 0.0, 2.2]), (0.16, 0.12)),
        _leaf_cluster(rng, middle, radii * 0.94, 1, 0.12),
    ]
    return _tree([*parts, _tufts(rng, round(32 * detail), middle, radii, 0.42)])


def conifer_tree(seed: int, detail: float = 1.0) -> Tree:
    """Return a spruce, about 9 m high, with layers of branches."""
    rng = np.random.default_rng([seed, 3])
    parts = [_branch(np.zeros(3), np.array([0.0, 0.0, 1.4]), (0.17, 0.14))]
    levels, sides = (5 if detail > 0.5 else 4), 9
    for k in range(levels):
        low, radius = 0.9 + 1.45 * k, 2.1 * (1 - k / (levels + 0.6))
        top = low + 2.6 if k < levels - 1 else 9.2
        angle = 2 * np.pi * (np.arange(sides) + rng.uniform(0, 1)) / sides
        reach = radius * rng.uniform(0.8, 1.12, sides)
        droop = low + rng.uniform(-0.3, 0.25, sides)
        rim = np.stack([np.cos(angle) * reach, np.sin(angle) * reach, droop], axis=1)
        vertices = np.concatenate([rim, [[0.0, 0.0, top]]])
        out = np.stack([np.cos(angle), np.sin(angle), np.full(sides, 0.55)], axis=1)
        i = np.arange(sides)
        faces = np.stack([i, (i + 1) % sides, np.full(sides, sides)], axis=1)
        parts.append(_mesh(vertices, np.concatenate([out, [[0.0, 0.0, 1.0]]]), faces))
    parts.append(_tufts(rng, round(16 * detail), np.array([0.0, 0.0, 2.8]), np.array([1.7, 1.7, 2.2]), 0.5))
    return _tree(parts)


def small_tree(seed: int, detail: float = 1.0) -> Tree:
    """Return a garden tree, about 4.5 m high, with a low, round crown."""
    rng = np.random.default_rng([seed, 4])
    middle, radii = np.array([0.0, 0.0, 3.0]), np.array([1.45, 1.45, 1.4]) * rng.uniform(0.88, 1.12, 3)
    parts = [_branch(np.zeros(3), np.array([0.0, 0.0, 2.0]), (0.1, 0.07)), _leaf_cluster(rng, middle, radii * 0.9, 1)]
    return _tree([*parts, _tufts(rng, round(26 * detail), middle, radii, 0.38)])


def bush(seed: int) -> Tree:
    """Return a bush, about 1.2 m high."""
    rng = np.random.default_rng([seed, 5])
    middle, radii = np.array([0.0, 0.0, 0.5]), np.array([0.8, 0.8, 0.65])
    body = _leaf_cluster(rng, middle, radii * 0.92, 0)
    return _tree([body, _tufts(rng, 10, middle, radii, 0.3)])
