"""Irradiance of a surface."""

from __future__ import annotations

import math

from appocc.checks import Float32Array
from appocc.simulation.rendering.compiled import inlined
from appocc.simulation.rendering.lighting import LAMP_CELL_M, NEAR_CELL_M, NEAR_CELLS, OPEN_CELL_M, Lighting

_FADING_CELLS = 32.0


@inlined
def _table_at(
    table: Float32Array, low_x: float, low_y: float, cell_m: float, beyond: float, x: float, y: float
) -> float:
    """Interpolate a table (Y, X) over the town bilinearly; `beyond` is the value outside."""
    u, v = (x - low_x) / cell_m - 0.5, (y - low_y) / cell_m - 0.5
    if u < 0 or v < 0 or u >= table.shape[1] - 1 or v >= table.shape[0] - 1:
        return beyond
    column, row = int(u), int(v)
    a, b = u - column, v - row
    first = table[row, column] * (1 - a) + table[row, column + 1] * a
    second = table[row + 1, column] * (1 - a) + table[row + 1, column + 1] * a
    return float(first * (1 - b) + second * b)


@inlined
def _near_at(near: Float32Array, low_x: float, low_y: float, x: float, y: float, channel: int) -> float:
    """Interpolate the near map bilinearly; beyond it there is neither shade nor lamp light."""
    u, v = (x - low_x) / NEAR_CELL_M - 0.5, (y - low_y) / NEAR_CELL_M - 0.5
    if u < 0 or v < 0 or u >= NEAR_CELLS - 1 or v >= NEAR_CELLS - 1:
        return 1.0 if channel == 0 else 0.0
    column, row = int(u), int(v)
    a, b = u - column, v - row
    first = near[row, column, channel] * (1 - a) + near[row, column + 1, channel] * a
    second = near[row + 1, column, channel] * (1 - a) + near[row + 1, column + 1, channel] * a
    value = float(first * (1 - b) + second * b)
    if channel != 0:  # fade out at the border of the map, which would otherwise show as hard edges
        value *= min(min(u, v, NEAR_CELLS - 1 - u, NEAR_CELLS - 1 - v) / _FADING_CELLS, 1.0)
    return value


@inlined
def _lamps_on(
    light: Lighting, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> tuple[float, float, float]:
    """Return the light of street lamps, head lamps and tail lamps on a surface."""
    side = 1.0 - 0.45 * (1 - max(nz, 0.0))
    near_x, near_y = x + nx * 0.5, y + ny * 0.5
    street = side * _table_at(light.lamp, light.low_x, light.low_y, LAMP_CELL_M, 0.0, near_x, near_y)
    street *= min(max((9.0 - z) / 4.0, 0.0), 1.0)
    low = min(max((1.6 - z) / 0.9, 0.12), 1.0) * min(max((6.0 - z) / 3.0, 0.0), 1.0)
    head = side * low * _near_at(light.near, light.near_x, light.near_y, near_x, near_y, 1)
    tail = side * low * _near_at(light.near, light.near_x, light.near_y, near_x, near_y, 2)
    # The red areas of the map are as wide as they are long; only their centres are kept.
    tail *= 1.6 * tail / (tail + 0.1)
    if light.ego_box[0] > 0:
        pose = light.ego_from_town
        front = light.ego_box[3] + light.ego_box[0] / 2
        ahead = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - front
        aside = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
        if 0 < ahead < 55:
            spread, fade = aside / (1.0 + 0.30 * ahead), 1 - ahead / 55
            facing = max(-(pose[0, 0] * nx + pose[0, 1] * ny), 0.0)
            head += math.exp(-spread * spread) * fade * fade * (
                1.5 * max(nz, 0.0) * ahead / (ahead + 3.0) + 2.2 * facing * low
            )  # fmt: skip
    return street + head + tail, 0.80 * street + 0.95 * head + 0.05 * tail, 0.50 * street + 0.82 * head + 0.03 * tail


@inlined
def light_on(
    light: Lighting, x: float, y: float, z: float, nx: float, ny: float, nz: float, sun: float
) -> tuple[float, float, float]:
    """Return the total light on a surface; `sun` is the share of sunlight it receives."""
    up = 0.5 + 0.5 * nz
    free = _table_at(light.open, light.low_x, light.low_y, OPEN_CELL_M, 1.0, x + nx * 1.5, y + ny * 1.5)
    free += (1 - free) * min(max(z / 18.0, 0.0), 1.0)
    if z < 1.3:
        shade = _near_at(light.near, light.near_x, light.near_y, x + nx * 0.3, y + ny * 0.3, 0)
        free *= shade + (1 - shade) * min(max(z / 1.3, 0.0), 1.0)
    # A wall's lower hemisphere is the street, which is sunlit where the sky above it is open.
    open_sky, street = up * (0.12 + 0.88 * free), (1 - up) * (0.25 + 0.75 * free)
    r = sun * light.sun[0] + open_sky * light.up[0] + street * light.bounce[0]
    g = sun * light.sun[1] + open_sky * light.up[1] + street * light.bounce[1]
    b = sun * light.sun[2] + open_sky * light.up[2] + street * light.bounce[2]
    if light.lamps > 0 and z < 9.0:
        p, q, s = _lamps_on(light, x, y, z, nx, ny, nz)
        r, g, b = r + light.lamps * p, g + light.lamps * q, b + light.lamps * s
    return r, g, b
