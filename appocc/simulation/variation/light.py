"""Random variation of a weather's light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.rendering.weather import Colour, Weather

# Standard deviations of logarithms: brightness of sun and sky, their colour, and white balance.
_BRIGHTNESS, _HUE, _WHITE = 0.35, 0.06, 0.04
_ELEVATION, _HAZE, _CLOUDS = (0.6, 1.4), (0.5, 3.0), (0.3, 1.8)
_EXPOSURE_STOPS = 0.6


def vary_weather(weather: Weather, random: np.random.Generator) -> Weather:
    """Return a weather with other ratios of sun to sky, colours of light, clouds, haze, exposure, white balance."""
    height, haze, clouds, stops = random.uniform(
        [_ELEVATION[0], np.log(_HAZE[0]), _CLOUDS[0], -_EXPOSURE_STOPS],
        [_ELEVATION[1], np.log(_HAZE[1]), _CLOUDS[1], _EXPOSURE_STOPS],
    )
    sky = _gains(random, _BRIGHTNESS, _HUE)
    return replace(
        weather,
        sun_elevation_rad=weather.sun_elevation_rad * float(height),
        sun=_times(weather.sun, _gains(random, _BRIGHTNESS, _HUE)),
        zenith=_times(weather.zenith, sky),
        horizon=_times(weather.horizon, sky * _gains(random, 0.0, _HUE)),
        cloudiness=min(weather.cloudiness * float(clouds), 1.0),
        haze_per_m=weather.haze_per_m * float(np.exp(haze)),
        white=_times(weather.white, _gains(random, 0.0, _WHITE)),
        exposure_stops=weather.exposure_stops + float(stops),
    )


def _gains(random: np.random.Generator, brightness: float, hue: float) -> FloatArray:
    """Draw (3,) factors of linear light; no deviation is beyond two standard deviations."""
    drawn = np.clip(random.normal(size=4), -2, 2)
    return np.asarray(np.exp(brightness * drawn[0] + hue * drawn[1:]))


def _times(colour: Colour, gains: FloatArray) -> Colour:
    red, green, blue = (float(value * gain) for value, gain in zip(colour, gains, strict=True))
    return red, green, blue
