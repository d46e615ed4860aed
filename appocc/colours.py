"""Colour words: CIELAB conversion, probabilities of colour words, and the exposure of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, check_shape, freeze_arrays, frozen
from appocc.errors import ShapeError
from appocc.srgb import LINEAR_OF_BYTE, linear_from_srgb

# The constants below are fitted to simulated scenes of all weathers and to real vehicles: docs/colours.md.

# The eleven basic colour terms of Berlin and Kay, and silver: one in eight colour words for vehicles.
WORDS = (
    *("black", "grey", "silver", "white"),
    *("red", "orange", "brown", "yellow", "green", "blue", "purple", "pink"),
)
# Other colour words and their nearest term.
_NEAREST_TERM = {"maroon": "red", "navy": "blue", "turquoise": "blue", "violet": "purple", "gold": "yellow"}
# Pale paints between the terms: CIELAB, and its standard deviations.
_PALE = {"beige": (80.0, 2.0, 16.0), "tan": (66.0, 7.0, 24.0)}
_PALE_SPREAD = (10.0, 6.0, 9.0)
# Linear sRGB to XYZ (IEC 61966-2-1), and the white point D65 of the 2 degree observer (CIE 15). These and the two
# constants of the linear part near black are rounded as in scikit-image, so that both give the same results.
_XYZ_FROM_RGB = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
LUMINANCE = _XYZ_FROM_RGB[1]  # weights of linear red, green and blue
_WHITE_XYZ = np.array([0.95047, 1.0, 1.08883])
_STRAIGHT_BELOW, _STRAIGHT_SLOPE = 0.008856, 7.787

# Achromatic paints: share of vehicles, lightness L* and its standard deviation; black extends to L* = 0.
_GREYS = {
    "black": (0.22, 21.0, 11.0),
    "grey": (0.20, 41.0, 7.0),
    "silver": (0.16, 71.0, 6.0),
    "white": (0.31, 92.0, 9.0),
}
_SHARE, _LIGHTNESS, _SPREAD = (np.array(column) for column in zip(*_GREYS.values(), strict=True))
# Factor on deviations above white, because little is brighter than white.
_BEYOND_WHITE = 0.55
# Share of all other vehicles, and the range of L* that they are uniform over.
_OTHERS_SHARE, _OTHERS_SPREAD = 0.11, 24.0
# P(word | paint) of black, grey, silver, white paints (rows): grey and silver are often confused.
_WORD_GIVEN_PAINT = np.array(
    [[0.94, 0.05, 0.01, 0.00], [0.09, 0.78, 0.12, 0.01], [0.01, 0.17, 0.74, 0.08], [0.00, 0.02, 0.09, 0.89]]
)
# Hue angle in degrees (centre, spread) of chromatic words; brown is a dark orange, pink a light red.
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
# Chroma C* at which chromatic and achromatic words are equally likely: a minimum, a slope in L* above a lightness, an
# increment for blue, because the sky tints dark paint; and the exponent of the transition.
_CHROMA_LEAST, _CHROMA_RISE, _CHROMA_FROM, _CHROMA_SKY, _CHROMA_POWER = 3.0, 0.28, 28.0, 7.6, 2.5
_SKY_HUE_DEG = 270.0
# Share of uniform probability: two people agree on the colour of a vehicle 84 % of the time.
_DOUBT = 0.03
# Light of the sky reflected by varnish, as a share of white, and the standard deviation of L* in a scene.
_VEIL, _BLUR = 0.2, 14.0


def lab_from_rgb(rgb: ArrayLike) -> FloatArray:
    """Convert sRGB colours (..., 3) in 0..255 to CIELAB (..., 3) under D65, fastest for bytes; NaN stays NaN."""
    return _lab_from_linear(linear_from_srgb(rgb))


def _lab_from_linear(linear: FloatArray) -> FloatArray:
    ratio = linear @ (_XYZ_FROM_RGB.T / _WHITE_XYZ)
    f = np.where(ratio > _STRAIGHT_BELOW, np.cbrt(ratio), ratio * _STRAIGHT_SLOPE + 16 / 116)
    x, y, z = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


@dataclass(frozen=True, eq=False)
class Exposure:
    """Effect of the light of a scene on colours, and its uncertainty.

    Attributes:
        gain: (3,) factors of linear red, green and blue from the scene to neutral daylight.
        veil: light of the sky reflected by varnish, as a share of white; it is subtracted.
        blur: standard deviation of L* due to uneven light.
    """

    gain: FloatArray
    veil: float = _VEIL
    blur: float = _BLUR

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ShapeError: if the gains are not three positive numbers, or veil or blur is negative or not finite.
        """
        check_shape("exposure gain", self.gain, (3,))
        if not all(0 < factor < np.inf for factor in self.gain.tolist()):
            raise ShapeError(f"exposure gain: expected positive factors, got {self.gain.tolist()}")
        if not (0 <= self.veil < np.inf and 0 <= self.blur < np.inf):
            raise ShapeError(f"exposure: expected veil and blur of 0 or more, got {self.veil} and {self.blur}")
        freeze_arrays(self, "gain")

    def lab(self, rgb: ArrayLike) -> FloatArray:
        """Return CIELAB (..., 3) in neutral daylight of sRGB colours (..., 3) in 0..255."""
        linear = linear_from_srgb(rgb) * self.gain
        luminance = (linear @ LUMINANCE)[..., None]
        return _lab_from_linear(np.minimum(linear * _unveiling(luminance, self.veil), 1.2))


def _unveiling(luminance: FloatArray, veil: float) -> FloatArray:
    """Return the factors that remove a veil: dark colours lose most of their light, white loses none."""
    return np.asarray((1 + veil) * luminance / (luminance + veil + 1e-12))


# Paint without reflections, in known light.
DAYLIGHT = Exposure(np.ones(3), veil=0.0, blur=6.0)


def word_probabilities(rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> FloatArray:
    """Return P(word | colour) (..., 12), in the order of `WORDS`, of sRGB colours (..., 3) in 0..255.

    Rows sum to 1; NaN stays NaN.
    """
    return _probabilities(exposure.lab(rgb), exposure.blur)


def _probabilities(lab: FloatArray, blur: float) -> FloatArray:
    lightness, chroma = lab[..., 0], np.hypot(lab[..., 1], lab[..., 2])
    hue_deg = np.degrees(np.arctan2(lab[..., 2], lab[..., 1]))
    sky = _CHROMA_SKY * np.maximum(np.cos(np.radians(hue_deg - _SKY_HUE_DEG)), 0) * np.maximum(1 - lightness / 100, 0)
    neutral = np.maximum(_CHROMA_RISE * (lightness - _CHROMA_FROM), _CHROMA_LEAST) + sky
    chromatic = 1 / (1 + (neutral / np.maximum(chroma, 1e-6)) ** _CHROMA_POWER)
    shares = _shares(_grey_words(lightness, blur)) @ _WORD_GIVEN_PAINT * (1 - chromatic)[..., None]
    shares = np.concatenate([shares, _shares(_hue_words(lightness, chroma, hue_deg)) * chromatic[..., None]], axis=-1)
    return np.asarray((1 - _DOUBT) * shares + _DOUBT / len(WORDS))


def _shares(weights: FloatArray) -> FloatArray:
    return np.asarray((weights + 1e-9) / (weights + 1e-9).sum(axis=-1, keepdims=True))


def _grey_words(lightness: FloatArray, blur: float) -> FloatArray:
    """Return the densities (..., 4) of black, grey, silver and white vehicles at a lightness."""
    spread = np.hypot(_SPREAD, blur)
    off = (lightness[..., None] - _LIGHTNESS) / spread
    off[..., 0] = np.maximum(off[..., 0], 0)
    off[..., 3] = np.where(off[..., 3] > 0, _BEYOND_WHITE * off[..., 3], off[..., 3])
    return np.asarray(_SHARE / spread * np.exp(-0.5 * off**2))


def _hue_words(lightness: FloatArray, chroma: FloatArray, hue_deg: FloatArray) -> FloatArray:
    """Return the weights (..., 8) of the words from red to pink."""
    bells = []
    for centre, spread in _HUE.values():
        off = (hue_deg - centre + 180) % 360 - 180
        bells.append(np.exp(-0.5 * (off / spread) ** 2))
    weights = dict(zip(_HUE, bells, strict=True))
    bright = 1 / (1 + np.exp(-(lightness - 48) / 8))
    weights["orange"] = weights["orange"] * bright
    pale = np.clip((60 - chroma) / 20, 0, 1)
    weights["brown"] = weights["brown"] * pale * (1 - bright * np.clip((chroma - 15) / 20, 0, 1))
    weights["pink"] = weights["pink"] * 1 / (1 + np.exp(-(lightness - 60) / 4))
    return np.stack(list(weights.values()), axis=-1)


@lru_cache(maxsize=8)
def _most(blur: float) -> FloatArray:
    """Return the maximum (12,) of the probability of each word over all colours."""
    lightness, chroma, hue = np.meshgrid(
        np.arange(0, 101, 2.0), np.arange(0, 101, 10.0), np.radians(range(0, 360, 5))
    )
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1).reshape(-1, 3)
    most = _probabilities(lab, blur).max(axis=0)
    frozen(most)
    return np.asarray(most)


def fit(colour: str, rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> FloatArray:
    """Return how well a colour word fits sRGB colours (..., 3) in 0..255, in (0, 1]; NaN stays NaN.

    1 is the colour that the word fits best. The word may have "dark" or "light" before it, or be one of them alone.
    """
    *shade, term = colour.split()
    shades = [*shade, term] if term in ("dark", "light") else shade
    lab = exposure.lab(rgb)
    result = lab[..., 0] * 0 + 1
    if term in _PALE:
        spread = np.hypot(_PALE_SPREAD, (exposure.blur, 0.0, 0.0))
        result = np.exp(-0.5 * (((lab - _PALE[term]) / spread) ** 2).sum(axis=-1))
    elif term not in ("dark", "light"):
        index = WORDS.index(_NEAREST_TERM.get(term, term))
        result = np.minimum(_probabilities(lab, exposure.blur)[..., index] / _most(exposure.blur)[index], 1)
    for word in shades:
        sign = 1 if word == "light" else -1
        result = result / (1 + np.exp(-sign * (lab[..., 0] - 45) / 6))
    return np.asarray(result)


def name(rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> str:
    """Return the most probable word of an sRGB colour (3,), with the second one if it is close: "grey or silver"."""
    return names(np.asarray(rgb)[None], exposure)[0]


def names(rgb: ArrayLike, exposure: Exposure = DAYLIGHT) -> tuple[str, ...]:
    """Return the words of colours (N, 3), as `name`; '' for NaN."""
    probabilities = word_probabilities(rgb, exposure)
    order = np.argsort(probabilities, axis=-1)[:, ::-1][:, :2]
    one, other = np.take_along_axis(probabilities, order, axis=-1).T
    return tuple(
        "" if np.isnan(best) else f"{WORDS[first]} or {WORDS[second]}" if close else WORDS[first]
        for (first, second), best, close in zip(order.tolist(), one, (other > 0.6 * one).tolist(), strict=True)
    )


# Exposure of a scene, from its vehicles and its road ---------------------------------------------------------------

# Luminance of asphalt relative to white paint, in stops, and its standard deviation; that of light without asphalt.
_ROAD_STOPS, _ROAD_SPREAD, _ANY_SPREAD = -1.6, 1.2, 2.0
# Vehicles in one place are correlated: more than this number add no evidence.
_MOST_VEHICLES = 30
_STOPS = np.linspace(-6.0, 6.0, 49)
# Vehicles whose log channels differ from the asphalt by less may be achromatic and show the colour of the light; this
# number of vehicles has the same weight as the asphalt.
_HUELESS, _AS_MUCH_AS_ROAD = 0.4, 4.0
# The ground next to a vehicle is in the same light, but its material varies: weight of the local light, number of
# samples for half of this weight, and where it is sampled, outward from the sides and along them.
_BESIDE_SHARE, _BESIDE_PLACES = 0.6, 5.0
_BESIDE_M, _BESIDE_ALONG = (0.5, 1.0), np.linspace(0.08, 0.92, 4)
# Stride of the cells for the colour of the road, and their minimum number.
_EVERY, _LEAST_ROAD = 2, 25
# Minimum light, above the noise.
_DIMMEST = 1e-3
_LOGARITHM_OF_BYTE = np.log(LINEAR_OF_BYTE + _DIMMEST)


def exposure_of(bev: BEVMap, vehicles_rgb: FloatArray) -> Exposure:
    """Estimate the exposure of a map from its road and sRGB colours (N, 3) of its vehicles, 0..255, NaN if unknown.

    Asphalt and most vehicles are grey, which gives the colour of the light. Its intensity maximises the likelihood of
    the vehicles, given the shares of black, grey, silver and white ones, and of the brightness of the asphalt.
    """
    return _exposure(_asphalt(bev, _road_of(bev)), linear_from_srgb(vehicles_rgb))


def exposures_of(bev: BEVMap, vehicles_rgb: FloatArray, footprints_m: FloatArray) -> tuple[Exposure, ...]:
    """Estimate the exposure of a map at each of its vehicles, as `gains_of`.

    Raises:
        ShapeError: if the shapes of the arrays do not match.
    """
    return tuple(Exposure(gain) for gain in gains_of(bev, vehicles_rgb, footprints_m))


def gains_of(bev: BEVMap, vehicles_rgb: FloatArray, footprints_m: FloatArray) -> FloatArray:
    """Estimate gains (N, 3) at each vehicle of a map: the road next to it shows shade, sun and lamps.

    Args:
        bev: the map.
        vehicles_rgb: (N, 3) sRGB colours, 0..255, NaN where unknown.
        footprints_m: (N, 4, 2) corners in the ego frame, in order around the vehicle.

    Raises:
        ShapeError: if the shapes of the arrays do not match.
    """
    check_shape("vehicles_rgb", vehicles_rgb, (None, 3))
    check_shape("footprints_m", footprints_m, (len(vehicles_rgb), 4, 2))
    if not len(vehicles_rgb):
        return np.zeros((0, 3))
    where = _road_of(bev)
    road = _asphalt(bev, where)
    local = np.ones((len(vehicles_rgb), 3)) if road is None else _beside(bev, where, road, footprints_m)
    return _exposure(road, linear_from_srgb(vehicles_rgb) * local).gain * local


def _road_of(bev: BEVMap) -> BoolArray:
    """Return (X, Y) bool: road with a known colour and without a vehicle."""
    return np.asarray(bev.appearance_valid & bev.on[ROAD] & ~bev.on[VEHICLE])


def _asphalt(bev: BEVMap, where: BoolArray) -> FloatArray | None:
    """Return the median linear light (3,) of the road (X, Y); None if there is too little road."""
    sparse = where[::_EVERY, ::_EVERY]
    if np.count_nonzero(sparse) < _LEAST_ROAD:
        return None
    median = np.median(bev.appearance[:, ::_EVERY, ::_EVERY][:, sparse], axis=1)
    return np.asarray(LINEAR_OF_BYTE[median.astype(np.uint8)] + _DIMMEST)


def _beside(bev: BEVMap, where: BoolArray, road: FloatArray, footprints_m: FloatArray) -> FloatArray:
    """Return the factors (N, 3) from the light next to each vehicle to that of the whole road (3,)."""
    following = np.roll(footprints_m, -1, axis=1)
    outwards = (footprints_m + following) / 2 - footprints_m.mean(axis=1, keepdims=True)
    outwards = outwards / np.maximum(np.linalg.norm(outwards, axis=-1, keepdims=True), 1e-9)
    sides = footprints_m[:, :, None] + _BESIDE_ALONG[:, None] * (following - footprints_m)[:, :, None]
    places = np.stack([sides + off_m * outwards[:, :, None] for off_m in _BESIDE_M], axis=1)
    cells = bev.grid.cell_of(places.reshape(len(footprints_m), -1, 2))
    inside = bev.grid.contains(cells)
    x, y = np.moveaxis(np.where(inside[..., None], cells, 0), -1, 0)
    seen = inside & where[x, y]
    stronger = np.where(seen, _LOGARITHM_OF_BYTE[bev.appearance[:, x, y]] - np.log(road)[:, None, None], 0)
    count = seen.sum(axis=1)
    trust = _BESIDE_SHARE * count / (count + _BESIDE_PLACES)
    return np.asarray(np.exp(-trust * stronger.sum(axis=2) / np.maximum(count, 1)).T)


def _exposure(road: FloatArray | None, vehicles: FloatArray) -> Exposure:
    """Estimate the exposure from linear colours (3,) of the road and (N, 3) of vehicles."""
    vehicles = vehicles[np.isfinite(vehicles).all(axis=1)]
    tint = _tint(road, vehicles)
    stops = _STOPS[:, None]
    luminance = np.maximum(vehicles / tint @ LUMINANCE, 1e-5) * 2.0**stops
    lightness = 116 * np.cbrt(luminance * _unveiling(luminance, _VEIL)) - 16
    likely = _grey_words(lightness, _BLUR).sum(axis=-1) + _OTHERS_SHARE / _OTHERS_SPREAD
    trust = min(1.0, _MOST_VEHICLES / max(len(vehicles), 1))
    score = trust * np.log(likely).sum(axis=1) - 0.5 * (_STOPS / _ANY_SPREAD) ** 2
    if road is not None:
        score = score - 0.5 * ((np.log2(road @ LUMINANCE) + _STOPS - _ROAD_STOPS) / _ROAD_SPREAD) ** 2
    weight = np.exp(score - score.max())
    return Exposure(2.0 ** float(weight @ _STOPS / weight.sum()) / tint)


def _tint(road: FloatArray | None, vehicles: FloatArray) -> FloatArray:
    """Return the colour (3,) of the light, luminance about 1, from the road and from achromatic vehicles."""
    of_road = _hue_alone(np.ones(3) if road is None else road)
    of_vehicles = _hue_alone(vehicles + _DIMMEST)
    of_vehicles = of_vehicles[(np.abs(of_vehicles - of_road) < _HUELESS).all(axis=1)]
    if not len(of_vehicles):
        return np.asarray(np.exp(of_road))
    share = len(of_vehicles) / (len(of_vehicles) + _AS_MUCH_AS_ROAD)
    return np.asarray(np.exp((1 - share) * of_road + share * np.median(of_vehicles, axis=0)))


def _hue_alone(linear: FloatArray) -> FloatArray:
    """Return the logarithms of linear colours (..., 3) without their brightness."""
    logarithms = np.log(linear)
    return np.asarray(logarithms - (logarithms @ LUMINANCE)[..., None])
