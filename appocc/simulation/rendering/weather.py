"""Weathers: position of the sun, sky, haze and wetness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from appocc.errors import NotFoundError

Colour = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Weather:
    """Light and atmosphere of a scene; linear RGB, scaled such that a white surface has the value of its irradiance.

    Attributes:
        name: one of `WEATHERS`.
        sun_azimuth_rad: direction to the sun in the town frame, counter-clockwise from +x.
        sun_elevation_rad: elevation above the horizon.
        sun: irradiance of a surface that faces the sun; zero if clouds hide it.
        zenith: radiance of the sky overhead.
        horizon: radiance of the sky and of the haze at the horizon.
        cloudiness: share of the sky under clouds.
        haze_per_m: extinction per metre.
        wetness: 0 dry .. 1 puddles.
        lamps: strength of street lamps, vehicle lamps and lit windows; 0 if all are off.
        white: white-balance gains of the cameras.
        exposure_stops: exposure compensation: brighter (+) or darker (-).
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
    lamps: float = 0.0
    white: Colour = (1.0, 1.0, 1.0)
    exposure_stops: float = 0.0


_SUN_AZIMUTH_RAD = 3.9
_SKIES = (
    Weather(
        name="clear",
        sun_azimuth_rad=_SUN_AZIMUTH_RAD,
        sun_elevation_rad=0.80,
        sun=(3.0, 2.85, 2.6),
        zenith=(0.18, 0.36, 0.80),
        horizon=(0.66, 0.80, 0.98),
        cloudiness=0.35,
        haze_per_m=0.0008,
    ),
    Weather(
        name="overcast",
        sun_azimuth_rad=_SUN_AZIMUTH_RAD,
        sun_elevation_rad=0.9,
        sun=(0.0, 0.0, 0.0),
        zenith=(0.82, 0.86, 0.92),
        horizon=(0.68, 0.72, 0.78),
        cloudiness=1.0,
        haze_per_m=0.0018,
        exposure_stops=0.35,
    ),
    Weather(
        name="low_sun",
        sun_azimuth_rad=_SUN_AZIMUTH_RAD,
        sun_elevation_rad=0.19,
        sun=(2.7, 1.80, 1.0),
        zenith=(0.22, 0.34, 0.60),
        horizon=(0.85, 0.66, 0.48),
        cloudiness=0.25,
        haze_per_m=0.0013,
        white=(0.96, 1.0, 1.10),
        exposure_stops=0.15,
    ),
    Weather(
        name="dusk",
        sun_azimuth_rad=_SUN_AZIMUTH_RAD,
        sun_elevation_rad=-0.05,
        sun=(0.0, 0.0, 0.0),
        zenith=(0.055, 0.085, 0.19),
        horizon=(0.24, 0.17, 0.17),
        cloudiness=0.4,
        haze_per_m=0.0012,
        lamps=0.45,
        exposure_stops=-0.9,
    ),
    Weather(
        name="night",
        sun_azimuth_rad=_SUN_AZIMUTH_RAD,
        sun_elevation_rad=-0.6,
        sun=(0.0, 0.0, 0.0),
        zenith=(0.009, 0.011, 0.017),
        horizon=(0.034, 0.027, 0.024),
        cloudiness=0.5,
        haze_per_m=0.0015,
        lamps=1.0,
        white=(0.88, 1.0, 1.2),
        exposure_stops=-1.1,
    ),
    Weather(
        name="wet",
        sun_azimuth_rad=_SUN_AZIMUTH_RAD,
        sun_elevation_rad=0.7,
        sun=(0.0, 0.0, 0.0),
        zenith=(0.48, 0.52, 0.58),
        horizon=(0.42, 0.45, 0.49),
        cloudiness=1.0,
        haze_per_m=0.003,
        wetness=1.0,
        lamps=0.12,
        exposure_stops=0.3,
    ),
)
WEATHERS: Mapping[str, Weather] = MappingProxyType({weather.name: weather for weather in _SKIES})


def draw_weather(name: str, rng: np.random.Generator) -> Weather:
    """Return a weather by name with a random direction of the sun, haze and strength.

    Raises:
        NotFoundError: if the weather is unknown.
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
