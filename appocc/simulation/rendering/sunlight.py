"""Sunlit candidates: hits that face the sun outside the shadow of the ego."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array
from appocc.simulation.rendering.compiled import array_free_kernel, inlined
from appocc.simulation.rendering.lighting import Lighting
from appocc.simulation.rendering.materials import FOLIAGE
from appocc.simulation.rendering.scene_buffers import Triangles, normal_at
from appocc.simulation.rendering.tracing import ACTOR, GROUND, SKY


@array_free_kernel
def find_sunlit(
    distance: Float32Array,
    source: ByteArray,
    face: NDArray[np.int32],
    uv: Float32Array,
    origins: Float32Array,
    directions: Float32Array,
    triangles: Triangles,
    light: Lighting,
    numbers: NDArray[np.int32],
    starts: Float32Array,
) -> int:
    """Find the hits that face the sun and are outside the ego's shadow; return their number M.

    Writes their indices to the front of `numbers` (N,), and the origins of rays to the sun to the front of `starts`
    (N, 3).
    """
    count = 0
    for i in range(len(distance)):
        if source[i] == SKY:
            continue
        t = np.float64(distance[i])
        x, y, z = 0.0, 0.0, 1.0
        off = 0.004 + 1e-4 * t
        if source[i] != GROUND:
            x, y, z = normal_at(triangles, face[i], uv[i, 0], uv[i, 1])
            facing = x * directions[i, 0] + y * directions[i, 1] + z * directions[i, 2]
            if facing > 0:
                x, y, z = -x, -y, -z
            material = triangles.material[face[i]]
            # Offsets against self-shadowing of low-poly curves and crowns.
            off += 0.25 if material == FOLIAGE else 0.02 if source[i] == ACTOR else 0.006
        if x * light.sun_to[0] + y * light.sun_to[1] + z * light.sun_to[2] <= 0:
            continue
        px = origins[i, 0] + t * directions[i, 0] + x * off
        py = origins[i, 1] + t * directions[i, 1] + y * off
        pz = origins[i, 2] + t * directions[i, 2] + z * off
        if light.ego_box[0] > 0 and _behind_ego(light, px, py, pz):
            continue
        numbers[count] = i
        starts[count, 0], starts[count, 1], starts[count, 2] = px, py, pz
        count += 1
    return count


@inlined
def _behind_ego(light: Lighting, x: float, y: float, z: float) -> bool:
    """Return whether the ego's body or cabin is between a point and the sun."""
    pose, sun = light.ego_from_town, light.sun_to
    a = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - light.ego_box[3]
    b = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
    c = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
    if a * a + b * b > 1600.0:
        return False
    da = pose[0, 0] * sun[0] + pose[0, 1] * sun[1] + pose[0, 2] * sun[2]
    db = pose[1, 0] * sun[0] + pose[1, 1] * sun[1] + pose[1, 2] * sun[2]
    dc = pose[2, 0] * sun[0] + pose[2, 1] * sun[1] + pose[2, 2] * sun[2]
    half_l, half_w, high = light.ego_box[0] / 2, light.ego_box[1] / 2, light.ego_box[2]
    body = _hits_box(a, da, b, db, c, dc, -half_l, half_l, half_w, 0.22, 0.6 * high)
    return body or _hits_box(a, da, b, db, c, dc, -0.8 * half_l, 0.35 * half_l, 0.85 * half_w, 0.5 * high, high)


@inlined
def _hits_box(
    a: float, da: float, b: float, db: float, c: float, dc: float,
    back: float, front: float, side: float, low: float, high: float,
) -> bool:  # fmt: skip
    """Return whether a ray from (a, b, c) along (da, db, dc) hits a box."""
    da, db, dc = _avoid_zero(da), _avoid_zero(db), _avoid_zero(dc)
    t1, t2 = (back - a) / da, (front - a) / da
    t3, t4 = (-side - b) / db, (side - b) / db
    t5, t6 = (low - c) / dc, (high - c) / dc
    enters = max(min(t1, t2), min(t3, t4), min(t5, t6))
    leaves = min(max(t1, t2), max(t3, t4), max(t5, t6))
    return bool(leaves > max(enters, 0.0))


@inlined
def _avoid_zero(value: float) -> float:
    return value if abs(value) > 1e-6 else 1e-6
