"""The ground texture as a mipmap pyramid, and lookups in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array
from appocc.simulation.rendering.compiled import inlined, kernel
from appocc.simulation.surface import CELL_M, Ground
from appocc.srgb import encode_srgb, linear_from_srgb

_LEVELS = 9
LINEAR: Float32Array = linear_from_srgb(np.arange(256)).astype(np.float32)


class Texture(NamedTuple):
    """Ground texture in the form the kernels take.

    Attributes:
        low_x: lower corner, metres.
        low_y: lower corner, metres.
        label: (H, W) uint8 `Surface`.
        colour: (H, W, 3) uint8 sRGB, level 0.
        halved: (N, 3) uint8 texels of all coarser levels, one after the other.
        level: (L, 3) int64 first texel (of level 1 and above), rows and columns of each level.
        linear: (256,) float32 linear value of an sRGB byte.
    """

    low_x: float
    low_y: float
    label: ByteArray
    colour: ByteArray
    halved: ByteArray
    level: NDArray[np.int64]
    linear: Float32Array


def build_texture(ground: Ground) -> Texture:
    """Build the mipmap pyramid of a ground; level 0 is not copied."""
    images, shapes, start = [], [(0, *ground.label.shape)], 0
    image = ground.colour
    while len(shapes) < _LEVELS and min(image.shape[:2]) >= 8:
        image = _halve(image, LINEAR, _encoding())
        image.flags.writeable = False  # a single kernel signature
        shapes.append((start, *image.shape[:2]))
        start += image.shape[0] * image.shape[1]
        images.append(image.reshape(-1, 3))
    return Texture(
        low_x=float(ground.low_m[0]),
        low_y=float(ground.low_m[1]),
        label=ground.label,
        colour=ground.colour,
        halved=np.concatenate(images) if images else np.zeros((1, 3), np.uint8),
        level=np.array(shapes, np.int64),
        linear=LINEAR,
    )


def _encoding() -> ByteArray:
    """Return (4096,) uint8 sRGB byte by linear value * 4095."""
    return np.asarray(np.rint(encode_srgb(np.arange(4096) / 4095) * 255), np.uint8)


@kernel
def _halve(image: ByteArray, linear: Float32Array, encoding: ByteArray) -> ByteArray:
    """Average 2x2 texels in linear light; otherwise white lines on asphalt would darken with distance."""
    rows, columns = image.shape[0] // 2, image.shape[1] // 2
    half = np.empty((rows, columns, 3), np.uint8)
    for row in range(rows):
        for column in range(columns):
            for k in range(3):
                upper = linear[image[2 * row, 2 * column, k]] + linear[image[2 * row, 2 * column + 1, k]]
                lower = linear[image[2 * row + 1, 2 * column, k]] + linear[image[2 * row + 1, 2 * column + 1, k]]
                half[row, column, k] = encoding[int((upper + lower) * np.float32(1023.75) + np.float32(0.5))]
    return half


@inlined
def label_at(texture: Texture, x: float, y: float) -> int:
    """Return the `Surface` at a point, -1 beyond the ground's edge."""
    row = int(np.floor((y - texture.low_y) / CELL_M))
    column = int(np.floor((x - texture.low_x) / CELL_M))
    if 0 <= row < texture.label.shape[0] and 0 <= column < texture.label.shape[1]:
        return int(texture.label[row, column])
    return -1


@inlined
def colour_at(texture: Texture, x: float, y: float, level: int) -> tuple[float, float, float]:
    """Interpolate the linear colour at a point bilinearly in a level; a dull green beyond the ground's edge."""
    level = min(max(level, 0), len(texture.level) - 1)
    start, rows, columns = texture.level[level]
    cell = CELL_M * (1 << level)
    u, v = (x - texture.low_x) / cell - 0.5, (y - texture.low_y) / cell - 0.5
    if u < -1 or v < -1 or u > columns or v > rows:
        return 0.055, 0.075, 0.032
    u, v = min(max(u, 0.0), columns - 1.001), min(max(v, 0.0), rows - 1.001)
    column, row = int(u), int(v)
    a, b = u - column, v - row
    linear = texture.linear
    if level == 0:
        one, two = texture.colour[row, column], texture.colour[row, column + 1]
        three, four = texture.colour[row + 1, column], texture.colour[row + 1, column + 1]
    else:
        first = start + row * columns + column
        one, two = texture.halved[first], texture.halved[first + 1]
        three, four = texture.halved[first + columns], texture.halved[first + columns + 1]
    p, q, r, s = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
    return (
        p * linear[one[0]] + q * linear[two[0]] + r * linear[three[0]] + s * linear[four[0]],
        p * linear[one[1]] + q * linear[two[1]] + r * linear[three[1]] + s * linear[four[1]],
        p * linear[one[2]] + q * linear[two[2]] + r * linear[three[2]] + s * linear[four[2]],
    )
