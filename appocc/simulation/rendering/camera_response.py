"""Camera response: exposure, tone curve, glare, vignetting and noise."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array
from appocc.simulation.rendering.compiled import inlined, kernel
from appocc.simulation.rendering.weather import Weather
from appocc.srgb import encode_srgb

_STEPS = 4096
# Full-well capacity and read noise in electrons: a small automotive sensor by day.
_FULL_WELL, _READ_NOISE = 6000.0, 9.0
_VIGNETTE = 0.22
_BLUR = 0.045
_WHITE = 8.0  # exposed values above this are white


def exposure_gains(weather: Weather, sky_light: Float32Array) -> Float32Array:
    """Return (3,) float32 gains, white balance included, that expose a street in that weather to middle grey.

    The gains depend on the weather alone, so that a colour is the same in all cameras and from above.
    """
    height = max(math.sin(weather.sun_elevation_rad), 0.12)
    light = np.array([0.2126, 0.7152, 0.0722]) @ (np.asarray(weather.sun) * height * 0.6 + sky_light)
    # Cameras underexpose dark scenes slightly.
    lamps = 0.10 * weather.lamps
    gain = 1.5 / (float(light) + lamps) ** 0.92 * 2.0**weather.exposure_stops
    return np.asarray(gain * np.asarray(weather.white), np.float32)


def tone_map(linear: Float32Array, gains: Float32Array) -> ByteArray:
    """Convert linear radiance (..., 3) float32 to uint8 sRGB by the tone curve, without lens effects and noise."""
    value = np.sqrt(np.clip(linear * gains, 0.0, _WHITE) / _WHITE) * (_STEPS - 1)
    return np.asarray(np.rint(_curve()[value.astype(np.int32)] * 255), np.uint8)


def _curve() -> Float32Array:
    """Return (4096,) float32 output by the square root of radiance / _WHITE: a film-like tone curve."""
    x = (np.arange(_STEPS) / (_STEPS - 1)) ** 2 * _WHITE
    x = x * x / (x + 0.02)
    film = (1 - np.exp(-1.15 * x)) / (1 - np.exp(-1.15 * _WHITE))
    return np.asarray(encode_srgb(film), np.float32)


def apply_response(linear: Float32Array, gains: Float32Array, glow: float, rng: np.random.Generator) -> ByteArray:
    """Convert radiance (H, W, 3) float32 to an image (H, W, 3) uint8 with lens effects and noise.

    Args:
        linear: linear RGB radiance.
        gains: (3,) of `exposure_gains`.
        glow: share of overexposed light that spreads as glare (lamps by night).
        rng: random generator of the noise.
    """
    if glow > 0:
        linear = linear + glow * _blur_glare(np.maximum(np.minimum(linear * gains, 30.0) - 1.5, 0.0)) / gains
    seed = int(rng.integers(1 << 31))
    return _expose(np.ascontiguousarray(linear, np.float32), gains, _curve(), seed)


def _blur_glare(bright: Float32Array) -> Float32Array:
    """Blur light to a halo of about a tenth of the image height."""
    rows, columns = bright.shape[:2]
    small = cv2.resize(bright, (max(columns // 4, 1), max(rows // 4, 1)), interpolation=cv2.INTER_AREA)
    halo = cv2.GaussianBlur(small, (0, 0), rows / 120) + 0.5 * cv2.GaussianBlur(small, (0, 0), rows / 30)
    return np.asarray(cv2.resize(halo, (columns, rows), interpolation=cv2.INTER_LINEAR), np.float32)


@inlined
def _random_bits(seed: int, number: int) -> Any:
    """Return 64 pseudorandom bits by number (splitmix64)."""
    z = np.uint64(seed) * np.uint64(0xD1342543DE82EF95) + np.uint64(number) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@kernel
def _expose(linear: Float32Array, gains: Float32Array, curve: Float32Array, seed: int) -> NDArray[np.uint8]:
    rows, columns = linear.shape[:2]
    image = np.empty((rows, columns, 3), np.uint8)
    reach = 4.0 / (rows * rows + columns * columns)
    part = np.uint64(0xFFFF)
    for row in range(rows):
        up, down = max(row - 1, 0), min(row + 1, rows - 1)
        for column in range(columns):
            left, right = max(column - 1, 0), min(column + 1, columns - 1)
            off = ((row - rows / 2) ** 2 + (column - columns / 2) ** 2) * reach
            fall = 1.0 - _VIGNETTE * off * (1.2 - 0.2 * off)
            for k in range(3):
                around = (
                    linear[up, column, k] + linear[down, column, k] + linear[row, left, k] + linear[row, right, k]
                )
                value = gains[k] * fall * ((1 - 4 * _BLUR) * linear[row, column, k] + _BLUR * around)
                bits = _random_bits(seed, (row * columns + column) * 3 + k)
                # The sum of four uniform numbers is nearly normal; its standard deviation is 37837.
                total = (bits & part) + ((bits >> np.uint64(16)) & part) + ((bits >> np.uint64(32)) & part)
                normal = (float(total + (bits >> np.uint64(48))) - 131070.0) / 37837.0
                value += normal * math.sqrt(max(value, 0.0) * _FULL_WELL + _READ_NOISE * _READ_NOISE) / _FULL_WELL
                place = math.sqrt(min(max(value, 0.0), 8.0) / 8.0) * 4095.0
                image[row, column, k] = np.uint8(curve[int(place)] * 255.0 + 0.5)
    return image
