"""Materials and tints of the parts of actors."""

from __future__ import annotations

from typing import NamedTuple

from appocc.simulation.mesh import Material

Colour = tuple[int, int, int]


class Finish(NamedTuple):
    """Material and sRGB tint of a part; a painted part takes the actor's paint instead."""

    material: Material
    tint: Colour
    painted: bool = False


PAINT = Finish(Material.PAINT, (190, 190, 190), painted=True)
JACKET = Finish(Material.CLOTH, (120, 120, 120), painted=True)
GLASS = Finish(Material.GLASS, (32, 38, 42))
RUBBER = Finish(Material.RUBBER, (26, 26, 28))
CHROME = Finish(Material.CHROME, (168, 170, 174))
DARK_HUB = Finish(Material.CHROME, (92, 94, 98))
TRIM = Finish(Material.TRIM, (30, 31, 33))
GRILLE = Finish(Material.TRIM, (18, 18, 20))
UNDERSIDE = Finish(Material.TRIM, (12, 12, 13))
GREY_TRIM = Finish(Material.TRIM, (74, 75, 77))
HEAD_LAMP = Finish(Material.HEAD_LAMP, (214, 218, 222))
TAIL_LAMP = Finish(Material.TAIL_LAMP, (128, 16, 18))
# Mirrored parts swap sides: this is the left one, see `Modeller.add_sheet`.
INDICATOR = Finish(Material.INDICATOR_LEFT, (196, 112, 34))
PLATE = Finish(Material.PLATE, (226, 226, 220))
RAIL = Finish(Material.METAL, (150, 152, 155))


def plain(*tint: int) -> Finish:
    """Return a matt finish."""
    return Finish(Material.PLAIN, _colour(tint))


def cloth(*tint: int) -> Finish:
    """Return the finish of a garment."""
    return Finish(Material.CLOTH, _colour(tint))


def skin(*tint: int) -> Finish:
    """Return the finish of bare skin."""
    return Finish(Material.SKIN, _colour(tint))


def _colour(tint: tuple[int, ...]) -> Colour:
    red, green, blue = tint
    return red, green, blue
