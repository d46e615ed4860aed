"""Colours in CIELAB, and the robust colour of a vehicle's cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from appocc.checks import BoolArray, FloatArray, IntArray

# Linear sRGB to XYZ (IEC 61966-2-1), and the white point D65 of the 2 degree observer (CIE 15); these and the two
# numbers of the straight part near black are rounded as scikit-image rounds them, so that both give the same.
_XYZ_FROM_RGB = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
_WHITE_XYZ = np.array([0.95047, 1.0, 1.08883])
_STRAIGHT_BELOW, _STRAIGHT_SLOPE = 0.008856, 7.787
# Fewer cells inside a blob than this say less than all of its cells.
LEAST_INSIDE = 4


def _linear(rgb: FloatArray) -> FloatArray:
    """Linear light 0..1 of sRGB values 0..255."""
    share = rgb / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


_LINEAR_OF_BYTE = _linear(np.arange(256.0))


def lab_from_rgb(rgb: ArrayLike) -> FloatArray:
    """CIELAB (..., 3) under D65 of sRGB colours (..., 3) in 0..255, fastest of bytes; NaN of NaN."""
    values = np.asarray(rgb)
    linear = _LINEAR_OF_BYTE[values] if values.dtype == np.uint8 else _linear(values.astype(np.float64))
    ratio = linear @ (_XYZ_FROM_RGB.T / _WHITE_XYZ)
    f = np.where(ratio > _STRAIGHT_BELOW, np.cbrt(ratio), ratio * _STRAIGHT_SLOPE + 16 / 116)
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def robust_lab(lab: FloatArray, inside: BoolArray, member: IntArray, count: int) -> FloatArray:
    """(N, 3) colour of each of `count` groups of cells: the mean of the lighter half without the lightest tenth.

    Windows and shadow are darker than paint; lamps and glints are lighter, and few. The rim of a group is mixed with
    what lies around it: only cells `inside` count where there are LEAST_INSIDE of them.

    Args:
        lab: (C, 3) colours of cells, CIELAB.
        inside: (C,) whether all cells beside a cell are of its group.
        member: (C,) group of each cell, 0..count - 1.
        count: number of groups.

    Returns:
        CIELAB; NaN of groups without cells.
    """
    enough = np.bincount(member[inside], minlength=count) >= LEAST_INSIDE
    taken = inside | ~enough[member]
    lab, member = lab[taken], member[taken]
    order = np.lexsort((lab[:, 0], member))
    lab, member = lab[order], member[order]
    size = np.bincount(member, minlength=count)
    rank = np.arange(len(member)) - (np.cumsum(size) - size)[member]
    dark, glints = size // 2, size // 10
    paint = (rank >= dark[member]) & (rank < (size - glints)[member])
    sums = np.stack([np.bincount(member[paint], channel[paint], count) for channel in lab.T], axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(sums / (size - dark - glints)[:, None])
