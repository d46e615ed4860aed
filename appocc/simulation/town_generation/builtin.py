"""Regenerate the built-in towns, byte for byte: `python -m appocc.simulation.town_generation.builtin`."""

from __future__ import annotations

from appocc.simulation.builtin import TOWNS_FOLDER
from appocc.simulation.town_generation.make import generate_town

# Name, layout seed, architectural style.
_TOWNS = (
    ("aldermoor", 12, "old"),
    ("brackwater", 21, "industrial"),
    ("cindervale", 22, "modern"),
    ("elmhollow", 23, "suburb"),
    ("fernport", 24, "old"),
    ("gildenmark", 25, "suburb"),
    ("harrowmere", 26, "modern"),
    ("isenford", 27, "old"),
)


def generate_all() -> None:
    """Write the files of all built-in towns.

    Raises:
        AppoccError: if SUMO is missing.
    """
    for name, seed, style in _TOWNS:
        generate_town(seed, TOWNS_FOLDER, name, style)


if __name__ == "__main__":
    generate_all()
