"""A periodic noise tile for clouds, wear and leaves, and integer hashes."""

from __future__ import annotations

import numpy as np

from appocc.checks import Float32Array
from appocc.simulation.rendering.compiled import inlined

TILE = 256


def noise_tile(seed: int) -> Float32Array:
    """Return (TILE, TILE) float32 noise: periodic, 1/f spectrum, uniformly distributed in 0..1.

    Uniform values make thresholds shares: clouds where the noise exceeds 0.7 cover 30 % of the sky.
    """
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(TILE)[:, None], np.fft.rfftfreq(TILE)[None])
    frequency[0, 0] = 1.0
    phase = np.exp(2j * np.pi * rng.random(frequency.shape))
    values = np.fft.irfft2(phase / frequency**1.5, s=(TILE, TILE)).ravel()
    rank = np.empty(values.size, np.float32)
    rank[np.argsort(values, kind="stable")] = np.arange(values.size, dtype=np.float32) / values.size
    return rank.reshape(TILE, TILE)


@inlined
def noise(tile: Float32Array, x: float, y: float) -> float:
    """Interpolate the tile bilinearly at (x, y) in cells of the tile."""
    left, low = np.floor(x), np.floor(y)
    column, row = int(left) & (TILE - 1), int(low) & (TILE - 1)
    right, high = (column + 1) & (TILE - 1), (row + 1) & (TILE - 1)
    a, b = x - left, y - low
    first = tile[row, column] * (1 - a) + tile[row, right] * a
    second = tile[high, column] * (1 - a) + tile[high, right] * a
    value: float = first * (1 - b) + second * b
    return value


@inlined
def hash_unit(a: int, b: int) -> float:
    """Hash two integers to 0..1; do not pass constants: each would compile another variant."""
    h = np.uint32(a) * np.uint32(0x9E3779B1) ^ np.uint32(b) * np.uint32(0x85EBCA77)
    h = np.uint32(h ^ (h >> np.uint32(15))) * np.uint32(0x2C1B3C6D)
    h = np.uint32(h ^ (h >> np.uint32(12))) * np.uint32(0x297A2D39)
    return np.uint32(h ^ (h >> np.uint32(15))) * 2.3283064365386963e-10
