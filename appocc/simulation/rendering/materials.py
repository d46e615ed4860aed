"""Procedural patterns of materials: brightness relative to the tint, and the interior behind window panes."""

from __future__ import annotations

import math

from appocc.checks import Float32Array
from appocc.simulation.mesh import Material
from appocc.simulation.rendering.compiled import inlined
from appocc.simulation.rendering.noise import hash_unit, noise

# Numba treats integers at module level as constants.
BRICK, PLASTER, CONCRETE = int(Material.BRICK), int(Material.PLASTER), int(Material.CONCRETE)
WINDOW, SHOPFRONT = int(Material.WINDOW), int(Material.SHOPFRONT)
ROOF_TILES, FLAT_ROOF = int(Material.ROOF_TILES), int(Material.FLAT_ROOF)
FOLIAGE, BARK, METAL, HEDGE = int(Material.FOLIAGE), int(Material.BARK), int(Material.METAL), int(Material.HEDGE)
STREET_LAMP, SIGNAL, SIGN = int(Material.STREET_LAMP), int(Material.SIGNAL), int(Material.SIGN)
PAINT, GLASS, CHROME = int(Material.PAINT), int(Material.GLASS), int(Material.CHROME)
HEAD_LAMP, TAIL_LAMP = int(Material.HEAD_LAMP), int(Material.TAIL_LAMP)
INDICATOR_LEFT, INDICATOR_RIGHT = int(Material.INDICATOR_LEFT), int(Material.INDICATOR_RIGHT)
TRIM, PLATE, CLOTH = int(Material.TRIM), int(Material.PLATE), int(Material.CLOTH)
# Size of a shop window pane; texture coordinates of shopfronts are scaled so that whole panes fit.
SHOP_PANE_WIDTH_M, SHOP_PANE_HEIGHT_M = 1.6, 3.2


@inlined
def material_pattern(
    material: int, u: float, v: float, x: float, y: float, z: float, pixel_m: float, tile: Float32Array
) -> float:
    """Return the factor of the tint at a point; details smaller than a pixel fade to their mean.

    Args:
        material: number of a `Material`.
        u: texture coordinate, metres for walls and roofs.
        v: the other texture coordinate.
        x: position in the town, metres.
        y: position in the town, metres.
        z: position in the town, metres.
        pixel_m: width of a pixel at the point.
        tile: noise tile.
    """
    if material == BRICK:
        return _bricks(u, v, pixel_m) * (0.88 + 0.24 * noise(tile, (x + y) * 5.0, z * 5.0))
    if material in (PLASTER, CONCRETE):
        # Rain streaks run downward, damp rises from the ground.
        value = 0.90 + 0.12 * noise(tile, (x - y) * 4.0, z * 4.0) + 0.10 * noise(tile, (x + y) * 14.0, z * 0.9)
        return value * (0.86 + 0.14 * min(z / 0.8, 1.0))
    if material == ROOF_TILES:
        return _tiles(u, v, pixel_m) * (0.85 + 0.3 * noise(tile, x * 4.0, y * 4.0))
    if material == FLAT_ROOF:
        return 0.75 + 0.3 * noise(tile, x * 3.0, y * 3.0) + 0.2 * noise(tile, x * 41.0, y * 41.0)
    if material in (FOLIAGE, HEDGE):
        coarse = noise(tile, x * 9.0 + z * 6.0, y * 9.0 - z * 7.0)
        fine = noise(tile, x * 47.0 - z * 31.0, y * 47.0 + z * 37.0) if pixel_m < 0.25 else 0.5
        return 0.32 + 0.6 * coarse + 0.75 * fine
    if material == BARK:
        return 0.7 + 0.6 * noise(tile, (x + y) * 90.0, z * 8.0)
    if material == CLOTH:
        return 0.85 + 0.3 * noise(tile, x * 25.0 + y * 13.0, z * 25.0)
    return 1.0


@inlined
def _bricks(u: float, v: float, pixel_m: float) -> float:
    seen = min(max(1.3 - pixel_m / 0.06, 0.0), 1.0)
    if seen == 0.0:
        return 1.0
    row = math.floor(v / 0.075)
    along = u / 0.25 + 0.5 * (row - 2 * math.floor(row / 2))
    brick = math.floor(along)
    value = 0.78 + 0.46 * hash_unit(int(brick) + 4096, int(row) + 4096)
    if min(along - brick, 1 - along + brick) < 0.035 or v / 0.075 - row < 0.14:
        value = 1.35
    return 1.0 + (value - 1.0) * seen


@inlined
def _tiles(u: float, v: float, pixel_m: float) -> float:
    seen = min(max(1.3 - pixel_m / 0.15, 0.0), 1.0)
    if seen == 0.0:
        return 1.0
    row, column = math.floor(v / 0.32), math.floor(u / 0.28)
    value = 0.82 + 0.36 * hash_unit(int(column) + 4096, int(row) + 4096)
    edge, roll = v / 0.32 - row, u / 0.28 - column
    value *= (
        1.0 - 0.45 * max(0.2 - min(edge, 1 - edge), 0.0) / 0.2 - 0.2 * max(0.15 - min(roll, 1 - roll), 0.0) / 0.15
    )
    return 1.0 + (value - 1.0) * seen


@inlined
def window_pane(
    u: float, v: float, key: int, tint: tuple[float, float, float], lamps: float
) -> tuple[float, float, float, float, float]:
    """Return the look of a window pane: colour (3), reflectivity (0 on frames), and light from inside.

    Args:
        u: texture coordinate, from 0 to 1 across a pane; adjacent panes continue it.
        v: the other texture coordinate, upward.
        key: number of the pane's quad.
        tint: colour of the frame.
        lamps: strength of interior lights, see `Weather.lamps`.
    """
    column, row = math.floor(u), math.floor(v)
    a, b = u - column, v - row
    key += 31 * int(column) + 977 * int(row)
    if min(a, 1 - a, b, 1 - b) < 0.07 or abs(a - 0.5) < 0.02:
        return tint[0], tint[1], tint[2], 0.0, 0.0
    inside, curtain = hash_unit(key, key + 11), hash_unit(key, key + 23)
    on = lamps * (0.08 + 0.22 * hash_unit(key, key + 37)) if hash_unit(key, key + 51) < 0.34 else 0.0
    hangs = 0.14 + 0.2 * curtain
    if curtain > 0.45 and (a < hangs or a > 1 - hangs):
        cloth = 0.30 + 0.25 * inside
        return cloth, cloth * 0.96, cloth * 0.88, 0.75, on * 0.6
    if inside > 0.8 and b > inside - 0.35:
        return 0.42, 0.41, 0.38, 0.7, on * 0.55  # a blind, partly lowered
    return 0.03, 0.033, 0.036, 1.0, on * (0.45 + 0.75 * b)


@inlined
def shop_pane(
    u: float, v: float, shop: int, tint: tuple[float, float, float], lamps: float
) -> tuple[float, float, float, float, float]:
    """Return the look of a shop window, as `window_pane`: a room that darkens upward, and wide shapes on its floor.

    All panes of a shop show the same room, lit or not.

    Args:
        u: metres along the front; a pane is SHOP_PANE_M wide.
        v: metres upward; a pane is SHOP_HIGH_M high.
        shop: number of the building.
        tint: colour of the frame.
        lamps: strength of interior lights, see `Weather.lamps`.
    """
    column = math.floor(u / SHOP_PANE_WIDTH_M)
    a, b = u / SHOP_PANE_WIDTH_M - column, v / SHOP_PANE_HEIGHT_M
    if min(a, 1 - a) < 0.03 or min(b, 1 - b) < 0.025:
        return tint[0], tint[1], tint[2], 0.0, 0.0
    room, warm = 0.05 + 0.08 * hash_unit(shop, shop + 211), hash_unit(shop, shop + 223)
    shade = room * (1.2 - 0.75 * b)
    r, g, blue = shade, shade * (0.97 - 0.07 * warm), shade * (0.97 - 0.2 * warm)
    inside = 0.85 + 0.25 * b
    for side in range(2):
        key = 2 * int(column) + side + 64 * shop
        if hash_unit(key, key + 227) > 0.8:
            continue
        middle, half = (
            0.28 + 0.44 * side + 0.12 * (hash_unit(key, key + 229) - 0.5),
            0.10 + 0.10 * hash_unit(key, key + 233),
        )
        top, tone = 0.16 + 0.34 * hash_unit(key, key + 239), 0.05 + 0.25 * hash_unit(key, key + 241)
        # Soft edges: at the resolution of a camera, sharp ones would alias.
        cover = min(max((half - abs(a - middle)) / 0.06 + 0.5, 0.0), 1.0)
        cover *= min(max((top - b) / 0.06 + 0.5, 0.0), 1.0)
        cold = hash_unit(key, key + 251)
        r += (tone * (1.05 - 0.25 * cold) - r) * cover
        g += (tone * (0.9 + 0.1 * cold) - g) * cover
        blue += (tone * (0.65 + 0.5 * cold) - blue) * cover
        inside *= 1 - cover * (0.65 - 1.6 * tone)
    on = lamps * (0.16 + 0.12 * hash_unit(shop, shop + 257)) if hash_unit(shop, shop + 263) < 0.75 else 0.0
    return r, g, blue, 1.0, on * inside
