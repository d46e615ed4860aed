"""Where one ray a pixel is not enough, and the rays that wet streets mirror."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, Float32Array
from appocc.simulation.rendering.compiled import kernel
from appocc.simulation.rendering.noise import hashed, noise
from appocc.simulation.rendering.texture import Texture, label_at
from appocc.simulation.rendering.tracing import GROUND, SKY
from appocc.simulation.surface import Surface

_KERB, _GRASS, _EARTH = int(Surface.KERB), int(Surface.GRASS), int(Surface.EARTH)
# Steps of the picture's value (0..1, after the tone curve about) that an eye would see as a jagged edge.
_STEP, _GROUND_STEP = 0.07, 0.18
# Wet streets mirror so far; beyond, the sky's light alone.
_MIRROR_M = 90.0
# Where the noise has puddles; how much of Fresnel's share a film on asphalt mirrors; what is not worth a ray.
_PUDDLES_FROM, _FILM, _FAINT = 0.91, 0.14, 0.01


@kernel
def jagged(linear: Float32Array, gain: float, source: ByteArray, lit: BoolArray, width_px: int) -> NDArray[np.int32]:
    """Pixels (M,), row by row, that differ from a neighbour so much that their centre alone does not stand for them.

    The ground's texture is filtered when it is looked up, so on the ground only shadows' edges count, and in the sky
    nothing does.

    Args:
        linear: (N, 3) light of the pixels' centres, row by row.
        gain: exposure.
        source: (N,) what the centres met.
        lit: (N,) whether the sun shines on it.
        width_px: pixels in a row.
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
def mixed_in(linear: Float32Array, pixels: NDArray[np.int32], more: Float32Array, rays: int, limit: float) -> None:
    """Replace pixels' light by the mean of their centre's and of `rays` more rays each, (rays * M, 3).

    Light above `limit` counts as that: a white picture element is white, and its edges smooth.
    """
    count = len(pixels)
    for i in range(count):
        for k in range(3):
            total = min(linear[pixels[i], k], limit)
            for ray in range(rays):
                total += min(more[ray * count + i, k], limit)
            linear[pixels[i], k] = total / (rays + 1)


@kernel
def off_wet_ground(
    distance: Float32Array,
    source: ByteArray,
    origins: Float32Array,
    directions: Float32Array,
    texture: Texture,
    tile: Float32Array,
    wetness: float,
) -> tuple[NDArray[np.int32], Float32Array, Float32Array, Float32Array]:
    """Which of N hits mirror (M,), how much (M,), and the mirrored rays' origins and directions (M, 3).

    A few puddles stand where the noise is high, most of them along kerbs; elsewhere a film of water over rough
    asphalt mirrors little, and blurs what it mirrors. Where it mirrors next to nothing there is no ray.
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
        # Two scales: pools of a few metres, and streets with more and with fewer of them.
        pool = 0.6 * noise(tile, x * 9.0, y * 9.0) + 0.4 * noise(tile, x * 1.1, y * 1.1)
        smooth = min(max((pool + (0.14 if label == _KERB else 0.0) - _PUDDLES_FROM) * 16.0, 0.0), 1.0)
        away = 1 - min(-directions[i, 2], 1.0)
        fresnel = 0.03 + 0.97 * away**5
        share = wetness * fresnel * (_FILM + (0.6 - _FILM) * smooth)
        if share < _FAINT:
            continue
        # Where there is only a film, each grain tilts the mirror: images stretch downward and blur.
        rough = (1 - smooth) * (0.055 + 0.035 * hashed(int(x * 300.0), int(y * 300.0)))
        dx, dy, dz = directions[i, 0], directions[i, 1], -directions[i, 2] + rough
        scale = 1 / math.sqrt(dx * dx + dy * dy + dz * dz)
        numbers[count], shares[count] = i, share
        starts[count, 0], starts[count, 1], starts[count, 2] = x, y, 0.01
        ways[count, 0], ways[count, 1], ways[count, 2] = dx * scale, dy * scale, dz * scale
        count += 1
    return numbers[:count], shares[:count], starts[:count], ways[:count]


@kernel
def mirrored_in(
    radiance: Float32Array, numbers: NDArray[np.int32], shares: Float32Array, image: Float32Array
) -> None:
    """Mix the light (M, 3) of mirrored rays into that of hits."""
    for i in range(len(numbers)):
        for k in range(3):
            own = radiance[numbers[i], k]
            radiance[numbers[i], k] = own + (image[i, k] - own) * shares[i]
