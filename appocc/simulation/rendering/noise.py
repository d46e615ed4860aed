"""A tile of smooth random numbers from which clouds, wear and leaves are drawn."""

from __future__ import annotations

import numpy as np

from appocc.checks import Float32Array
from appocc.simulation.rendering.compiled import inner

TILE = 256


def noise_tile(seed: int) -> Float32Array:
    """(TILE, TILE) float32, periodic, all scales (1/f), every value of 0..1 equally often.

    Even shares make thresholds mean what they say: clouds where the noise exceeds 0.7 cover 30 % of the sky.
    """
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(TILE)[:, None], np.fft.rfftfreq(TILE)[None])
    frequency[0, 0] = 1.0
    phase = np.exp(2j * np.pi * rng.random(frequency.shape))
    values = np.fft.irfft2(phase / frequency**1.5, s=(TILE, TILE)).ravel()
    rank = np.empty(values.size, np.float32)
    rank[np.argsort(values, kind="stable")] = np.arange(values.size, dtype=np.float32) / values.size
    return rank.reshape(TILE, TILE)


@inner
def noise(tile: Float32Array, x: float, y: float) -> float:
    """The tile's value at (x, y) in cells of the tile, between cells straight."""
    left, low = np.floor(x), np.floor(y)
    column, row = int(left) & (TILE - 1), int(low) & (TILE - 1)
    right, high = (column + 1) & (TILE - 1), (row + 1) & (TILE - 1)
    a, b = x - left, y - low
    first = tile[row, column] * (1 - a) + tile[row, right] * a
    second = tile[high, column] * (1 - a) + tile[high, right] * a
    value: float = first * (1 - b) + second * b
    return value


@inner
def hashed(a: int, b: int) -> float:
    """A number in 0..1 that belongs to two whole numbers; not constants, for each of which it would be compiled."""
    h = np.uint32(a) * np.uint32(0x9E3779B1) ^ np.uint32(b) * np.uint32(0x85EBCA77)
    h = np.uint32(h ^ (h >> np.uint32(15))) * np.uint32(0x2C1B3C6D)
    h = np.uint32(h ^ (h >> np.uint32(12))) * np.uint32(0x297A2D39)
    return np.uint32(h ^ (h >> np.uint32(15))) * 2.3283064365386963e-10
