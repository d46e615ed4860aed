"""The ground's colours at all scales: a pyramid of halved pictures, and lookups in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array
from appocc.simulation.rendering.compiled import inner, kernel
from appocc.simulation.surface import CELL_M, Ground
from appocc.srgb import encode_srgb, linear_from_srgb

_LEVELS = 9
LINEAR: Float32Array = linear_from_srgb(np.arange(256)).astype(np.float32)


class Texture(NamedTuple):
    """A ground as kernels take it.

    Attributes:
        low_x: lower corner, metres.
        low_y: lower corner, metres.
        label: (H, W) uint8 `Surface`.
        colour: (H, W, 3) uint8 sRGB, level 0.
        halved: (N, 3) uint8 the texels of all further levels, one after the other.
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


def textured(ground: Ground) -> Texture:
    """Build the pyramid of a ground; level 0 stays where it is."""
    pictures, shapes, start = [], [(0, *ground.label.shape)], 0
    picture = ground.colour
    while len(shapes) < _LEVELS and min(picture.shape[:2]) >= 8:
        picture = _halved(picture, LINEAR, _encoding())
        picture.flags.writeable = False  # one signature of the kernel
        shapes.append((start, *picture.shape[:2]))
        start += picture.shape[0] * picture.shape[1]
        pictures.append(picture.reshape(-1, 3))
    return Texture(
        float(ground.low_m[0]),
        float(ground.low_m[1]),
        ground.label,
        ground.colour,
        np.concatenate(pictures) if pictures else np.zeros((1, 3), np.uint8),
        np.array(shapes, np.int64),
        LINEAR,
    )


def _encoding() -> ByteArray:
    """(4096,) uint8 sRGB byte by linear value * 4095."""
    return np.asarray(np.rint(encode_srgb(np.arange(4096) / 4095) * 255), np.uint8)


@kernel
def _halved(picture: ByteArray, linear: Float32Array, encoding: ByteArray) -> ByteArray:
    """Means of 2x2 in linear light: else white lines on asphalt would grow dark with distance."""
    rows, columns = picture.shape[0] // 2, picture.shape[1] // 2
    half = np.empty((rows, columns, 3), np.uint8)
    for row in range(rows):
        for column in range(columns):
            for k in range(3):
                upper = linear[picture[2 * row, 2 * column, k]] + linear[picture[2 * row, 2 * column + 1, k]]
                lower = linear[picture[2 * row + 1, 2 * column, k]] + linear[picture[2 * row + 1, 2 * column + 1, k]]
                half[row, column, k] = encoding[int((upper + lower) * np.float32(1023.75) + np.float32(0.5))]
    return half


@inner
def label_at(texture: Texture, x: float, y: float) -> int:
    """The `Surface` at a place, -1 beyond the ground's edge."""
    row = int(np.floor((y - texture.low_y) / CELL_M))
    column = int(np.floor((x - texture.low_x) / CELL_M))
    if 0 <= row < texture.label.shape[0] and 0 <= column < texture.label.shape[1]:
        return int(texture.label[row, column])
    return -1


@inner
def colour_at(texture: Texture, x: float, y: float, level: int) -> tuple[float, float, float]:
    """Linear colour at a place, between the texels of a level straight; a dull green beyond the ground's edge."""
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
