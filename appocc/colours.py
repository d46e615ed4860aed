"""Colours: CIELAB, and how well words fit, fuzzy in CIELAB; fits are ranked and never made hard labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.checks import FloatArray, check_finite, check_shape, frozen
from appocc.errors import ShapeError

# The eleven basic terms of Berlin and Kay, and silver, which one in eight colour words for vehicles is.
WORDS = (
    *("black", "grey", "silver", "white"),
    *("red", "orange", "brown", "yellow", "green", "blue", "purple", "pink"),
)
# Other words people use, by the term that is nearest.
_NEAREST_TERM = {"beige": "brown", "tan": "brown", "maroon": "red", "navy": "blue", "turquoise": "blue"} | {
    "gold": "yellow",
    "violet": "purple",
}
# Linear sRGB to XYZ (IEC 61966-2-1), and the white point D65 of the 2 degree observer (CIE 15); these and the two
# numbers of the straight part near black are rounded as scikit-image rounds them, so that both give the same.
_XYZ_FROM_RGB = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
_WHITE_XYZ = np.array([0.95047, 1.0, 1.08883])
_STRAIGHT_BELOW, _STRAIGHT_SLOPE = 0.008856, 7.787

# Lightness L* (centre, spread) of the achromatic words; black and white reach on to the ends of the scale.
_LIGHTNESS = {"black": (17.0, 10.0), "grey": (43.0, 14.0), "silver": (69.0, 13.0), "white": (90.0, 11.0)}
# What people say (columns) of paint that looks black, grey, silver, white (rows): to many grey and silver are one.
_SAID_OF_GREYS = np.array(
    [[0.88, 0.10, 0.01, 0.01], [0.10, 0.72, 0.15, 0.03], [0.02, 0.22, 0.63, 0.13], [0.00, 0.03, 0.12, 0.85]]
)
# Hue angle in degrees (centre, spread) of the others; brown and pink lie where orange and red are dark or light.
_HUE = {
    "red": (18.0, 22.0),
    "orange": (60.0, 13.0),
    "brown": (58.0, 22.0),
    "yellow": (97.0, 15.0),
    "green": (155.0, 30.0),
    "blue": (265.0, 30.0),
    "purple": (322.0, 16.0),
    "pink": (358.0, 22.0),
}
# Chroma C* at which a hue is named as often as a grey at L* 0, how it grows with L* (white paint under a blue sky has
# more chroma than a dark blue car), and how sharply names change.
_CHROMA_HALF, _CHROMA_RISE, _CHROMA_STEP = 8.0, 0.1, 2.2
# Two people agree on a vehicle's colour 84 % of the time: no word is ever impossible.
_DOUBT = 0.03


def lab_from_rgb(rgb: ArrayLike) -> FloatArray:
    """CIELAB (..., 3) under D65 of sRGB colours (..., 3) in 0..255, fastest of bytes; NaN of NaN."""
    return _lab_from_linear(linear_from_srgb(rgb))


def linear_from_srgb(rgb: ArrayLike) -> FloatArray:
    """Linear light 0..1 of sRGB values 0..255 of any shape, fastest of bytes; NaN of NaN."""
    values = np.asarray(rgb)
    return _LINEAR_OF_BYTE[values] if values.dtype == np.uint8 else _linear(values.astype(np.float64))


def _linear(values: FloatArray) -> FloatArray:
    share = values / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


_LINEAR_OF_BYTE = _linear(np.arange(256.0))


def _lab_from_linear(linear: FloatArray) -> FloatArray:
    ratio = linear @ (_XYZ_FROM_RGB.T / _WHITE_XYZ)
    f = np.where(ratio > _STRAIGHT_BELOW, np.cbrt(ratio), ratio * _STRAIGHT_SLOPE + 16 / 116)
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


@dataclass(frozen=True)
class Exposure:
    """What the light of a scene does to colours.

    Attributes:
        gain: (3,) factors of linear red, green and blue that bring the scene to neutral daylight.
    """

    gain: FloatArray

    def __post_init__(self) -> None:
        """Check the gains.

        Raises:
            ShapeError: if they are not three positive numbers.
        """
        check_shape("exposure gain", self.gain, (3,))
        check_finite("exposure gain", self.gain)
        if float(self.gain.min()) <= 0:
            raise ShapeError(f"exposure gain: expected positive factors, got {self.gain.tolist()}")
        frozen(self.gain)

    def lab(self, rgb: ArrayLike) -> FloatArray:
        """CIELAB (..., 3) of sRGB colours (..., 3) in 0..255 as they would be in neutral daylight."""
        return _lab_from_linear(np.minimum(linear_from_srgb(rgb) * self.gain, 1.2))


DAYLIGHT = Exposure(np.ones(3))
# Where the brightest vehicles stand in daylight, by linear light: L* 88 is white paint.
_BRIGHT_VEHICLE = 0.72
_MOST_GAIN = 4.0


def exposure_of(bev: BEVMap, vehicles_rgb: FloatArray) -> Exposure:
    """The light of a map: asphalt is grey, and the brightest of several vehicles (N, 3), 0..255, is white.

    Nothing is darkened, nothing brightened beyond two stops. Without road or enough vehicles that part is left out.
    """
    gain = np.ones(3)
    road = bev.appearance_valid & bev.on[ROAD] & ~bev.on[VEHICLE]
    if np.count_nonzero(road) >= 100:
        asphalt = np.median(linear_from_srgb(bev.appearance[:, road].T), axis=0) + 1e-3
        gain = asphalt.mean() / asphalt
    if len(vehicles_rgb) >= 5:
        light = (linear_from_srgb(vehicles_rgb) * gain) @ _XYZ_FROM_RGB[1]
        gain = gain * np.clip(_BRIGHT_VEHICLE / max(float(np.quantile(light, 0.97)), 1e-3), 1.0, _MOST_GAIN)
    return Exposure(gain)


def word_probabilities(rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> FloatArray:
    """P(word | colour) (..., 12) in the order of `WORDS` for sRGB colours (..., 3) in 0..255; rows sum to 1."""
    lab = exposure.lab(rgb)
    lightness, chroma = lab[..., 0], np.hypot(lab[..., 1], lab[..., 2])
    hue_deg = np.degrees(np.arctan2(lab[..., 2], lab[..., 1]))
    chromatic = 1 / (1 + np.exp((_CHROMA_HALF + _CHROMA_RISE * lightness - chroma) / _CHROMA_STEP))
    shares = _shares(_grey_words(lightness)) @ _SAID_OF_GREYS * (1 - chromatic)[..., None]
    shares = np.concatenate([shares, _shares(_hue_words(lightness, chroma, hue_deg)) * chromatic[..., None]], axis=-1)
    return np.asarray((1 - _DOUBT) * shares + _DOUBT / len(WORDS))


def _shares(weights: FloatArray) -> FloatArray:
    return np.asarray((weights + 1e-9) / (weights + 1e-9).sum(axis=-1, keepdims=True))


def _grey_words(lightness: FloatArray) -> FloatArray:
    """(..., 4) weights of black, grey, silver, white."""
    bells = []
    for word, (centre, spread) in _LIGHTNESS.items():
        low, high = (-np.inf if word == "black" else centre), (np.inf if word == "white" else centre)
        off = lightness - np.clip(lightness, low, high)
        bells.append(np.exp(-0.5 * (off / spread) ** 2))
    return np.stack(bells, axis=-1)


def _hue_words(lightness: FloatArray, chroma: FloatArray, hue_deg: FloatArray) -> FloatArray:
    """(..., 8) weights of the words from red to pink."""
    bells = []
    for centre, spread in _HUE.values():
        off = (hue_deg - centre + 180) % 360 - 180
        bells.append(np.exp(-0.5 * (off / spread) ** 2))
    weights = dict(zip(_HUE, bells, strict=True))
    bright = 1 / (1 + np.exp(-(lightness - 52) / 4))
    weights["orange"] = weights["orange"] * bright
    weights["brown"] = weights["brown"] * (1 - bright * np.clip((chroma - 15) / 20, 0, 1))
    weights["pink"] = weights["pink"] * 1 / (1 + np.exp(-(lightness - 60) / 4))
    return np.stack(list(weights.values()), axis=-1)


def fit(colour: str, rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> FloatArray:
    """How well a colour word of a command fits sRGB colours (..., 3) in 0..255, in (0, 1]: P(word) / max P.

    The word may carry "dark" or "light" or be one of them alone.
    """
    *shade, term = colour.split()
    shades = [*shade, term] if term in ("dark", "light") else shade
    probabilities = word_probabilities(rgb, exposure)
    result = np.ones(probabilities.shape[:-1])
    if term not in ("dark", "light"):
        index = WORDS.index(_NEAREST_TERM.get(term, term))
        result = probabilities[..., index] / probabilities.max(axis=-1)
    for word in shades:
        sign = 1 if word == "light" else -1
        result = result / (1 + np.exp(-sign * (exposure.lab(rgb)[..., 0] - 45) / 6))
    return np.asarray(result)


def name(rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> str:
    """The likeliest word of one sRGB colour (3,), for people; the second likeliest beside it where it is close."""
    return names(np.asarray(rgb)[None], exposure)[0]


def names(rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> tuple[str, ...]:
    """The same of N colours (N, 3)."""
    probabilities = word_probabilities(rgb, exposure)
    first, second = np.argsort(probabilities, axis=-1)[:, ::-1][:, :2].T
    rows = np.arange(len(probabilities))
    close = probabilities[rows, second] > 0.6 * probabilities[rows, first]
    return tuple(
        f"{WORDS[one]} or {WORDS[other]}" if both else WORDS[one]
        for one, other, both in zip(first.tolist(), second.tolist(), close.tolist(), strict=True)
    )
