"""Value noise: random lattices of several sizes, summed; seamlessly tileable variants."""

from __future__ import annotations

import cv2
import numpy as np

from appocc.checks import Float32Array


def value_noise(
    random: np.random.Generator, shape: tuple[int, int], grains: tuple[int, ...], weights: tuple[float, ...]
) -> Float32Array:
    """Return (H, W) float32 noise with a mean of about 0 and a standard deviation of about 1.

    Args:
        random: random generator.
        shape: rows and columns.
        grains: lattice spacing in cells, one per octave.
        weights: weight of each octave.
    """
    height, width = shape
    total = np.zeros(shape, np.float32)
    for grain, weight in zip(grains, weights, strict=True):
        lattice = random.standard_normal((height // grain + 2, width // grain + 2), dtype=np.float32)
        fine = lattice if grain == 1 else cv2.resize(lattice, None, fx=grain, fy=grain, interpolation=cv2.INTER_CUBIC)
        total += weight * np.asarray(fine, dtype=np.float32)[:height, :width]
    return np.asarray(total / total.std())


def tileable_noise(
    random: np.random.Generator, size: int, grains: tuple[int, ...], weights: tuple[float, ...]
) -> Float32Array:
    """Return (size, size) float32 noise that tiles without a seam."""
    rim = size // 8
    noise = value_noise(random, (size + rim, size + rim), grains, weights)
    share = np.linspace(0, 1, rim, endpoint=False, dtype=np.float32)
    # The rim beyond the tile is blended into its beginning; the weights preserve the variance.
    for _ in range(2):
        mixed = noise[:rim] * np.sqrt(share)[:, None] + noise[size:] * np.sqrt(1 - share)[:, None]
        noise = np.concatenate([mixed, noise[rim:size]]).T
    return np.ascontiguousarray(noise)
