"""Assemble all actors of a traffic state into one mesh."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray
from appocc.simulation.actors.bodies import POSES, body_template
from appocc.simulation.actors.modelling import BodyTemplate
from appocc.simulation.actors.paint import ActorPaint
from appocc.simulation.mesh import Mesh
from appocc.simulation.traffic import Actor, TrafficState

_NEAR_M, _MIDDLE_M = 25.0, 60.0
# Length of two steps of a pedestrian, and distance per turn of a rider's pedals.
_STRIDE_M = {"adult": 1.4, "child": 1.0, "bicycle": 5.0}
_WALKING_MPS = 0.2


def assemble(
    actors: Sequence[Actor],
    state: TrafficState,
    paints: Sequence[ActorPaint],
    centre_xy_m: FloatArray,
    exclude: int | None,
    far_m: float = 150.0,
) -> Mesh:
    """Assemble the actors near a point into one mesh in the town frame; `tag` is the index of the actor in the log.

    Args:
        actors: actors of the log.
        state: their poses.
        paints: by index of the actor.
        centre_xy_m: (2,) the point, town frame; nearby actors have more detail.
        exclude: index of an actor to leave out.
        far_m: radius around the point.
    """
    distance_m = np.hypot(*(state.xy_m - centre_xy_m).T)
    rows = np.flatnonzero((distance_m <= far_m) & (state.index != (-1 if exclude is None else exclude)))
    shapes = [
        _actor_template(actors[int(state.index[row])], int(state.index[row]), state, int(row), float(distance_m[row]))
        for row in rows
    ]
    vertex_ends = np.cumsum([0, *(len(shape.coordinates) for shape in shapes)])
    face_ends = np.cumsum([0, *(len(shape.faces) for shape in shapes)])
    vertices, normals = np.empty((2, vertex_ends[-1], 3), np.float32)
    faces = np.empty((face_ends[-1], 3), np.int32)
    material, tint = np.empty(len(faces), np.uint8), np.empty((len(faces), 3), np.uint8)
    for row, shape, v, f in zip(rows, shapes, vertex_ends, face_ends, strict=False):
        number = int(state.index[row])
        size = actors[number].size_lwh_m
        pose = np.array([*state.xy_m[row], state.yaw_rad[row], *size, *shape.size_lwh_m])
        _transform(shape.coordinates, shape.normals, pose, vertices[v:], normals[v:])
        paint = np.array(paints[number].rgb, np.uint8)
        _copy_faces(
            shape.faces, shape.material, shape.tint, shape.painted, paint, v, faces[f:], material[f:], tint[f:]
        )
    tags = np.repeat(state.index[rows].astype(np.int32), np.diff(face_ends))
    return Mesh(
        vertices_m=vertices,
        normals=normals,
        uv=np.zeros((len(vertices), 2), np.float32),
        faces=faces,
        material=material,
        tint=tint,
        tag=tags,
    )


def _actor_template(actor: Actor, number: int, state: TrafficState, row: int, distance_m: float) -> BodyTemplate:
    detail = 0 if distance_m < _NEAR_M else 1 if distance_m < _MIDDLE_M else 2
    return body_template(actor.body, body_variant(actor), detail, _walk_phase(actor, number, state, row))


def body_variant(actor: Actor) -> int:
    """Return the body variant of an actor, which follows from its name."""
    return zlib.crc32(actor.name.encode()) >> 8


def _walk_phase(actor: Actor, number: int, state: TrafficState, row: int) -> int:
    """Return the phase of the step: legs advance with the distance travelled; actors that do not move have pose 0."""
    stride_m = _STRIDE_M.get(actor.body)
    if stride_m is None or np.hypot(*state.velocity_mps[row]) < _WALKING_MPS:
        return 0
    yaw = state.yaw_rad[row]
    travelled_m = float(state.xy_m[row] @ [np.cos(yaw), np.sin(yaw)])
    return int(np.floor((travelled_m / stride_m + 0.37 * number) % 1.0 * POSES))


@numba.njit(cache=True, nogil=True)
def _transform(
    coordinates: Float32Array,
    normals: Float32Array,
    pose: FloatArray,
    vertices_out: Float32Array,
    normals_out: Float32Array,
) -> None:
    """Scale, rotate and translate a template; `pose` holds x, y, yaw, the size and the size of the template."""
    x, y, cos, sin = pose[0], pose[1], np.cos(pose[2]), np.sin(pose[2])
    length, width, height = pose[3], pose[4], pose[5]
    by_x, by_y, by_z = pose[6] / length, pose[7] / width, pose[8] / height
    for i in range(len(coordinates)):
        forward = coordinates[i, 0] * length + coordinates[i, 3] * height
        left = coordinates[i, 1] * width
        vertices_out[i, 0] = x + cos * forward - sin * left
        vertices_out[i, 1] = y + sin * forward + cos * left
        vertices_out[i, 2] = coordinates[i, 2] * height
        a, b, c = normals[i, 0] * by_x, normals[i, 1] * by_y, normals[i, 2] * by_z
        scale = 1 / np.sqrt(a * a + b * b + c * c)
        normals_out[i, 0] = (cos * a - sin * b) * scale
        normals_out[i, 1] = (sin * a + cos * b) * scale
        normals_out[i, 2] = c * scale


@numba.njit(cache=True, nogil=True)
def _copy_faces(
    faces: NDArray[np.int32],
    material: ByteArray,
    tint: ByteArray,
    painted: BoolArray,
    paint: ByteArray,
    first_vertex: int,
    faces_out: NDArray[np.int32],
    material_out: ByteArray,
    tint_out: ByteArray,
) -> None:
    """Copy the faces of a template; painted faces take the actor's paint."""
    for i in range(len(faces)):
        material_out[i] = material[i]
        for k in range(3):
            faces_out[i, k] = faces[i, k] + first_vertex
            tint_out[i, k] = paint[k] if painted[i] else tint[i, k]
