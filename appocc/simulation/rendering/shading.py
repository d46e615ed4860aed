"""Shading of the hits of rays, in one kernel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array
from appocc.simulation.rendering.compiled import array_free_kernel, inlined
from appocc.simulation.rendering.illumination import light_on
from appocc.simulation.rendering.lighting import Lighting
from appocc.simulation.rendering.materials import (
    CHROME,
    FOLIAGE,
    GLASS,
    HEAD_LAMP,
    HEDGE,
    INDICATOR_LEFT,
    INDICATOR_RIGHT,
    PAINT,
    SHOPFRONT,
    SIGN,
    SIGNAL,
    STREET_LAMP,
    TAIL_LAMP,
    TRIM,
    WINDOW,
    material_pattern,
    shop_pane,
    window_pane,
)  # fmt: skip
from appocc.simulation.rendering.noise import noise
from appocc.simulation.rendering.scene_buffers import Triangles, normal_at
from appocc.simulation.rendering.sky import sky_at
from appocc.simulation.rendering.texture import Texture, colour_at
from appocc.simulation.rendering.tracing import GROUND, SKY
from appocc.simulation.traffic import Light

_BRAKE, _LEFT, _RIGHT, _PARKED = (int(bit) for bit in (Light.BRAKE, Light.LEFT, Light.RIGHT, Light.PARKED))


@inlined
def _ground_colour(
    texture: Texture, tile: Float32Array, x: float, y: float, dx: float, dy: float, dz: float, pixel_m: float
) -> tuple[float, float, float]:
    """Return the colour of the ground under a pixel: several texture taps along the pixel's elongated footprint."""
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
        # Taps alternate between the finer and the coarser level, which approximates a blend of both.
        p, q, s = colour_at(texture, x + dx * step, y + dy * step, int(level + share))
        r, g, b = r + p, g + q, b + s
    grain = 1.0
    if scale < 1.0:
        grain += (noise(tile, x * 110.0, y * 110.0) - 0.5) * 0.45 * (1 - scale)
    grain /= taps
    return r * grain, g * grain, b * grain


@inlined
def _emission(
    material: int,
    tag: int,
    tint: tuple[float, float, float],
    light: Lighting,
    actor_lights: ByteArray,
    signals: ByteArray,
) -> tuple[float, float, float]:
    """Return the light a lamp emits."""
    white = light.white
    burning = 1.0 if light.lamps > 0 else 0.0
    if material == STREET_LAMP:
        on = 3.0 * white * burning
        return on, 0.82 * on, 0.55 * on
    if material == SIGNAL:
        return _signal(tag, signals, white)
    bits = actor_lights[tag] if 0 <= tag < len(actor_lights) else _PARKED
    if material == HEAD_LAMP and not bits & _PARKED:
        on = 3.5 * white * burning
        return on, 0.96 * on, 0.86 * on
    if material == TAIL_LAMP and not bits & _PARKED:
        on = white * (1.7 if bits & _BRAKE else 0.45 * burning)
        return on, 0.05 * on, 0.03 * on
    blinks = (material == INDICATOR_LEFT and bits & _LEFT) or (material == INDICATOR_RIGHT and bits & _RIGHT)
    if blinks:
        return 1.8 * white, 0.65 * white, 0.04 * white
    return 0.0, 0.0, 0.0


@inlined
def _signal(tag: int, signals: ByteArray, white: float) -> tuple[float, float, float]:
    """Return the light of a traffic light's lamp; SUMO letters r, y, g, G, u (red, yellow), s, o, O (off)."""
    link, colour = tag // 3, tag % 3
    if tag < 0 or link >= len(signals):
        return 0.0, 0.0, 0.0
    letter = signals[link]
    if colour == 0 and letter in (114, 82, 117, 115):  # r R u s
        return 2.2 * white, 0.07 * white, 0.04 * white
    if colour == 1 and letter in (121, 89, 117, 111):  # y Y u o
        return 2.2 * white, 1.05 * white, 0.05 * white
    if colour == 2 and letter in (103, 71):  # g G
        return 0.06 * white, 1.7 * white, 0.75 * white
    return 0.0, 0.0, 0.0


@inlined
def _environment(light: Lighting, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the environment reflected in a unit direction: the sky above a row of houses above the street."""
    low = 0.06 + 0.12 * noise(light.noise, x * 40.0 + 7.0, y * 40.0)
    r, g, b = sky_at(light.sky, x, y, z)
    if z < low + 0.04:
        share = min(max((low + 0.04 - z) / 0.08, 0.0), 1.0)
        dark = 1.2 if z > 0 else 0.75
        r = r + (dark * light.bounce[0] - r) * share
        g = g + (dark * light.bounce[1] - g) * share
        b = b + (dark * light.bounce[2] - b) * share
    return r, g, b


@inlined
def _shade_face(
    f: int, u: float, v: float, place: tuple[float, float, float], way: tuple[float, float, float], pixel_m: float,
    lit: bool, triangles: Triangles, texture: Texture, light: Lighting, actor_lights: ByteArray, signals: ByteArray,
) -> tuple[float, float, float]:  # fmt: skip
    """Return the radiance of a point on a face, seen along `way`."""
    x, y, z = place
    material, tint = triangles.material[f], triangles.tint[f]
    r, g, b = texture.linear[tint[0]], texture.linear[tint[1]], texture.linear[tint[2]]
    nx, ny, nz = normal_at(triangles, f, u, v)
    one, two, three = triangles.faces[f]
    w = 1 - u - v
    s = w * triangles.uv[one, 0] + u * triangles.uv[two, 0] + v * triangles.uv[three, 0]
    t = w * triangles.uv[one, 1] + u * triangles.uv[two, 1] + v * triangles.uv[three, 1]
    if material in (FOLIAGE, HEDGE):
        # Leaves point in all directions: the normal of the crown is only their mean.
        ruffle = 1.0 if pixel_m < 0.5 else 0.5
        nx += ruffle * (noise(light.noise, y * 23.0 + z * 11.0, z * 23.0) - 0.5)
        ny += ruffle * (noise(light.noise, x * 23.0 - z * 13.0, z * 23.0 + 77.0) - 0.5)
        nz += ruffle * (noise(light.noise, x * 23.0, y * 23.0 + 33.0) - 0.35)
        scale = 1 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-9)
        nx, ny, nz = nx * scale, ny * scale, nz * scale
    facing = -(nx * way[0] + ny * way[1] + nz * way[2])
    if facing < 0 and material != FOLIAGE:
        nx, ny, nz, facing = -nx, -ny, -nz, -facing
    sun = nx * light.sun_to[0] + ny * light.sun_to[1] + nz * light.sun_to[2]
    if material == FOLIAGE:
        sun = (0.75 * max(sun, 0.0) + 0.18) if lit else 0.10 + 0.22 * max(-sun, 0.0)
    else:
        sun = max(sun, 0.0) if lit else 0.0
    mirror, inside = 0.0, 0.0
    if material == WINDOW:
        r, g, b, mirror, inside = window_pane(s, t, one, (r, g, b), light.lamps)
    elif material == SHOPFRONT:
        r, g, b, mirror, inside = shop_pane(s, t, triangles.tag[f], (r, g, b), light.lamps)
    else:
        factor = material_pattern(material, s, t, x, y, z, pixel_m, light.noise)
        r, g, b = r * factor, g * factor, b * factor
    er, eg, eb = light_on(light, x, y, z, nx, ny, nz, sun)
    r, g, b = r * er + inside, g * eg + 0.70 * inside, b * eb + 0.40 * inside
    if material >= STREET_LAMP:
        p, q, k = _emission(material, triangles.tag[f], (r, g, b), light, actor_lights, signals)
        r, g, b = r + p, g + q, b + k
    coat, sharp = _reflectivity(material, mirror)
    if coat > 0:
        p, q, k = _reflection(light, way, nx, ny, nz, facing, z, lit, coat, sharp)
        if material == CHROME:
            r, g, b = 0.35 * r + 0.7 * p, 0.35 * g + 0.7 * q, 0.35 * b + 0.7 * k
        else:
            r, g, b = r + p, g + q, b + k
    return r, g, b


@inlined
def _reflectivity(material: int, mirror: float) -> tuple[float, float]:
    """Return the reflectivity of a surface at normal incidence, and the sharpness of the sun's highlight."""
    if mirror > 0:
        return 0.13 * mirror, 600.0
    if material == PAINT:
        return 0.05, 220.0
    if material == GLASS:
        return 0.09, 500.0
    if material == CHROME:
        return 0.9, 120.0
    if material in (HEAD_LAMP, TAIL_LAMP, SIGN):
        return 0.05, 150.0
    if material == TRIM:
        return 0.02, 30.0
    return 0.0, 1.0


@inlined
def _reflection(
    light: Lighting, way: tuple[float, float, float], nx: float, ny: float, nz: float, facing: float, z: float,
    lit: bool, coat: float, sharp: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Return the reflection of sky, surroundings and sun in a smooth surface (Schlick's Fresnel)."""
    mx, my, mz = way[0] + 2 * facing * nx, way[1] + 2 * facing * ny, way[2] + 2 * facing * nz
    away = 1 - min(facing, 1.0)
    share = coat + (1 - coat) * away * away * away * away * away * 0.85
    r, g, b = _environment(light, mx, my, mz)
    if lit:
        toward = mx * light.sun_to[0] + my * light.sun_to[1] + mz * light.sun_to[2]
        if toward > 0.8:
            spot = min(sharp * 0.10, 25.0) * toward**sharp
            r, g, b = r + spot * light.sun[0], g + spot * light.sun[1], b + spot * light.sun[2]
    return r * share, g * share, b * share


@array_free_kernel
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
    actor_lights: ByteArray,
    signals: ByteArray,
    radiance: Float32Array,
) -> None:
    """Write the radiance (N, 3) along N rays."""
    for i in range(len(distance)):
        # One type everywhere: each helper is compiled only once.
        dx, dy, dz = np.float64(directions[i, 0]), np.float64(directions[i, 1]), np.float64(directions[i, 2])
        if source[i] == SKY:
            r, g, b = sky_at(light.sky, dx, dy, dz)
            if dx * light.sun_to[0] + dy * light.sun_to[1] + dz * light.sun_to[2] > 0.99996:
                r, g, b = r + 20 * light.sun[0], g + 20 * light.sun[1], b + 20 * light.sun[2]
            radiance[i, 0], radiance[i, 1], radiance[i, 2] = r, g, b
            continue
        t = np.float64(distance[i])
        x, y, z = origins[i, 0] + t * dx, origins[i, 1] + t * dy, origins[i, 2] + t * dz
        if source[i] == GROUND:
            r, g, b = _ground_colour(texture, light.noise, x, y, dx, dy, dz, t * spread_rad)
            sun = np.float64(light.sun_to[2]) if lit[i] else 0.0
            p, q, s = light_on(light, x, y, 0.0, 0.0, 0.0, 1.0, sun)
            wet = 1 - 0.45 * light.wetness
            r, g, b = r * p * wet, g * q * wet, b * s * wet
        else:
            r, g, b = _shade_face(
                face[i], uv[i, 0], uv[i, 1], (x, y, z), (dx, dy, dz), t * spread_rad, lit[i], triangles, texture,
                light, actor_lights, signals,
            )  # fmt: skip
        haze = 1 - math.exp(-light.haze_per_m * t)
        radiance[i, 0] = r + (light.horizon[0] - r) * haze
        radiance[i, 1] = g + (light.horizon[1] - g) * haze
        radiance[i, 2] = b + (light.horizon[2] - b) * haze
