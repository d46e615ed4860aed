"""Adaptive antialiasing, and reflections on wet streets."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array
from appocc.simulation.rendering.compiled import kernel
from appocc.simulation.rendering.noise import hash_unit, noise
from appocc.simulation.rendering.texture import Texture, label_at
from appocc.simulation.rendering.tracing import GROUND, SKY
from appocc.simulation.surface import Surface

_KERB, _GRASS, _EARTH = int(Surface.KERB), int(Surface.GRASS), int(Surface.EARTH)
# Steps in image value (0..1, approximately after the tone curve) that are visible as jagged edges.
_STEP, _GROUND_STEP = 0.07, 0.18
# Range of reflections on wet streets; only the sky's light is reflected beyond it.
_MIRROR_M = 90.0
# Noise threshold of puddles; share of Fresnel reflection of a water film on asphalt; smallest share worth a ray.
_PUDDLES_FROM, _FILM, _FAINT = 0.91, 0.14, 0.01


@kernel
def find_jagged_pixels(
    linear: Float32Array, gain: float, source: ByteArray, lit: BoolArray, width_px: int
) -> NDArray[np.int32]:
    """Return pixels (M,), row by row, that differ so much from a neighbour that they need more rays.

    The ground texture is filtered at lookup, so on the ground only edges of shadows count, and in the sky nothing
    does.

    Args:
        linear: (N, 3) radiance at the pixel centres, row by row.
        gain: exposure.
        source: (N,) source of the hit at each centre.
        lit: (N,) whether the hit is sunlit.
        width_px: pixels per row.
    """
    count = len(linear)
    value = np.empty(count, np.float32)
    for i in range(count):
        bright = gain * (0.3 * linear[i, 0] + 0.5 * linear[i, 1] + 0.2 * linear[i, 2])
        value[i] = math.sqrt(min(bright, 1.6))
    marked = np.zeros(count, np.bool_)
    for i in range(count):
        for step in (1, width_px):
            j = i + step
            if j >= count or (step == 1 and j % width_px == 0):
                continue
            if source[i] == SKY and source[j] == SKY:
                continue
            flat = source[i] == GROUND and source[j] == GROUND and lit[i] == lit[j]
            if abs(value[i] - value[j]) > (_GROUND_STEP if flat else _STEP):
                marked[i] = marked[j] = True
    return np.flatnonzero(marked).astype(np.int32)


@kernel
def blend_extra_rays(
    linear: Float32Array, pixels: NDArray[np.int32], more: Float32Array, rays: int, limit: float
) -> None:
    """Replace the radiance of pixels by the mean of their centre ray and `rays` extra rays each, (rays * M, 3).

    Radiance is clipped to `limit`, so that edges of overexposed areas are smooth.
    """
    count = len(pixels)
    for i in range(count):
        for k in range(3):
            total = min(linear[pixels[i], k], limit)
            for ray in range(rays):
                total += min(more[ray * count + i, k], limit)
            linear[pixels[i], k] = total / (rays + 1)


@kernel
def reflect_wet_ground(
    distance: Float32Array,
    source: ByteArray,
    origins: Float32Array,
    directions: Float32Array,
    texture: Texture,
    tile: Float32Array,
    wetness: float,
) -> tuple[NDArray[np.int32], Float32Array, Float32Array, Float32Array]:
    """Return reflecting hits (M,), their reflectivity (M,), and origins and directions (M, 3) of reflected rays.

    Puddles are where the noise is high, most of them along kerbs; elsewhere a film of water over rough asphalt
    reflects little, and blurred. Hits with negligible reflectivity are skipped.
    """
    numbers, shares = np.empty(len(distance), np.int32), np.empty(len(distance), np.float32)
    starts, ways = np.empty((len(distance), 3), np.float32), np.empty((len(distance), 3), np.float32)
    count = 0
    for i in range(len(distance)):
        if source[i] != GROUND or distance[i] > _MIRROR_M:
            continue
        x, y = origins[i, 0] + distance[i] * directions[i, 0], origins[i, 1] + distance[i] * directions[i, 1]
        label = label_at(texture, x, y)
        if label in (-1, _GRASS, _EARTH):
            continue
        # Two scales: puddles of a few metres, and areas with more and with fewer of them.
        pool = 0.6 * noise(tile, x * 9.0, y * 9.0) + 0.4 * noise(tile, x * 1.1, y * 1.1)
        smooth = min(max((pool + (0.14 if label == _KERB else 0.0) - _PUDDLES_FROM) * 16.0, 0.0), 1.0)
        away = 1 - min(-directions[i, 2], 1.0)
        fresnel = 0.03 + 0.97 * away**5
        share = wetness * fresnel * (_FILM + (0.6 - _FILM) * smooth)
        if share < _FAINT:
            continue
        # On a water film, each grain tilts the reflection: images stretch downward and blur.
        rough = (1 - smooth) * (0.055 + 0.035 * hash_unit(int(x * 300.0), int(y * 300.0)))
        dx, dy, dz = directions[i, 0], directions[i, 1], -directions[i, 2] + rough
        scale = 1 / math.sqrt(dx * dx + dy * dy + dz * dz)
        numbers[count], shares[count] = i, share
        starts[count, 0], starts[count, 1], starts[count, 2] = x, y, 0.01
        ways[count, 0], ways[count, 1], ways[count, 2] = dx * scale, dy * scale, dz * scale
        count += 1
    return numbers[:count], shares[:count], starts[:count], ways[:count]


@kernel
def blend_reflections(
    radiance: Float32Array, numbers: NDArray[np.int32], shares: Float32Array, image: Float32Array
) -> None:
    """Blend the radiance (M, 3) of reflected rays into that of hits."""
    for i in range(len(numbers)):
        for k in range(3):
            own = radiance[numbers[i], k]
            radiance[numbers[i], k] = own + (image[i, k] - own) * shares[i]
