"""Paint colour of a vehicle, estimated from all images of a scene that show its bodywork."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.colours import Exposure
from appocc.srgb import linear_from_srgb

# Bodywork is between tyres and windows; shares of the vehicle height.
_BAND = (0.28, 0.62)
_MIN_SAMPLES = 12
# Number of samples per image, and of all images together.
_PER_IMAGE, _PER_VEHICLE = 200, 400
# Quantiles of lightness beyond which a sample is shadow or specular highlight.
_DARKEST, _BRIGHTEST = 0.15, 0.9
# A hue is the paint's if at least a share of the bodywork has this chroma and a hue within this angle. Blue counts
# half: the sky tints grey paint.
_CHROMA, _SHARE, _NEAR_COS, _SKY_TINT = 14.0, 0.25, float(np.cos(np.deg2rad(40))), 0.5
# Lightness counts half, since illumination varies over the body; distance of similar colours.
_SCALE, _ALIKE = np.array([0.5, 1.0, 1.0]), 8.0
# The median of an image maps to middle grey; images darker than this (sRGB) stay dark.
_MIDDLE_GREY, _NIGHT = 0.25, 20.0
_STRIDE_PX = 8


class BodyworkSamples(NamedTuple):
    """Samples of a vehicle in one image.

    Attributes:
        rgb: (N, 3) uint8 colours, corrected for the exposure differences of the cameras.
        lab: (N, 3) CIELAB colours relative to the exposure of the image.
        area_px: image area of the samples.
        body: whether the samples are between tyres and windows; otherwise no such pixel is visible.
    """

    rgb: ByteArray
    lab: FloatArray
    area_px: float
    body: bool


def estimate_exposure(image: ByteArray) -> Exposure:
    """Return the exposure of an image (H, W, 3) that maps its median to middle grey."""
    median = np.median(image[::_STRIDE_PX, ::_STRIDE_PX].reshape(-1, 3), axis=0)
    return Exposure(_MIDDLE_GREY / linear_from_srgb(np.maximum(median, _NIGHT)), veil=0.0)


def extract_bodywork(
    rgb: ByteArray, height: FloatArray, sample_px: float, light: Exposure, gain: FloatArray
) -> BodyworkSamples:
    """Select the bodywork from samples (N, 3) of a vehicle, each at a relative height (N,) in 0..1.

    `sample_px` is the image area of a sample; `gain` (3,) is the exposure gain of the camera.
    """
    band = (height > _BAND[0]) & (height < _BAND[1])
    body = int(np.count_nonzero(band)) >= _MIN_SAMPLES
    rgb = rgb[band] if body else rgb
    area_px = sample_px * len(rgb)
    rgb = rgb[np.unique(np.linspace(0, len(rgb) - 1, _PER_IMAGE).astype(np.int64))]
    evened = np.minimum(np.round(rgb * gain), 255).astype(np.uint8)
    return BodyworkSamples(evened, light.lab(rgb), area_px, body)


def estimate_paint(pictures: Sequence[BodyworkSamples]) -> ByteArray:
    """Return the (3,) sRGB paint colour of a vehicle from one or more images, weighted by area.

    Samples of the paint's hue are kept, shadows and highlights trimmed; the result is the densest remaining colour.
    """
    pictures = [picture for picture in pictures if picture.body] or pictures
    rgb = np.concatenate([picture.rgb for picture in pictures])
    lab = np.concatenate([picture.lab for picture in pictures])
    area = np.cumsum(np.concatenate([np.full(len(p.rgb), p.area_px / len(p.rgb)) for p in pictures]))
    # Resample in proportion to the area.
    even = np.searchsorted(area, (np.arange(_PER_VEHICLE) + 0.5) / _PER_VEHICLE * area[-1])
    even = even[_of_one_hue(lab[even])]
    low, high = np.quantile(lab[even, 0], [_DARKEST, _BRIGHTEST])
    even = even[(lab[even, 0] >= low) & (lab[even, 0] <= high)]
    place = lab[even] * _SCALE / _ALIKE
    norm = (place**2).sum(axis=1)
    squared = norm[:, None] + norm - 2 * place @ place.T
    densest = np.exp(-0.5 * squared).sum(axis=1).argmax()
    return np.asarray(np.round(np.median(rgb[even[squared[densest] < 4.0]], axis=0)), dtype=np.uint8)


def _of_one_hue(lab: FloatArray) -> BoolArray:
    """Return the (N,) mask of colours whose hue at least a quarter of them share; all if there is no such hue.

    Glass, tyres, shadows and chrome are grey and lamps are small: a frequent hue is the hue of the paint.
    """
    red, yellow = lab[:, 1], np.where(lab[:, 2] < 0, _SKY_TINT * lab[:, 2], lab[:, 2])
    chroma = np.hypot(red, yellow)
    strong, kept = np.flatnonzero(chroma > _CHROMA), np.ones(len(lab), dtype=np.bool_)
    if len(strong) > _SHARE * len(lab):
        hue = np.stack([red, yellow], axis=1)[strong] / chroma[strong, None]
        alike = hue @ hue.T > _NEAR_COS
        count = alike.sum(axis=1)
        if count.max() > _SHARE * len(lab):
            kept[:] = False
            kept[strong[alike[count.argmax()]]] = True
    return kept
