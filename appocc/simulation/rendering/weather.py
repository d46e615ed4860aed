"""Weathers: where the sun stands, what the sky looks like, how wet the street is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from appocc.errors import NotFoundError

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Weather:
    """Light and air of a scene; colours are linear RGB, strengths such that a white sheet in that light shows them.

    Attributes:
        name: one of `WEATHERS`.
        sun_azimuth_rad: direction to the sun in the town frame, counter-clockwise from +x.
        sun_elevation_rad: above the horizon.
        sun: light of the sun on a sheet that faces it; zero where it does not get through.
        zenith: radiance of the sky overhead.
        horizon: radiance of the sky and of the haze at the horizon.
        cloudiness: share of the sky under clouds.
        haze_per_m: share of the light that a metre of air takes away.
        wetness: 0 dry .. 1 puddles.
        lamps: whether street lamps and the lamps of vehicles are on.
        white: gains of the cameras' white balance.
        exposure_stops: brighter (+) or darker (-) than the cameras would choose.
    """

    name: str
    sun_azimuth_rad: float
    sun_elevation_rad: float
    sun: Colour
    zenith: Colour
    horizon: Colour
    cloudiness: float
    haze_per_m: float
    wetness: float = 0.0
    lamps: bool = False
    white: Colour = (1.0, 1.0, 1.0)
    exposure_stops: float = 0.0


_SUN_AZIMUTH_RAD = 3.9
WEATHERS: Mapping[str, Weather] = MappingProxyType(
    {
        weather.name: weather
        for weather in (
            Weather(
                "clear", _SUN_AZIMUTH_RAD, 0.80, (3.0, 2.85, 2.6), (0.16, 0.32, 0.75), (0.62, 0.76, 0.95), 0.35, 0.0008
            ),
            Weather(
                "overcast", _SUN_AZIMUTH_RAD, 0.9, (0.0, 0.0, 0.0), (0.80, 0.84, 0.90), (0.66, 0.70, 0.75), 1.0, 0.0025
            ),
            Weather(
                "low_sun",
                _SUN_AZIMUTH_RAD,
                0.19,
                (2.4, 1.55, 0.85),
                (0.20, 0.30, 0.52),
                (0.95, 0.72, 0.50),
                0.25,
                0.0022,
                white=(0.95, 1.0, 1.12),
            ),
            Weather(
                "dusk",
                _SUN_AZIMUTH_RAD,
                -0.05,
                (0.0, 0.0, 0.0),
                (0.055, 0.085, 0.19),
                (0.30, 0.20, 0.19),
                0.4,
                0.0018,
                lamps=True,
                exposure_stops=-0.5,
            ),
            Weather(
                "night",
                _SUN_AZIMUTH_RAD,
                -0.6,
                (0.0, 0.0, 0.0),
                (0.0035, 0.005, 0.010),
                (0.016, 0.013, 0.013),
                0.5,
                0.0015,
                lamps=True,
                white=(0.88, 1.0, 1.2),
                exposure_stops=-1.2,
            ),
            Weather(
                "wet",
                _SUN_AZIMUTH_RAD,
                0.7,
                (0.0, 0.0, 0.0),
                (0.48, 0.52, 0.58),
                (0.42, 0.45, 0.49),
                1.0,
                0.005,
                wetness=1.0,
                lamps=True,
                exposure_stops=-0.3,
            ),
        )
    }
)


def drawn(name: str, rng: np.random.Generator) -> Weather:
    """A weather of that name with another direction of the sun, haze and strength.

    Raises:
        NotFoundError: if there is no such weather.
    """
    if name not in WEATHERS:
        raise NotFoundError(f"there is no weather '{name}'; there are {', '.join(WEATHERS)}")
    weather = WEATHERS[name]
    azimuth, height, haze, sun, clouds = rng.uniform([-np.pi, 0.85, 0.7, 0.85, 0.7], [np.pi, 1.15, 1.4, 1.1, 1.3])
    return replace(
        weather,
        sun_azimuth_rad=float(azimuth),
        sun_elevation_rad=weather.sun_elevation_rad * float(height),
        sun=(weather.sun[0] * float(sun), weather.sun[1] * float(sun), weather.sun[2] * float(sun)),
        haze_per_m=weather.haze_per_m * float(haze),
        cloudiness=min(weather.cloudiness * float(clouds), 1.0),
    )
