"""Exact ray casting against a ground plane and boxes: camera pictures and LiDAR sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.camera import Camera
from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from appocc.demo.bodies import Solid
from appocc.demo.ground import Ground
from appocc.geometry import apply, inverse
from appocc.groundtruth.visibility import box_entry

GROUND, SKY = -1, -2
_FARTHEST_M = 400.0
# A solid whose underside is lower stands on the ground and darkens it.
_STANDS_M = 0.2
# Light from the sky, and from a sun behind and to the left of a car that drives along the street.
_SKY_LIGHT, _SUN_LIGHT = 0.82, 0.22
_TO_SUN = np.array([-0.45, 0.5, 0.74]) / np.linalg.norm([-0.45, 0.5, 0.74])
_HORIZON, _ZENITH = np.array([206.0, 216.0, 226.0]), np.array([112.0, 156.0, 212.0])
# A pixel whose colour differs from a neighbour's by more is an edge and is cast anew as the mean of four rays.
_EDGE = 10.0
_FOUR = np.array([[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]])
_NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)


class Hits(NamedTuple):
    """Where N rays end.

    Attributes:
        distance_m: (N,), infinity in the sky.
        solid: (N,) number of the solid, or GROUND, or SKY.
    """

    distance_m: FloatArray
    solid: IntArray


def cast(eye_m: FloatArray, directions: FloatArray, solids: Sequence[Solid]) -> Hits:
    """The nearest surface along rays from a point (3,) in unit directions (N, 3), street frame."""
    down = directions[:, 2] < -1e-6
    distance = np.where(down, -eye_m[2] / np.where(down, directions[:, 2], -1.0), np.inf)
    distance[distance > _FARTHEST_M] = np.inf
    solid = np.where(np.isfinite(distance), GROUND, SKY)
    narrow = directions.astype(np.float32)
    for number, one in enumerate(solids):
        near = _towards(one, eye_m, narrow)
        if not len(near):
            continue
        centred = one.street_from_body.copy()
        centred[:3, 3] = apply(one.street_from_body, (one.low_m + one.high_m) / 2)
        entry = box_entry(eye_m, directions[near], centred, (one.high_m - one.low_m) / 2)
        closer = entry < distance[near]
        distance[near[closer]], solid[near[closer]] = entry[closer], number
    return Hits(distance, solid)


def _towards(solid: Solid, eye_m: FloatArray, directions: Float32Array) -> IntArray:
    """Numbers of the rays that meet the ball around a solid."""
    middle = apply(solid.street_from_body, (solid.low_m + solid.high_m) / 2) - eye_m
    radius = np.linalg.norm(solid.high_m - solid.low_m) / 2
    beyond = float(middle @ middle - radius**2)
    if beyond <= 0:
        return np.arange(len(directions))
    # The tangent of the ball is sqrt(beyond) long; float32 is off by less than a millimetre here.
    return np.flatnonzero(directions @ middle.astype(np.float32) > np.sqrt(beyond) - 1e-2)


def colours(
    eye_m: FloatArray, directions: FloatArray, hits: Hits, solids: Sequence[Solid], ground: Ground, ray_rad: float
) -> Float32Array:
    """(N, 3) colours 0..255 of what rays hit; each ray is `ray_rad` wide."""
    rgb = np.empty((len(directions), 3), np.float32)
    sky = hits.solid == SKY
    rise = np.sqrt(np.clip(directions[sky, 2:], 0, 1))
    rgb[sky] = _HORIZON + (_ZENITH - _HORIZON) * rise
    for number in np.unique(hits.solid[hits.solid >= 0]):
        here = np.flatnonzero(hits.solid == number)
        rgb[here] = _surface(solids[number], eye_m + directions[here] * hits.distance_m[here, None])
    here = np.flatnonzero(hits.solid == GROUND)
    distance = hits.distance_m[here]
    places = (eye_m + directions[here] * distance[:, None])[:, :2]
    # Between the ray's width and its length on the ground, which is longer by the slant.
    slant = np.sqrt(np.maximum(-directions[here, 2], 1e-3))
    rgb[here] = ground.colour(places, distance * ray_rad / slant) * _shade_under(places, solids)[:, None]
    return rgb


def _surface(solid: Solid, points: FloatArray) -> FloatArray:
    """Shaded colours of surface points (N, 3), street frame, of a solid."""
    local = apply(inverse(solid.street_from_body), points)
    outward = np.concatenate([local - solid.high_m, solid.low_m - local], axis=1)
    face = np.array([0, 2, 4, 1, 3, 5])[outward.argmax(axis=1)]
    normals = _NORMALS @ solid.street_from_body[:3, :3].T
    light = _SKY_LIGHT + _SUN_LIGHT * np.maximum(normals @ _TO_SUN, 0.0)
    return np.asarray(np.minimum(solid.look(local, face) * light[face][:, None], 255.0))


def _shade_under(places: FloatArray, solids: Sequence[Solid]) -> FloatArray:
    """(N,) how much light the ground gets beside solids that stand on it: less within half a metre."""
    light = np.ones(len(places))
    x, y = np.ascontiguousarray(places.T)
    for solid in solids:
        if solid.low_m[2] > _STANDS_M:
            continue
        reach = np.linalg.norm((solid.high_m - solid.low_m)[:2]) / 2 + 1
        middle = apply(solid.street_from_body, (solid.low_m + solid.high_m) / 2)[:2]
        near = np.flatnonzero((np.abs(x - middle[0]) < reach) & (np.abs(y - middle[1]) < reach))
        local = apply(inverse(solid.street_from_body), np.pad(places[near], ((0, 0), (0, 1))))[:, :2]
        outside = np.maximum(np.maximum(solid.low_m[:2] - local, local - solid.high_m[:2]), 0.0)
        light[near] *= 1 - 0.6 * np.exp(-np.hypot(outside[:, 0], outside[:, 1]) / 0.18)
    return light


def picture(camera: Camera, street_from_ego: FloatArray, solids: Sequence[Solid], ground: Ground) -> ByteArray:
    """(H, W, 3) uint8: what a camera sees; edges are smoothed with four rays a pixel."""
    street_from_cam = street_from_ego @ camera.ego_from_cam
    height, width = camera.height_px, camera.width_px
    uv = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(np.float64)
    rgb = _seen(camera, street_from_cam, uv, solids, ground)
    edge = np.flatnonzero(_edges(rgb.reshape(height, width, 3)))
    finer = (uv[edge, None] + _FOUR).reshape(-1, 2)
    rgb[edge] = _seen(camera, street_from_cam, finer, solids, ground).reshape(-1, 4, 3).mean(axis=1)
    return np.round(rgb).astype(np.uint8).reshape(height, width, 3)


def _seen(
    camera: Camera, street_from_cam: FloatArray, uv_px: FloatArray, solids: Sequence[Solid], ground: Ground
) -> Float32Array:
    homogeneous = np.pad(uv_px, ((0, 0), (0, 1)), constant_values=1.0)
    directions = homogeneous @ (street_from_cam[:3, :3] @ np.linalg.inv(camera.intrinsic)).T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    eye = street_from_cam[:3, 3]
    hits = cast(eye, directions, solids)
    return colours(eye, directions, hits, solids, ground, 1 / float(camera.intrinsic[0, 0]))


def _edges(rgb: Float32Array) -> BoolArray:
    """(H, W) pixels whose brightness differs from that of a neighbour."""
    grey = rgb @ np.array([0.4, 0.4, 0.2], np.float32)
    edge = np.zeros(grey.shape, dtype=np.bool_)
    for axis in (0, 1):
        step = np.abs(np.diff(grey, axis=axis)) > _EDGE
        first, second = [slice(None), slice(None)], [slice(None), slice(None)]
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        edge[tuple(first)] |= step
        edge[tuple(second)] |= step
    return edge


def sweep(
    street_from_lidar: FloatArray,
    beams_rad: FloatArray,
    columns: int,
    solids: Sequence[Solid],
    random: np.random.Generator,
    range_m: float = 70.0,
) -> FloatArray:
    """(N, 5) LiDAR points x, y, z, intensity, ring in the sensor frame; ranges scatter by 1 cm."""
    turn = np.arange(columns) * (2 * np.pi / columns)
    ring, turn = (grid.ravel() for grid in np.meshgrid(np.arange(len(beams_rad)), turn, indexing="ij"))
    rise = beams_rad[ring]
    rays = np.stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)], axis=1)
    hits = cast(street_from_lidar[:3, 3], rays @ street_from_lidar[:3, :3].T, solids)
    seen = hits.distance_m < range_m
    distance = hits.distance_m[seen] + random.normal(0.0, 0.01, int(seen.sum()))
    intensity = np.where(hits.solid[seen] == GROUND, 12.0, 40.0)
    return np.column_stack([rays[seen] * distance[:, None], intensity, ring[seen]])
