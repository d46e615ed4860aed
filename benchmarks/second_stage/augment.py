"""Augmentation of examples of the second stage, so that it knows vehicles by their shape and not by their pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator

from appocc.checks import Float32Array, FloatArray, IntArray
from appocc.training.batches.packed_objects import RGB, XY, YAW
from benchmarks.second_stage.examples import Examples

# Share of the examples that each change is applied to, and of those without the predicted direction, so that the
# network looks at the image.
_MIRRORED, _TONED, _RECOLOURED, _MOVED, _ERASED, _UNTOLD = 0.5, 0.6, 0.5, 0.3, 0.3, 0.3
# Tone: logarithms of gamma, of the gain of all channels, and of each (standard deviation).
_GAMMA, _GAIN, _CHANNEL = 0.35, (-0.4, 0.3), 0.12
_MOST_MOVED_PX, _ERASED_PX = 3, (6, 16)


def augmented(examples: Examples, rng: Generator) -> Examples:
    """Return augmented copies of examples."""
    number = len(examples.score)
    mirrored, toned, recoloured, moved, erased, untold = (
        np.flatnonzero(rng.random(number) < share)
        for share in (_MIRRORED, _TONED, _RECOLOURED, _MOVED, _ERASED, _UNTOLD)
    )
    changed = Examples._make(array.copy() for array in examples)
    _mirror(changed, mirrored)
    _tone(changed, toned, rng)
    for one in recoloured.tolist():
        changed.rgb[one] = np.rint(255 * _recolour(changed.rgb[one].astype(np.float32) / 255, rng))
    changed.truth[recoloured, RGB] = np.nan
    for one in moved.tolist():
        shift = rng.integers(-_MOST_MOVED_PX, _MOST_MOVED_PX + 1, 2)
        changed.rgb[one] = np.roll(changed.rgb[one], shift, axis=(0, 1))
    for one in erased.tolist():
        high, wide = rng.integers(*_ERASED_PX, 2)
        top, left = rng.integers(0, np.array(changed.rgb.shape[1:3]) - [high, wide])
        changed.rgb[one, top : top + high, left : left + wide] = rng.integers(0, 256, 3)
    changed.away[untold] = 0
    return changed


def _mirror(examples: Examples, chosen: IntArray) -> None:
    """Mirror examples at the line of sight ahead, in place."""
    examples.rgb[chosen] = examples.rgb[chosen, :, ::-1]
    examples.visible[chosen] = examples.visible[chosen, :, ::-1]
    examples.place[chosen] = examples.place[chosen, :, ::-1] * np.array([1, -1, 1], np.int8)
    examples.centre_m[chosen, 1] *= -1
    examples.yaw_rad[chosen] *= -1
    examples.truth[chosen, XY.start + 1] *= -1
    examples.truth[chosen, YAW] *= -1


def _tone(examples: Examples, chosen: IntArray, rng: Generator) -> None:
    """Change gamma and gains of all colours of examples alike, in place: the paint changes with its image."""
    count = len(chosen)
    gamma = np.exp(rng.uniform(-_GAMMA, _GAMMA, (count, 1)))
    gain = np.exp(rng.normal(0, _CHANNEL, (count, 3)) + rng.uniform(*_GAIN, (count, 1)))

    def toned(colours: FloatArray) -> FloatArray:
        wide = tuple(range(1, colours.ndim - 1))
        changed = (colours / 255) ** np.expand_dims(gamma, wide) * np.expand_dims(gain, wide)
        return np.asarray(255 * np.minimum(changed, 1.0))

    examples.rgb[chosen] = np.rint(toned(examples.rgb[chosen].astype(np.float64)))
    examples.light[chosen], examples.paint[chosen] = toned(examples.light[chosen]), toned(examples.paint[chosen])
    examples.truth[chosen, RGB] = toned(examples.truth[chosen, RGB].astype(np.float64))


def _recolour(crop: Float32Array, rng: Generator) -> FloatArray:
    """Return a crop (H, W, 3), 0..1, in other colours: channels mixed, gamma, contrast, blur, noise, uneven light."""
    high, wide = crop.shape[:2]
    mix = np.eye(3) + 0.5 * rng.standard_normal((3, 3))
    mix = np.full((3, 3), 1 / 3) if rng.random() < 0.3 else mix / np.maximum(mix.sum(axis=1, keepdims=True), 0.3)
    mixed = np.clip(crop @ mix.T, 1e-3, 1) ** np.exp(rng.uniform(-0.7, 0.7))
    mean = mixed.mean()
    mixed = (mixed - mean) * np.exp(rng.uniform(-0.6, 0.6)) + mean + 0.15 * rng.standard_normal()
    if rng.random() < 0.3:
        half = cv2.resize(mixed, (wide // 2, high // 2), interpolation=cv2.INTER_AREA)
        mixed = cv2.resize(half, (wide, high), interpolation=cv2.INTER_LINEAR)
    noise = 0.05 * rng.random() * rng.standard_normal(crop.shape)
    patches = 0.12 * rng.random() * rng.standard_normal((4, 6, 3))
    light = cv2.resize(patches, (wide, high), interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.clip(mixed + noise + light, 0, 1), np.float64)
