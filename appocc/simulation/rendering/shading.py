"""What light comes back from where rays end: one kernel over all of them."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array
from appocc.simulation.mesh import Material
from appocc.simulation.rendering.lighting import (
    LAMP_CELL_M,
    NEAR_CELL_M,
    NEAR_CELLS,
    OPEN_CELL_M,
    Lighting,
)
from appocc.simulation.rendering.noise import noise
from appocc.simulation.rendering.sky import sky_at
from appocc.simulation.rendering.stage import Triangles
from appocc.simulation.rendering.texture import Texture, colour_at
from appocc.simulation.rendering.tracing import ACTOR, GROUND, SKY

_FOLIAGE, _HEDGE = int(Material.FOLIAGE), int(Material.HEDGE)


@numba.njit(cache=True, nogil=True, fastmath=True)
def normal_at(triangles: Triangles, face: int, u: float, v: float) -> tuple[float, float, float]:
    """Unit normal between a face's vertices."""
    a, b, c = triangles.faces[face]
    one, two, three = triangles.normals[a], triangles.normals[b], triangles.normals[c]
    w = 1 - u - v
    x = w * one[0] + u * two[0] + v * three[0]
    y = w * one[1] + u * two[1] + v * three[1]
    z = w * one[2] + u * two[2] + v * three[2]
    scale = 1 / math.sqrt(x * x + y * y + z * z + 1e-12)
    return x * scale, y * scale, z * scale


@numba.njit(cache=True, nogil=True, fastmath=True)
def toward_sun(
    distance: Float32Array,
    source: ByteArray,
    face: NDArray[np.int32],
    uv: Float32Array,
    origins: Float32Array,
    directions: Float32Array,
    triangles: Triangles,
    light: Lighting,
    lit: BoolArray,
) -> tuple[NDArray[np.int32], Float32Array]:
    """Which of N hits face the sun: (M,) their numbers and (M, 3) where rays to the sun begin.

    `lit` (N,) becomes true for those; what stands in the ego's shadow is left out at once.
    """
    numbers, starts, count = np.empty(len(distance), np.int32), np.empty((len(distance), 3), np.float32), 0
    for i in range(len(distance)):
        lit[i] = False
        if source[i] == SKY:
            continue
        t = distance[i]
        x, y, z = 0.0, 0.0, 1.0
        off = 0.004 + 1e-4 * t
        if source[i] != GROUND:
            x, y, z = normal_at(triangles, face[i], uv[i, 0], uv[i, 1])
            facing = x * directions[i, 0] + y * directions[i, 1] + z * directions[i, 2]
            if facing > 0:
                x, y, z = -x, -y, -z
            material = triangles.material[face[i]]
            # Low-poly curves and crowns would shade themselves in patches.
            off += 0.25 if material == _FOLIAGE else 0.02 if source[i] == ACTOR else 0.006
        if x * light.sun_to[0] + y * light.sun_to[1] + z * light.sun_to[2] <= 0:
            continue
        px = origins[i, 0] + t * directions[i, 0] + x * off
        py = origins[i, 1] + t * directions[i, 1] + y * off
        pz = origins[i, 2] + t * directions[i, 2] + z * off
        if light.ego_box[0] > 0 and _behind_ego(light, px, py, pz):
            continue
        lit[i] = True
        numbers[count] = i
        starts[count, 0], starts[count, 1], starts[count, 2] = px, py, pz
        count += 1
    return numbers[:count], starts[:count]


@numba.njit(cache=True, nogil=True, fastmath=True)
def _behind_ego(light: Lighting, x: float, y: float, z: float) -> bool:
    """Whether the ego's body or cabin stands between a place and the sun."""
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
    body = _crosses(a, da, b, db, c, dc, -half_l, half_l, half_w, 0.22, 0.6 * high)
    return body or _crosses(a, da, b, db, c, dc, -0.8 * half_l, 0.35 * half_l, 0.85 * half_w, 0.5 * high, high)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _crosses(
    a: float, da: float, b: float, db: float, c: float, dc: float,
    back: float, front: float, side: float, low: float, high: float,
) -> bool:  # fmt: skip
    """Whether a line from (a, b, c) along (da, db, dc) meets a box, ahead of its start."""
    da, db, dc = _kept_off_zero(da), _kept_off_zero(db), _kept_off_zero(dc)
    t1, t2 = (back - a) / da, (front - a) / da
    t3, t4 = (-side - b) / db, (side - b) / db
    t5, t6 = (low - c) / dc, (high - c) / dc
    enters = max(min(t1, t2), min(t3, t4), min(t5, t6))
    leaves = min(max(t1, t2), max(t3, t4), max(t5, t6))
    return bool(leaves > max(enters, 0.0))


@numba.njit(cache=True, nogil=True, fastmath=True)
def _kept_off_zero(value: float) -> float:
    return value if abs(value) > 1e-6 else 1e-6


@numba.njit(cache=True, nogil=True, fastmath=True)
def _open_at(light: Lighting, x: float, y: float) -> float:
    """Share of the sky that is open over a place; all of it beyond the town."""
    u, v = (x - light.low_x) / OPEN_CELL_M - 0.5, (y - light.low_y) / OPEN_CELL_M - 0.5
    if u < 0 or v < 0 or u >= light.open.shape[1] - 1 or v >= light.open.shape[0] - 1:
        return 1.0
    column, row = int(u), int(v)
    a, b = u - column, v - row
    first = light.open[row, column] * (1 - a) + light.open[row, column + 1] * a
    second = light.open[row + 1, column] * (1 - a) + light.open[row + 1, column + 1] * a
    return (first * (1 - b) + second * b) / 255.0


@numba.njit(cache=True, nogil=True, fastmath=True)
def _lamp_at(light: Lighting, x: float, y: float) -> float:
    """Light of the street lamps on the ground at a place."""
    u, v = (x - light.low_x) / LAMP_CELL_M - 0.5, (y - light.low_y) / LAMP_CELL_M - 0.5
    if u < 0 or v < 0 or u >= light.lamp.shape[1] - 1 or v >= light.lamp.shape[0] - 1:
        return 0.0
    column, row = int(u), int(v)
    a, b = u - column, v - row
    first = light.lamp[row, column] * (1 - a) + light.lamp[row, column + 1] * a
    second = light.lamp[row + 1, column] * (1 - a) + light.lamp[row + 1, column + 1] * a
    return first * (1 - b) + second * b


@numba.njit(cache=True, nogil=True, fastmath=True)
def _near_at(light: Lighting, x: float, y: float, channel: int) -> float:
    """Value of the near map at a place; nothing shades or shines beyond it."""
    u, v = (x - light.near_x) / NEAR_CELL_M - 0.5, (y - light.near_y) / NEAR_CELL_M - 0.5
    if u < 0 or v < 0 or u >= NEAR_CELLS - 1 or v >= NEAR_CELLS - 1:
        return 1.0 if channel == 0 else 0.0
    column, row = int(u), int(v)
    a, b = u - column, v - row
    first = light.near[row, column, channel] * (1 - a) + light.near[row, column + 1, channel] * a
    second = light.near[row + 1, column, channel] * (1 - a) + light.near[row + 1, column + 1, channel] * a
    return first * (1 - b) + second * b


@numba.njit(cache=True, nogil=True, fastmath=True)
def _ground(
    texture: Texture, tile: Float32Array, x: float, y: float, dx: float, dy: float, dz: float, pixel_m: float
) -> tuple[float, float, float]:
    """Colour of the ground under a pixel: texels along its long, slanting footprint, at the scale of its width."""
    steep = max(-dz, 0.004)
    long = pixel_m / steep
    taps = min(max(int(long / max(pixel_m, 0.05) + 0.5), 1), 5)
    scale = max(pixel_m, long / taps) / 0.1
    level = max(math.log2(scale), 0.0) if scale > 1 else 0.0
    flat = 1 / math.sqrt(dx * dx + dy * dy + 1e-9)
    r, g, b = 0.0, 0.0, 0.0
    for tap in range(taps):
        share = (tap + 0.5) / taps
        step = (share - 0.5) * long * flat
        # Some taps from the finer level and some from the coarser one: as good as a blend of both.
        p, q, s = colour_at(texture, x + dx * step, y + dy * step, int(level + share))
        r, g, b = r + p, g + q, b + s
    grain = 1.0
    if scale < 1.0:
        grain += (noise(tile, x * 37.0, y * 37.0) - 0.5) * 0.35 * (1 - scale)
    grain /= taps
    return r * grain, g * grain, b * grain


@numba.njit(cache=True, nogil=True, fastmath=True)
def shade(
    distance: Float32Array,
    source: ByteArray,
    face: NDArray[np.int32],
    uv: Float32Array,
    origins: Float32Array,
    directions: Float32Array,
    lit: BoolArray,
    spread_rad: float,
    triangles: Triangles,
    texture: Texture,
    light: Lighting,
    shown: ByteArray,
    signals: ByteArray,
    radiance: Float32Array,
) -> None:
    """Enter the light (N, 3) that comes back along N rays."""
    for i in range(len(distance)):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        if source[i] == SKY:
            r, g, b = sky_at(light.sky, dx, dy, dz)
            toward = dx * light.sun_to[0] + dy * light.sun_to[1] + dz * light.sun_to[2]
            if toward > 0.99996:
                r, g, b = r + 20 * light.sun[0], g + 20 * light.sun[1], b + 20 * light.sun[2]
            radiance[i, 0], radiance[i, 1], radiance[i, 2] = r, g, b
            continue
        t = distance[i]
        x, y, z = origins[i, 0] + t * dx, origins[i, 1] + t * dy, origins[i, 2] + t * dz
        nx, ny, nz = 0.0, 0.0, 1.0
        glow_r, glow_g, glow_b = 0.0, 0.0, 0.0
        if source[i] == GROUND:
            r, g, b = _ground(texture, light.noise, x, y, dx, dy, dz, t * spread_rad)
        else:
            f = face[i]
            nx, ny, nz = normal_at(triangles, f, uv[i, 0], uv[i, 1])
            if nx * dx + ny * dy + nz * dz > 0:
                nx, ny, nz = -nx, -ny, -nz
            tint = triangles.tint[f]
            r, g, b = texture.linear[tint[0]], texture.linear[tint[1]], texture.linear[tint[2]]
        sun = max(nx * light.sun_to[0] + ny * light.sun_to[1] + nz * light.sun_to[2], 0.0) if lit[i] else 0.0
        up = 0.5 + 0.5 * nz
        open_sky = _open_at(light, x + nx * 1.5, y + ny * 1.5)
        open_sky += (1 - open_sky) * min(max(z / 20.0, 0.0), 1.0)
        if z < 1.2:
            shade_near = _near_at(light, x + nx * 0.4, y + ny * 0.4, 0)
            open_sky *= shade_near + (1 - shade_near) * min(max(z / 1.2, 0.0), 1.0)
        p, q, s = sun, up * open_sky, (1 - up) * (0.3 + 0.7 * open_sky)
        er = p * light.sun[0] + q * light.up[0] + s * light.bounce[0]
        eg = p * light.sun[1] + q * light.up[1] + s * light.bounce[1]
        eb = p * light.sun[2] + q * light.up[2] + s * light.bounce[2]
        r, g, b = r * er + glow_r, g * eg + glow_g, b * eb + glow_b
        haze = 1 - math.exp(-light.haze_per_m * t)
        radiance[i, 0] = r + (light.horizon[0] - r) * haze
        radiance[i, 1] = g + (light.horizon[1] - g) * haze
        radiance[i, 2] = b + (light.horizon[2] - b) * haze
