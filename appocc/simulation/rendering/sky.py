"""The sky of a weather as a map of the upper hemisphere."""

from __future__ import annotations

import math

import numpy as np

from appocc.checks import Float32Array
from appocc.simulation.rendering.compiled import inlined, kernel
from appocc.simulation.rendering.noise import noise
from appocc.simulation.rendering.weather import Weather

# An octahedral map: its border is the horizon, 4 * SIZE texels around.
SIZE = 384


def sun_direction(weather: Weather) -> Float32Array:
    """Return (3,) float32 unit direction to the sun, town frame."""
    high = math.cos(weather.sun_elevation_rad)
    x, y = high * math.cos(weather.sun_azimuth_rad), high * math.sin(weather.sun_azimuth_rad)
    return np.array([x, y, math.sin(weather.sun_elevation_rad)], np.float32)


def sky_map(weather: Weather, tile: Float32Array) -> Float32Array:
    """Return (SIZE, SIZE, 3) float32 radiance of the sky without the sun's disc; see `sky_at`."""
    colours = np.array([weather.zenith, weather.horizon, weather.sun], np.float32)
    drift = weather.sun_azimuth_rad * 100.0  # different clouds for each direction of the sun
    return _render_sky(sun_direction(weather), colours, weather.cloudiness, drift, tile)


def mean_light(sky: Float32Array) -> Float32Array:
    """Return (3,) float32 irradiance of a horizontal white surface by the sky alone."""
    step = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    u, v = np.meshgrid(step, step)
    x, y = (u + v) / 2, (u - v) / 2
    up = 1 - np.abs(x) - np.abs(y)
    # The solid angle of a texel is proportional to 1 / length^3 of its octahedron point, the light to its height.
    weight = (up / (x * x + y * y + up * up) ** 2)[..., None]
    return np.asarray((sky * weight).sum((0, 1)) / weight.sum(), np.float32)


@inlined
def sky_at(sky: Float32Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Interpolate the radiance of the sky in a unit direction; below the horizon it is that of the horizon."""
    z = max(z, 0.0)
    scale = 1.0 / (abs(x) + abs(y) + z + 1e-9)
    u = ((x + y) * scale + 1) * (SIZE / 2) - 0.5
    v = ((x - y) * scale + 1) * (SIZE / 2) - 0.5
    u, v = min(max(u, 0.0), SIZE - 1.001), min(max(v, 0.0), SIZE - 1.001)
    column, row = int(u), int(v)
    a, b = u - column, v - row
    p, q, r, s = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
    one, two = sky[row, column], sky[row, column + 1]
    three, four = sky[row + 1, column], sky[row + 1, column + 1]
    return (
        p * one[0] + q * two[0] + r * three[0] + s * four[0],
        p * one[1] + q * two[1] + r * three[1] + s * four[1],
        p * one[2] + q * two[2] + r * three[2] + s * four[2],
    )


@kernel
def _render_sky(
    sun: Float32Array, colours: Float32Array, cloudiness: float, drift: float, tile: Float32Array
) -> Float32Array:
    sky = np.empty((SIZE, SIZE, 3), np.float32)
    for row in range(SIZE):
        for column in range(SIZE):
            u, v = (column + 0.5) / SIZE * 2 - 1, (row + 0.5) / SIZE * 2 - 1
            x, y = (u + v) / 2, (u - v) / 2
            z = max(1 - abs(x) - abs(y), 0.0)
            length = math.sqrt(x * x + y * y + z * z)
            x, y, z = x / length, y / length, z / length
            toward = max(x * sun[0] + y * sun[1] + z * sun[2], 0.0)
            low = math.exp(-4.0 * z)
            glow = 0.10 * toward**4 + 0.25 * toward**64
            # Clouds are on a plane above the town; towards the horizon they get denser.
            far = 60.0 / (z + 0.18)
            thick = noise(tile, x * far + drift, y * far + 17)
            fine = noise(tile, x * far * 4, y * far * 4 + 40)
            cover = min(max((0.8 * thick + 0.2 * fine - (1 - cloudiness)) * 4.0, 0.0), 1.0)
            shaded = 1.0 - 0.35 * min(max((thick - (1 - cloudiness)) * 2.0, 0.0), 1.0)
            for k in range(3):
                clear = colours[0, k] * (1 - low) + colours[1, k] * low + glow * colours[2, k]
                cloud = (
                    0.9 * (colours[0, k] + colours[0, 2]) / 2 + 0.3 * colours[2, k] + 0.15 * colours[1, k]
                ) * shaded
                cloud = cloud * (1 - 0.6 * low) + 0.6 * low * colours[1, k]
                sky[row, column, k] = clear * (1 - cover) + cloud * cover
    return sky
