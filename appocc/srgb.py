"""The sRGB transfer function (IEC 61966-2-1), both ways."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from appocc.checks import FloatArray


def encode_srgb(linear: ArrayLike) -> FloatArray:
    """Return sRGB values 0..1 of linear light 0..1, of any shape; NaN stays NaN."""
    light = np.asarray(linear, np.float64)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def decode_srgb(values: ArrayLike) -> FloatArray:
    """Return linear light 0..1 of sRGB values 0..1, of any shape; NaN stays NaN."""
    share = np.asarray(values, np.float64)
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


LINEAR_OF_BYTE = decode_srgb(np.arange(256.0) / 255.0)


def linear_from_srgb(rgb: ArrayLike) -> FloatArray:
    """Return linear light 0..1 of sRGB values 0..255, of any shape; fastest for bytes. NaN stays NaN."""
    values = np.asarray(rgb)
    return LINEAR_OF_BYTE[values] if values.dtype == np.uint8 else decode_srgb(values.astype(np.float64) / 255.0)
