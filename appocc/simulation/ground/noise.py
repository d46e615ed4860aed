"""Smooth noise: random values on lattices of several sizes, added up; tiles that repeat without a seam."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.checks import Float32Array


def value_noise(
    random: np.random.Generator, shape: tuple[int, int], grains: tuple[int, ...], weights: tuple[float, ...]
) -> Float32Array:
    """(H, W) float32 noise of mean about 0 and deviation about 1.

    Args:
        random: what it is drawn from.
        shape: rows and columns.
        grains: cells between the lattice's points, one for each layer.
        weights: of the layers.
    """
    height, width = shape
    total = np.zeros(shape, np.float32)
    for grain, weight in zip(grains, weights, strict=True):
        lattice = random.standard_normal((height // grain + 2, width // grain + 2), dtype=np.float32)
        fine = lattice if grain == 1 else cv2.resize(lattice, None, fx=grain, fy=grain, interpolation=cv2.INTER_CUBIC)
        total += weight * np.asarray(fine, dtype=np.float32)[:height, :width]
    return np.asarray(total / total.std())


def tile(random: np.random.Generator, size: int, grains: tuple[int, ...], weights: tuple[float, ...]) -> Float32Array:
    """(size, size) float32 noise that goes on evenly where copies of it meet."""
    rim = size // 8
    noise = value_noise(random, (size + rim, size + rim), grains, weights)
    share = np.linspace(0, 1, rim, endpoint=False, dtype=np.float32)
    # The rim beyond the tile is mixed into its beginning; the weights keep the deviation even.
    for _ in range(2):
        mixed = noise[:rim] * np.sqrt(share)[:, None] + noise[size:] * np.sqrt(1 - share)[:, None]
        noise = np.concatenate([mixed, noise[rim:size]]).T
    return np.ascontiguousarray(noise)
