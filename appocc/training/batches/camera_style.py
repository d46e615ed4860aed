"""Camera style randomisation: gives images the look of another camera system.

Tone and white balance are shared by the rig and apply to colours of the map too; sharpness, noise, compression,
vignetting and dirt apply to images only. On domain gaps between simulation and real driving: Acuna, Philion and
Fidler, "Towards Optimal Strategies for Training Self-Driving Perception Models in Simulation", NeurIPS 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.random import Generator

from appocc.checks import ByteArray, Float32Array

# Share of the styled samples that each effect is applied to.
_SHARE = 0.4


@dataclass(frozen=True, eq=False)
class CameraStyle:
    """The look of one camera system.

    Attributes:
        tone: (3, 256) uint8, tone curve and white balance of the channels red, green and blue.
        local_contrast: clip limit of adaptive histogram equalisation; 0 is off.
        blur_px: standard deviation of a Gaussian blur.
        sharpening: weight of the unsharp mask.
        median: whether a median filter of 3 x 3 pixels is applied.
        noise: standard deviation of the sensor's noise, on 0..255, at white.
        vignette: share of light that is lost in the corners.
        dirt: number of blurred spots on each lens.
        jpeg_quality: of compression, 1..100; 0 is off.
    """

    tone: ByteArray
    local_contrast: float = 0.0
    blur_px: float = 0.0
    sharpening: float = 0.0
    median: bool = False
    noise: float = 0.0
    vignette: float = 0.0
    dirt: int = 0
    jpeg_quality: int = 0


def draw_style(rng: Generator) -> CameraStyle:
    """Draw a style: random effects of random strengths."""
    tone = _draw_tone(rng)
    on = rng.random(7) < _SHARE
    strength = rng.random(7)
    softened = on[2] and not on[1]  # a camera either softens or sharpens
    return CameraStyle(
        tone,
        local_contrast=1 + 3 * strength[0] if on[0] else 0.0,
        sharpening=2 * strength[1] if on[1] else 0.0,
        blur_px=0.3 + 0.9 * strength[2] if softened else 0.0,
        median=bool(softened and strength[2] > 0.7),
        noise=10 * strength[3] ** 2 if on[3] else 0.0,
        vignette=0.6 * strength[4] if on[4] else 0.0,
        dirt=int(1 + 3 * strength[5]) if on[5] and strength[5] > 0.5 else 0,
        jpeg_quality=int(25 + 60 * strength[6]) if on[6] else 0,
    )


def _draw_tone(rng: Generator) -> ByteArray:
    """Return curves (3, 256): gamma, an S-curve about middle grey, lifted blacks, and a gain for each channel."""
    gamma = np.exp(rng.uniform(-0.5, 0.5))
    bend = rng.uniform(-0.3, 0.6)
    black = rng.uniform(0, 0.08) * (rng.random() < _SHARE)
    gains = np.exp(rng.normal(0, 0.07, (3, 1)))
    x = np.linspace(0, 1, 256) ** gamma
    curve = (1 - bend) * x + bend * (3 * x**2 - 2 * x**3)
    return np.asarray(np.rint(np.clip((black + (1 - black) * curve) * gains, 0, 1) * 255), np.uint8)


def apply_tone(rgb: ByteArray, style: CameraStyle) -> ByteArray:
    """Return colours (..., 3) with the tone of a style."""
    return np.stack([style.tone[channel][rgb[..., channel]] for channel in range(3)], axis=-1)


def apply_style(images: ByteArray, style: CameraStyle, rng: Generator) -> ByteArray:
    """Return images as another camera system takes them.

    Args:
        images: (N, H, W, 3) uint8 sRGB; not written to.
        style: of the whole rig.
        rng: for noise and dirt, which differ from camera to camera.

    Returns:
        (N, H, W, 3) uint8.
    """
    return np.stack([_style_image(image, style, rng) for image in apply_tone(images, style)])


def _style_image(image: ByteArray, style: CameraStyle, rng: Generator) -> ByteArray:
    """Style one image, in the order in which a camera's optics, sensor and processing act."""
    values = image.astype(np.float32)
    if style.dirt:
        values = _add_dirt(values, style.dirt, rng)
    if style.vignette:
        values *= _vignette(values.shape[:2], style.vignette)[..., None]
    if style.blur_px:
        values = _blur(values, style.blur_px)
    if style.noise:  # shot noise grows with the root of the light, over a floor
        values += rng.standard_normal(values.shape, np.float32) * style.noise * np.sqrt(0.1 + 0.9 * values / 255)
    if style.sharpening:
        values += style.sharpening * (values - _blur(values, 1.5))
    result = np.asarray(np.rint(np.clip(values, 0, 255)), np.uint8)
    if style.median:
        result = np.asarray(cv2.medianBlur(result, 3), np.uint8)
    if style.local_contrast:
        result = _equalise(result, style.local_contrast)
    if style.jpeg_quality:
        ok, data = cv2.imencode(".jpg", result, [cv2.IMWRITE_JPEG_QUALITY, style.jpeg_quality])
        result = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8) if ok else result
    return result


def _blur(values: Float32Array, deviation_px: float) -> Float32Array:
    return np.asarray(cv2.GaussianBlur(values, (0, 0), deviation_px), np.float32)


def _add_dirt(values: Float32Array, spots: int, rng: Generator) -> Float32Array:
    """Add spots of dirt or rain on the lens: blurred and greyed areas."""
    high, wide = values.shape[:2]
    mask = np.zeros((high, wide), np.float32)
    for _ in range(spots):
        centre = (int(rng.integers(wide)), int(rng.integers(high)))
        radius = int(rng.integers(max(2, high // 24), max(3, high // 5)))
        cv2.circle(mask, centre, radius, float(rng.uniform(0.4, 1.0)), -1)
    mask = _blur(mask, max(1.0, high / 64))[..., None]
    veil = 0.7 * _blur(values, high / 20) + 0.3 * 110
    return np.asarray(values * (1 - mask) + veil * mask, np.float32)


def _vignette(shape: tuple[int, ...], loss: float) -> Float32Array:
    """Return the transmitted share of light (H, W): 1 in the middle, 1 - loss in the corners."""
    y, x = (np.linspace(-1, 1, n, dtype=np.float32) for n in shape)
    return np.asarray(1 - loss * (y[:, None] ** 2 + x**2) / 2, np.float32)


def _equalise(image: ByteArray, clip: float) -> ByteArray:
    """Raise the local contrast: adaptive histogram equalisation of the lightness (CLAHE)."""
    lab = cv2.cvtColor(image, cv2.COLOR_RGB2LAB)
    lab[..., 0] = cv2.createCLAHE(clip, (4, 8)).apply(lab[..., 0])
    return np.asarray(cv2.cvtColor(lab, cv2.COLOR_LAB2RGB), np.uint8)
