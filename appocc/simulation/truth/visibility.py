"""Visibility of the actors in the cameras."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.camera import CameraRig
from appocc.checks import Float32Array, FloatArray, IntArray
from appocc.simulation.mesh import Mesh
from appocc.simulation.rendering.tracing import ACTOR, Tracer

_NEAREST_M = 0.1
# Steps of the plastic number: a low-discrepancy sequence, which needs no random numbers.
_STEP_U, _STEP_V = 0.7548776662466927, 0.5698402909980532


def visible_shares(
    tracer: Tracer,
    actors_mesh: Mesh,
    numbers: NDArray[np.int32],
    rig: CameraRig,
    town_from_ego: FloatArray,
    samples: int = 64,
) -> FloatArray:
    """Return (N,) the unoccluded share of each actor's pixels over all cameras of a rig; 0 if none sees it.

    Sample points are spread over the faces turned to a camera in proportion to their pixels; points outside the
    images do not count (an actor truncated by the image border is not occluded).

    Args:
        tracer: the town with `actors_mesh` set.
        actors_mesh: faces of all actors; the tag is the index of the actor.
        numbers: (N,) indices of the actors.
        rig: cameras.
        town_from_ego: (4, 4) pose.
        samples: points per actor.
    """
    place, towards, owner = _points(actors_mesh, numbers, rig, town_from_ego, samples)
    shares = np.zeros(len(numbers))
    if not len(owner):
        return shares
    hits = tracer.nearest(place, towards)
    own = hits.source == ACTOR
    own[own] = actors_mesh.tag[hits.face[own]] == numbers[owner[own]]
    asked = np.bincount(owner, minlength=len(numbers))
    seen = np.bincount(owner[own], minlength=len(numbers))
    np.divide(seen, asked, out=shares, where=asked > 0)
    return shares


def _points(
    mesh: Mesh, numbers: NDArray[np.int32], rig: CameraRig, town_from_ego: FloatArray, samples: int
) -> tuple[Float32Array, Float32Array, IntArray]:
    """Return rays to points on the actors inside an image: origins (R, 3), unit directions (R, 3), actor (R,)."""
    order = np.argsort(mesh.tag, kind="stable")
    sorted_tag = mesh.tag[order]
    bounds = np.stack([np.searchsorted(sorted_tag, numbers, side) for side in ("left", "right")], axis=1)
    cam_from_town = np.stack([np.linalg.inv(town_from_ego @ camera.ego_from_cam) for camera in rig])
    intrinsics = np.array(
        [[*camera.intrinsic[[0, 1, 0, 1], [0, 1, 2, 2]], camera.width_px, camera.height_px] for camera in rig]
    )
    in_cam, camera, owner = _sample(
        mesh.vertices_m, mesh.faces, order, bounds.astype(np.int64), cam_from_town, intrinsics, samples
    )
    turn = np.stack([town_from_ego @ camera.ego_from_cam for camera in rig])
    unit = in_cam / np.linalg.norm(in_cam, axis=1, keepdims=True)
    towards = np.einsum("rij,rj->ri", turn[camera, :3, :3], unit)
    return turn[camera, :3, 3].astype(np.float32), towards.astype(np.float32), owner


@numba.njit(cache=True, nogil=True)
def _sample(
    vertices: Float32Array,
    faces: NDArray[np.int32],
    order: IntArray,
    bounds: IntArray,
    cam_from_town: FloatArray,
    intrinsics: FloatArray,
    samples: int,
) -> tuple[FloatArray, IntArray, IntArray]:
    """Sample points (R, 3), camera frame, by pixel area on faces turned to a camera; also camera and actor (R,)."""
    actors, cameras = len(bounds), len(intrinsics)
    points = np.empty((actors * samples + 1, 3), np.float64)
    camera, owner = np.empty(actors * samples, np.int64), np.empty(actors * samples, np.int64)
    count, corner = 0, np.empty((3, 3), np.float64)
    for a in range(actors):
        low, high = bounds[a, 0], bounds[a, 1]
        weight = np.zeros(cameras * (high - low) + 1, np.float64)
        for c in range(cameras):
            for f in range(low, high):
                _to_camera(vertices, faces[order[f]], cam_from_town[c], corner)
                at = c * (high - low) + f - low
                weight[at + 1] = weight[at] + _pixels(corner, intrinsics[c])
        total, at = weight[-1], 0
        if total <= 0:
            continue
        for s in range(samples):
            while at < len(weight) - 2 and weight[at + 1] <= total * (s + 0.5) / samples:
                at += 1
            c = at // (high - low)
            _to_camera(vertices, faces[order[low + at - c * (high - low)]], cam_from_town[c], corner)
            u, v = (0.5 + s * _STEP_U) % 1.0, (0.5 + s * _STEP_V) % 1.0
            if u + v > 1:
                u, v = 1 - u, 1 - v
            for k in range(3):  # in scalars: operations on small arrays take seconds to compile
                points[count, k] = (1 - u - v) * corner[0, k] + u * corner[1, k] + v * corner[2, k]
            if _inside(points[count], intrinsics[c]):
                camera[count], owner[count] = c, a
                count += 1
    return points[:count], camera[:count], owner[:count]


@numba.njit(cache=True, nogil=True)
def _to_camera(
    vertices: Float32Array, face: NDArray[np.int32], cam_from_town: FloatArray, corner: FloatArray
) -> None:
    """Write the corners (3, 3) of a face in a camera's frame into `corner`."""
    for k in range(3):
        for i in range(3):
            corner[k, i] = cam_from_town[i, 3]
            for j in range(3):
                corner[k, i] += cam_from_town[i, j] * vertices[face[k], j]


@numba.njit(cache=True, nogil=True)
def _pixels(corner: FloatArray, intrinsics: FloatArray) -> float:
    """Return about how many pixels a face covers; 0 if it is turned away or outside the image."""
    if corner[0, 2] < _NEAREST_M or corner[1, 2] < _NEAREST_M or corner[2, 2] < _NEAREST_M:
        return 0.0
    u0, v0 = _pixel(corner[0], intrinsics)
    u1, v1 = _pixel(corner[1], intrinsics)
    u2, v2 = _pixel(corner[2], intrinsics)
    if max(u0, u1, u2) < -0.5 or min(u0, u1, u2) > intrinsics[4] - 0.5:
        return 0.0
    if max(v0, v1, v2) < -0.5 or min(v0, v1, v2) > intrinsics[5] - 0.5:
        return 0.0
    # Faces that are counter-clockwise from outside have a negative shoelace sum where v points down.
    return max(0.0, ((u2 - u0) * (v1 - v0) - (u1 - u0) * (v2 - v0)) / 2)


@numba.njit(cache=True, nogil=True)
def _pixel(point: FloatArray, intrinsics: FloatArray) -> tuple[float, float]:
    """Return the pixel of a point in a camera's frame; `intrinsics` is fx, fy, cx, cy, width, height."""
    return intrinsics[0] * point[0] / point[2] + intrinsics[2], intrinsics[1] * point[1] / point[2] + intrinsics[3]


@numba.njit(cache=True, nogil=True)
def _inside(point: FloatArray, intrinsics: FloatArray) -> bool:
    """Return whether a point in a camera's frame is inside its image."""
    u, v = _pixel(point, intrinsics)
    return bool(-0.5 <= u < intrinsics[4] - 0.5 and -0.5 <= v < intrinsics[5] - 0.5)
