"""What light comes back from where rays end: one kernel over all of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array
from appocc.simulation.rendering.compiled import inner, outer
from appocc.simulation.rendering.lighting import (
    LAMP_CELL_M,
    NEAR_CELL_M,
    NEAR_CELLS,
    OPEN_CELL_M,
    Lighting,
)
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
    pane,
    pattern,
)  # fmt: skip
from appocc.simulation.rendering.noise import noise
from appocc.simulation.rendering.sky import sky_at
from appocc.simulation.rendering.stage import Triangles
from appocc.simulation.rendering.texture import Texture, colour_at
from appocc.simulation.rendering.tracing import ACTOR, GROUND, SKY
from appocc.simulation.traffic import Light

_BRAKE, _LEFT, _RIGHT, _PARKED = (int(bit) for bit in (Light.BRAKE, Light.LEFT, Light.RIGHT, Light.PARKED))


@inner
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


@outer
def toward_sun(
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
    """Which of N hits face the sun and do not stand in the ego's shadow; returns how many, M.

    Enters their numbers into the front of `numbers` (N,), and where rays to the sun begin into that of `starts`
    (N, 3).
    """
    count = 0
    for i in range(len(distance)):
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


@inner
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


@inner
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


@inner
def _kept_off_zero(value: float) -> float:
    return value if abs(value) > 1e-6 else 1e-6


@inner
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


@inner
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


@inner
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


@inner
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


@inner
def _glow(
    material: int, tag: int, tint: tuple[float, float, float], light: Lighting, shown: ByteArray, signals: ByteArray
) -> tuple[float, float, float]:
    """Light that a lamp gives off by itself."""
    white = light.white
    burning = 1.0 if light.lamps > 0 else 0.0
    if material == STREET_LAMP:
        on = 3.0 * white * burning
        return on, 0.82 * on, 0.55 * on
    if material == SIGNAL:
        return _signal(tag, signals, white)
    bits = shown[tag] if 0 <= tag < len(shown) else _PARKED
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


@inner
def _signal(tag: int, signals: ByteArray, white: float) -> tuple[float, float, float]:
    """Light of a traffic light's lamp; letters are SUMO's: r, y, g, G, u (red and yellow), s, o (yellow), O (off)."""
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


@inner
def _mirrored(light: Lighting, x: float, y: float, z: float) -> tuple[float, float, float]:
    """What a smooth surface would mirror in a unit direction: the sky over a row of houses over the street."""
    low = 0.05 + 0.16 * noise(light.noise, x * 60.0 + 7.0, y * 60.0) * noise(light.noise, x * 200.0, y * 200.0)
    r, g, b = sky_at(light.sky, x, y, z)
    if z < low + 0.02:
        share = min(max((low + 0.02 - z) / 0.04, 0.0), 1.0)
        dark = 1.2 if z > 0 else 0.75
        r = r + (dark * light.bounce[0] - r) * share
        g = g + (dark * light.bounce[1] - g) * share
        b = b + (dark * light.bounce[2] - b) * share
    return r, g, b


@inner
def _lamps_on(
    light: Lighting, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> tuple[float, float, float]:
    """Light of street lamps and head and tail lamps on a surface."""
    side = 1.0 - 0.45 * (1 - max(nz, 0.0))
    street = _lamp_at(light, x + nx * 0.5, y + ny * 0.5) * side * min(max((9.0 - z) / 4.0, 0.0), 1.0)
    near_x, near_y, low = x + nx * 0.5, y + ny * 0.5, min(max((1.6 - z) / 0.9, 0.12), 1.0)
    head, tail = _near_at(light, near_x, near_y, 1) * side * low, _near_at(light, near_x, near_y, 2) * side * low
    if light.ego_box[0] > 0:
        pose = light.ego_from_town
        front = light.ego_box[3] + light.ego_box[0] / 2
        ahead = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - front
        aside = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
        if 0 < ahead < 55:
            spread, fade = aside / (1.0 + 0.30 * ahead), 1 - ahead / 55
            facing = max(-(pose[0, 0] * nx + pose[0, 1] * ny), 0.0)
            head += math.exp(-spread * spread) * fade * fade * (
                1.5 * max(nz, 0.0) * ahead / (ahead + 3.0) + 2.2 * facing * low
            )  # fmt: skip
    return street + head + tail, 0.80 * street + 0.95 * head + 0.05 * tail, 0.50 * street + 0.82 * head + 0.03 * tail


@inner
def _light_on(
    light: Lighting, x: float, y: float, z: float, nx: float, ny: float, nz: float, sun: float
) -> tuple[float, float, float]:
    """All light on a surface at a place; `sun` is the share of the sun's that meets it."""
    up = 0.5 + 0.5 * nz
    free = _open_at(light, x + nx * 1.5, y + ny * 1.5)
    free += (1 - free) * min(max(z / 18.0, 0.0), 1.0)
    if z < 1.3:
        shade = _near_at(light, x + nx * 0.3, y + ny * 0.3, 0)
        free *= shade + (1 - shade) * min(max(z / 1.3, 0.0), 1.0)
    # The lower half of what a wall sees is the street, sunny where the sky over it is open.
    open_sky, street = up * (0.12 + 0.88 * free), (1 - up) * (0.25 + 0.75 * free)
    r = sun * light.sun[0] + open_sky * light.up[0] + street * light.bounce[0]
    g = sun * light.sun[1] + open_sky * light.up[1] + street * light.bounce[1]
    b = sun * light.sun[2] + open_sky * light.up[2] + street * light.bounce[2]
    if light.lamps > 0 and z < 9.0:
        p, q, s = _lamps_on(light, x, y, z, nx, ny, nz)
        r, g, b = r + light.lamps * p, g + light.lamps * q, b + light.lamps * s
    return r, g, b


@inner
def _surface(
    f: int, u: float, v: float, place: tuple[float, float, float], way: tuple[float, float, float], pixel_m: float,
    lit: bool, triangles: Triangles, texture: Texture, light: Lighting, shown: ByteArray, signals: ByteArray,
) -> tuple[float, float, float]:  # fmt: skip
    """Light that comes back from a place on a face, seen along `way`."""
    x, y, z = place
    material, tint = triangles.material[f], triangles.tint[f]
    r, g, b = texture.linear[tint[0]], texture.linear[tint[1]], texture.linear[tint[2]]
    nx, ny, nz = normal_at(triangles, f, u, v)
    one, two, three = triangles.faces[f]
    w = 1 - u - v
    s = w * triangles.uv[one, 0] + u * triangles.uv[two, 0] + v * triangles.uv[three, 0]
    t = w * triangles.uv[one, 1] + u * triangles.uv[two, 1] + v * triangles.uv[three, 1]
    if material in (FOLIAGE, HEDGE):
        # Leaves point everywhere: the crown's own normal is only where most of them look.
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
    if material in (WINDOW, SHOPFRONT):
        r, g, b, mirror, inside = pane(material == SHOPFRONT, s, t, one, (r, g, b), light.lamps)
    else:
        factor = pattern(material, s, t, x, y, z, pixel_m, light.noise)
        r, g, b = r * factor, g * factor, b * factor
    er, eg, eb = _light_on(light, x, y, z, nx, ny, nz, sun)
    r, g, b = r * er + inside, g * eg + 0.70 * inside, b * eb + 0.40 * inside
    if material >= STREET_LAMP:
        p, q, k = _glow(material, triangles.tag[f], (r, g, b), light, shown, signals)
        r, g, b = r + p, g + q, b + k
    coat, sharp = _coat(material, mirror)
    if coat > 0:
        p, q, k = _gloss(light, way, nx, ny, nz, facing, z, lit, coat, sharp)
        if material == CHROME:
            r, g, b = 0.35 * r + 0.7 * p, 0.35 * g + 0.7 * q, 0.35 * b + 0.7 * k
        else:
            r, g, b = r + p, g + q, b + k
    return r, g, b


@inner
def _coat(material: int, mirror: float) -> tuple[float, float]:
    """How much of what is before it a surface mirrors, looked at straight; and how sharp the sun's highlight is."""
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


@inner
def _gloss(
    light: Lighting, way: tuple[float, float, float], nx: float, ny: float, nz: float, facing: float, z: float,
    lit: bool, coat: float, sharp: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Sky, surroundings and sun in a smooth surface (Schlick's Fresnel)."""
    mx, my, mz = way[0] + 2 * facing * nx, way[1] + 2 * facing * ny, way[2] + 2 * facing * nz
    away = 1 - min(facing, 1.0)
    share = coat + (1 - coat) * away * away * away * away * away * 0.85
    r, g, b = _mirrored(light, mx, my, mz)
    if lit:
        toward = mx * light.sun_to[0] + my * light.sun_to[1] + mz * light.sun_to[2]
        if toward > 0.8:
            spot = min(sharp * 0.10, 25.0) * toward**sharp
            r, g, b = r + spot * light.sun[0], g + spot * light.sun[1], b + spot * light.sun[2]
    return r * share, g * share, b * share


@outer
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
            if dx * light.sun_to[0] + dy * light.sun_to[1] + dz * light.sun_to[2] > 0.99996:
                r, g, b = r + 20 * light.sun[0], g + 20 * light.sun[1], b + 20 * light.sun[2]
            radiance[i, 0], radiance[i, 1], radiance[i, 2] = r, g, b
            continue
        t = distance[i]
        x, y, z = origins[i, 0] + t * dx, origins[i, 1] + t * dy, origins[i, 2] + t * dz
        if source[i] == GROUND:
            r, g, b = _ground(texture, light.noise, x, y, dx, dy, dz, t * spread_rad)
            sun = light.sun_to[2] if lit[i] else np.float32(0.0)
            p, q, s = _light_on(light, x, y, 0.0, 0.0, 0.0, 1.0, sun)
            wet = 1 - 0.45 * light.wetness
            r, g, b = r * p * wet, g * q * wet, b * s * wet
        else:
            r, g, b = _surface(
                face[i], uv[i, 0], uv[i, 1], (x, y, z), (dx, dy, dz), t * spread_rad, lit[i], triangles, texture,
                light, shown, signals,
            )  # fmt: skip
        haze = 1 - math.exp(-light.haze_per_m * t)
        radiance[i, 0] = r + (light.horizon[0] - r) * haze
        radiance[i, 1] = g + (light.horizon[1] - g) * haze
        radiance[i, 2] = b + (light.horizon[2] - b) * haze
