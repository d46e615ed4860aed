"""Materials and tints of the parts of actors."""

from __future__ import annotations

from typing import NamedTuple

from appocc.simulation.mesh import Material

Colour = tuple[int, int, int]


class Look(NamedTuple):
    """Material and sRGB tint of a part; a painted part takes the actor's paint instead."""

    material: Material
    tint: Colour
    painted: bool = False


PAINT = Look(Material.PAINT, (190, 190, 190), painted=True)
JACKET = Look(Material.CLOTH, (120, 120, 120), painted=True)
GLASS = Look(Material.GLASS, (32, 38, 42))
RUBBER = Look(Material.RUBBER, (26, 26, 28))
CHROME = Look(Material.CHROME, (168, 170, 174))
DARK_HUB = Look(Material.CHROME, (92, 94, 98))
TRIM = Look(Material.TRIM, (30, 31, 33))
GRILLE = Look(Material.TRIM, (18, 18, 20))
UNDERSIDE = Look(Material.TRIM, (12, 12, 13))
GREY_TRIM = Look(Material.TRIM, (74, 75, 77))
HEAD_LAMP = Look(Material.HEAD_LAMP, (214, 218, 222))
TAIL_LAMP = Look(Material.TAIL_LAMP, (128, 16, 18))
# Mirrored parts swap sides: this is the left one, see `Modeller.add_sheet`.
INDICATOR = Look(Material.INDICATOR_LEFT, (196, 112, 34))
PLATE = Look(Material.PLATE, (226, 226, 220))
RAIL = Look(Material.METAL, (150, 152, 155))


def plain(*tint: int) -> Look:
    """Return a matt finish."""
    return Look(Material.PLAIN, _colour(tint))


def cloth(*tint: int) -> Look:
    """Return the finish of a garment."""
    return Look(Material.CLOTH, _colour(tint))


def skin(*tint: int) -> Look:
    """Return the finish of bare skin."""
    return Look(Material.SKIN, _colour(tint))


def _colour(tint: tuple[int, ...]) -> Colour:
    red, green, blue = tint
    return red, green, blue
