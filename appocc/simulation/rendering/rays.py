"""Camera rays, and per-pixel labels of their hits."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from appocc.camera import Camera
from appocc.checks import ByteArray, Float32Array, FloatArray
from appocc.nuscenes.view_targets import ViewClass
from appocc.simulation.rendering.compiled import kernel
from appocc.simulation.rendering.scene_buffers import Triangles
from appocc.simulation.rendering.texture import Texture, label_at
from appocc.simulation.rendering.tracing import ACTOR, GROUND, SKY
from appocc.simulation.surface import LANE_SURFACES, ROAD_SURFACES, Surface

# `ViewClass` of the ground by `Surface`.
GROUND_KINDS: ByteArray = np.array(
    [
        ViewClass.LANE_MARKING
        if surface in LANE_SURFACES
        else ViewClass.ROAD
        if surface in ROAD_SURFACES
        else ViewClass.TERRAIN
        if surface in (Surface.GRASS, Surface.EARTH)
        else ViewClass.PAVEMENT
        for surface in Surface
    ],
    np.uint8,
)


def ray_matrix(camera: Camera, town_from_ego: FloatArray) -> tuple[Float32Array, Float32Array]:
    """Return (3, 3) float32 from (u, v, 1) to a town-frame direction of one metre of depth, and the position (3,)."""
    town_from_cam = town_from_ego @ camera.ego_from_cam
    matrix = town_from_cam[:3, :3] @ np.linalg.inv(camera.intrinsic)
    return matrix.astype(np.float32), town_from_cam[:3, 3].astype(np.float32)


@kernel
def camera_rays(
    pixels: NDArray[np.int32],
    width_px: int,
    shift_u: float,
    shift_v: float,
    matrix: Float32Array,
    place: Float32Array,
) -> tuple[Float32Array, Float32Array]:
    """Return origins and unit directions (N, 3) of pixels (N,), row * width + column, with a subpixel shift."""
    origins = np.empty((len(pixels), 3), np.float32)
    directions = np.empty((len(pixels), 3), np.float32)
    for i in range(len(pixels)):
        row = pixels[i] // width_px
        u, v = np.float32(pixels[i] - row * width_px + shift_u), np.float32(row + shift_v)
        x = matrix[0, 0] * u + matrix[0, 1] * v + matrix[0, 2]
        y = matrix[1, 0] * u + matrix[1, 1] * v + matrix[1, 2]
        z = matrix[2, 0] * u + matrix[2, 1] * v + matrix[2, 2]
        scale = np.float32(1.0) / np.float32(math.sqrt(x * x + y * y + z * z))
        directions[i, 0], directions[i, 1], directions[i, 2] = x * scale, y * scale, z * scale
        origins[i, 0], origins[i, 1], origins[i, 2] = place[0], place[1], place[2]
    return origins, directions


@kernel
def label_pixels(
    distance: Float32Array,
    source: ByteArray,
    face: NDArray[np.int32],
    origins: Float32Array,
    directions: Float32Array,
    ahead: Float32Array,
    triangles: Triangles,
    texture: Texture,
    ground_kinds: ByteArray,
    depth: Float32Array,
    actor: NDArray[np.int32],
    kind: ByteArray,
) -> None:
    """Write depth along `ahead` (3,), index of the actor and class of N hits (`face` of `Triangles`)."""
    for i in range(len(distance)):
        actor[i] = -1
        if source[i] == SKY:
            depth[i], kind[i] = np.inf, ViewClass.SKY.value
            continue
        cosine = directions[i, 0] * ahead[0] + directions[i, 1] * ahead[1] + directions[i, 2] * ahead[2]
        depth[i] = distance[i] * cosine
        if source[i] == GROUND:
            x = origins[i, 0] + distance[i] * directions[i, 0]
            y = origins[i, 1] + distance[i] * directions[i, 1]
            label = label_at(texture, x, y)
            kind[i] = ground_kinds[label] if label >= 0 else ViewClass.TERRAIN.value
        else:
            kind[i] = triangles.kind[face[i]]
            if source[i] == ACTOR:
                actor[i] = triangles.tag[face[i]]
