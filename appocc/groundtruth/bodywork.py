"""The colour of a vehicle's paint, of all pictures of a scene that show its bodywork."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.colours import Exposure
from appocc.srgb import linear_from_srgb

# Bodywork lies between tyres and windows, in parts of the height.
_BAND = (0.28, 0.62)
_LEAST_PIXELS = 12
# Samples kept of a picture, and of all pictures together.
_OF_PICTURE, _OF_ALL = 200, 400
# Parts of lightness that are shadow or glint.
_DARKEST, _BRIGHTEST = 0.15, 0.9
# A hue is the paint's from this chroma, where so much of the bodywork is this near to it. Blue counts half: the sky
# tints what is grey.
_CHROMA, _SHARE, _NEAR_COS, _SKY_TINT = 14.0, 0.25, float(np.cos(np.deg2rad(40))), 0.5
# Light and shade fall on one paint: lightness counts half. How near colours are alike.
_SCALE, _ALIKE = np.array([0.5, 1.0, 1.0]), 8.0
# The median of a picture becomes a middle grey; a picture darker than this (sRGB) is not made day.
_MIDDLE_GREY, _NIGHT = 0.25, 20.0
_EVERY_PX = 8


class Bodywork(NamedTuple):
    """Samples of one picture that show a vehicle.

    Attributes:
        rgb: (N, 3) uint8 colours, evened out between cameras.
        lab: (N, 3) the picture's own colours in CIELAB, in the light of the picture.
        area_px: pixels of the image that they stand for.
        body: whether they lie between tyres and windows; else no such pixel was seen.
    """

    rgb: ByteArray
    lab: FloatArray
    area_px: float
    body: bool


def light_of(image: ByteArray) -> Exposure:
    """The light of a picture (H, W, 3): what makes its median a middle grey."""
    median = np.median(image[::_EVERY_PX, ::_EVERY_PX].reshape(-1, 3), axis=0)
    return Exposure(_MIDDLE_GREY / linear_from_srgb(np.maximum(median, _NIGHT)), veil=0.0)


def bodywork(rgb: ByteArray, height: FloatArray, sample_px: float, light: Exposure, gain: FloatArray) -> Bodywork:
    """What samples (N, 3) of a vehicle, each at a height (N,) in 0..1 of it, show of its bodywork.

    `sample_px` is the image area that each stands for; `gain` (3,) evens the camera's colours out with the others'.
    """
    band = (height > _BAND[0]) & (height < _BAND[1])
    body = int(np.count_nonzero(band)) >= _LEAST_PIXELS
    rgb = rgb[band] if body else rgb
    area_px = sample_px * len(rgb)
    rgb = rgb[np.unique(np.linspace(0, len(rgb) - 1, _OF_PICTURE).astype(np.int64))]
    evened = np.minimum(np.round(rgb * gain), 255).astype(np.uint8)
    return Bodywork(evened, light.lab(rgb), area_px, body)


def paint_of(pictures: Sequence[Bodywork]) -> ByteArray:
    """(3,) sRGB colour of a vehicle's paint, of one picture or more, each by its area.

    What has the paint's hue, shadow and glint trimmed, then the densest colour of what is left.
    """
    pictures = [picture for picture in pictures if picture.body] or pictures
    rgb = np.concatenate([picture.rgb for picture in pictures])
    lab = np.concatenate([picture.lab for picture in pictures])
    area = np.cumsum(np.concatenate([np.full(len(p.rgb), p.area_px / len(p.rgb)) for p in pictures]))
    # Each sample as often as is its area.
    even = np.searchsorted(area, (np.arange(_OF_ALL) + 0.5) / _OF_ALL * area[-1])
    even = even[_of_one_hue(lab[even])]
    low, high = np.quantile(lab[even, 0], [_DARKEST, _BRIGHTEST])
    even = even[(lab[even, 0] >= low) & (lab[even, 0] <= high)]
    place = lab[even] * _SCALE / _ALIKE
    apart = ((place[:, None] - place) ** 2).sum(axis=2)
    densest = np.exp(-0.5 * apart).sum(axis=1).argmax()
    return np.asarray(np.round(np.median(rgb[even[apart[densest] < 4.0]], axis=0)), dtype=np.uint8)


def _of_one_hue(lab: FloatArray) -> BoolArray:
    """(N,) which colours have the hue that a quarter of them share; all where there is none.

    Glass, tyres, shadow and chrome are grey, and lamps are small: a hue that much of a vehicle has is its paint's.
    """
    red, yellow = lab[:, 1], np.where(lab[:, 2] < 0, _SKY_TINT * lab[:, 2], lab[:, 2])
    strong = np.hypot(red, yellow) > _CHROMA
    hue = np.arctan2(yellow, red)
    alike = strong & strong[:, None] & (np.cos(hue[:, None] - hue) > _NEAR_COS)
    count = alike.sum(axis=1)
    return alike[count.argmax()] if count.max() > _SHARE * len(lab) else np.ones(len(lab), dtype=np.bool_)
