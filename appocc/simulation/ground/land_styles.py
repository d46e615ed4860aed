"""Land use along the streets of each town style."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from appocc.errors import NotFoundError
from appocc.simulation.surface import Surface


@dataclass(frozen=True)
class LandStyle:
    """Land use along the streets of a town style.

    Attributes:
        pavement_m: width of the pavement.
        lot_width_m: minimum and maximum width of a lot along its street.
        lot_depth_m: minimum and maximum depth.
        lot_surfaces: surface classes of lots and their shares.
        driveway_share: share of the green lots with a paved driveway.
        earth_threshold: noise threshold above which open ground is bare earth, in standard deviations.
    """

    pavement_m: float
    lot_width_m: tuple[float, float]
    lot_depth_m: tuple[float, float]
    lot_surfaces: tuple[tuple[Surface, float], ...]
    driveway_share: float
    earth_threshold: float


_GREEN, _BARE, _PAVED = Surface.GRASS, Surface.EARTH, Surface.YARD
LAND_STYLES: Mapping[str, LandStyle] = {
    "old": LandStyle(3.2, (9.0, 19.0), (14.0, 26.0), ((_PAVED, 0.66), (_GREEN, 0.28), (_BARE, 0.06)), 0.3, 1.7),
    "modern": LandStyle(3.6, (22.0, 48.0), (22.0, 38.0), ((_PAVED, 0.55), (_GREEN, 0.45)), 0.3, 2.1),
    "suburb": LandStyle(2.2, (15.0, 25.0), (24.0, 34.0), ((_GREEN, 0.92), (_PAVED, 0.04), (_BARE, 0.04)), 0.8, 1.7),
    "industrial": LandStyle(
        2.4, (30.0, 70.0), (36.0, 56.0), ((_PAVED, 0.68), (_BARE, 0.2), (_GREEN, 0.12)), 0.2, 1.2
    ),
}


def find_land_style(style: str) -> LandStyle:
    """Return the land style of a town style.

    Raises:
        NotFoundError: if the style is unknown.
    """
    if style not in LAND_STYLES:
        raise NotFoundError(f"no style '{style}': expected one of {', '.join(LAND_STYLES)}")
    return LAND_STYLES[style]
