"""Colours of walls, roofs and leaves as in European and American streets (sRGB)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.simulation.scenery.builder import Tint

BRICKS: tuple[Tint, ...] = (
    (138, 94, 78),
    (150, 106, 86),
    (124, 86, 74),
    (164, 128, 104),
    (116, 90, 80),
    (170, 142, 118),
    (146, 116, 98),
)
PLASTERS: tuple[Tint, ...] = (
    (222, 212, 192),
    (232, 226, 212),
    (212, 190, 156),
    (206, 176, 140),
    (196, 186, 172),
    (188, 162, 138),
    (210, 202, 196),
    (178, 176, 168),
    (216, 196, 176),
    (182, 148, 124),
)
SIDINGS: tuple[Tint, ...] = (
    (226, 222, 212),
    (200, 204, 202),
    (174, 184, 188),
    (196, 186, 164),
    (160, 164, 150),
    (214, 200, 176),
)
CONCRETES: tuple[Tint, ...] = ((172, 170, 166), (190, 188, 182), (150, 150, 150), (204, 200, 192))
PANELS: tuple[Tint, ...] = (
    (214, 212, 208),
    (96, 100, 106),
    (132, 112, 94),
    (178, 168, 152),
    (120, 126, 130),
    (146, 112, 98),
)
INDUSTRIAL_WALLS: tuple[Tint, ...] = (
    (168, 174, 178),
    (196, 196, 190),
    (142, 150, 156),
    (120, 136, 150),
    (176, 166, 148),
    (134, 92, 76),
)
TILES: tuple[Tint, ...] = (
    (128, 84, 68),
    (116, 78, 66),
    (138, 98, 78),
    (92, 80, 74),
    (84, 84, 88),
    (104, 78, 66),
    (76, 76, 80),
)
SHINGLES: tuple[Tint, ...] = ((86, 82, 80), (104, 94, 86), (74, 76, 80), (118, 98, 84), (96, 72, 62))
TRIMS: tuple[Tint, ...] = ((226, 222, 214), (206, 198, 184), (190, 184, 176), (176, 164, 148))
FRAMES: tuple[Tint, ...] = ((228, 228, 224), (214, 210, 202), (92, 84, 78), (62, 66, 70), (112, 88, 66))
DARK_FRAMES: tuple[Tint, ...] = ((52, 54, 58), (72, 76, 80), (40, 42, 46), (150, 152, 154))
DOORS: tuple[Tint, ...] = (
    (86, 54, 38),
    (48, 62, 52),
    (56, 62, 80),
    (112, 44, 40),
    (70, 66, 62),
    (112, 84, 58),
    (40, 42, 46),
)
AWNINGS: tuple[Tint, ...] = (
    (132, 44, 42),
    (44, 84, 62),
    (52, 68, 104),
    (196, 186, 164),
    (150, 112, 56),
    (92, 92, 96),
    (176, 96, 52),
)
FASCIAS: tuple[Tint, ...] = (
    (56, 60, 66),
    (104, 40, 38),
    (44, 72, 58),
    (48, 62, 96),
    (200, 192, 174),
    (120, 92, 60),
    (66, 52, 46),
)
METALS: tuple[Tint, ...] = ((92, 96, 98), (62, 66, 68), (132, 136, 138))
LEAVES: tuple[Tint, ...] = (
    (76, 94, 54),
    (86, 102, 58),
    (66, 84, 50),
    (94, 106, 62),
    (80, 90, 50),
    (100, 108, 66),
    (70, 90, 60),
)
NEEDLES: tuple[Tint, ...] = ((46, 70, 46), (54, 76, 52), (58, 80, 60))
HEDGES: tuple[Tint, ...] = ((62, 84, 42), (72, 92, 48), (56, 78, 44))
BARKS: tuple[Tint, ...] = ((92, 78, 64), (108, 96, 82), (80, 68, 58))
FENCES: tuple[Tint, ...] = ((142, 116, 88), (222, 220, 214), (112, 104, 96), (158, 134, 104))
STONE: Tint = (164, 158, 148)
LEAD: Tint = (108, 112, 116)
CONCRETE: Tint = (164, 162, 158)
GRAVEL: Tint = (128, 124, 118)


def pick_tint(rng: np.random.Generator, tints: Sequence[Tint]) -> Tint:
    """Return one of the colours at random, slightly lighter or darker."""
    tint = tints[int(rng.integers(len(tints)))]
    shade = float(rng.uniform(0.93, 1.06))
    red, green, blue = (min(255, round(c * shade)) for c in tint)
    return red, green, blue
