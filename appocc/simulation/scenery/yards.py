"""Equipment of industrial yards: containers, tanks, stacks of pallets."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import Builder, Place, stem
from appocc.simulation.scenery.palette import pick
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.site import Site

_CONTAINER_M = (6.1, 2.44, 2.6)
_TRIES = 5  # attempts per plot


def fill_yards(builder: Builder, site: Site, plots: list[Plot], rng: np.random.Generator) -> list[Mesh]:
    """Place containers, pallets and tanks between and behind the buildings, where there is room."""
    tanks: list[Mesh] = []
    for plot in plots:
        for _ in range(_TRIES):
            s, d = rng.uniform(-14.0, plot.width_m + 8.0), rng.uniform(-3.0, plot.depth_m + 12.0)
            place, kind = plot.place.moved(float(s), float(d), int(rng.integers(2))), rng.random()
            length, width = (2.6, 2.6) if kind > 0.65 else _CONTAINER_M[:2]
            outline = place.corners(-0.6, length + 0.6, -0.6, width + 0.6)
            if not site.free(outline):
                continue
            site.take(outline)
            if kind < 0.45:
                _containers(builder, place, rng)
            elif kind < 0.65:
                _pallets(builder, place, rng)
            else:
                tanks += _tank(place.at(1.3, 1.3), rng)
    return tanks


def _containers(builder: Builder, place: Place, rng: np.random.Generator) -> None:
    """Add one to three stacked containers with ribs along their sides."""
    length, width, height = _CONTAINER_M
    for level in range(int(rng.choice((1, 2, 3), p=(0.5, 0.35, 0.15)))):
        tint, z = pick(rng, palette.AWNINGS + palette.HALLS), level * height
        builder.boxes(place, [0.0, 0.0, z], [length, width, z + height - 0.02], Material.METAL, tint)
        s = np.linspace(0.3, length - 0.5, 9)
        for d, side in ((-0.04, "lrf"), (width, "lrb")):
            low = np.stack([s, np.full_like(s, d), np.full_like(s, z + 0.15)], axis=1)
            builder.boxes(place, low, low + np.array([0.2, 0.04, height - 0.3]), Material.METAL, tint, sides=side)


def _pallets(builder: Builder, place: Place, rng: np.random.Generator) -> None:
    """Add stacks of pallets."""
    for s in (0.0, 1.5, 3.0, 4.5):
        height = float(rng.uniform(0.3, 1.9))
        low = np.array([s, rng.uniform(0.0, 1.0), 0.0])
        builder.boxes(place, low, low + np.array([1.2, 1.2, height]), Material.PLAIN, palette.FENCES[0])


def _tank(xy_m: FloatArray, rng: np.random.Generator) -> list[Mesh]:
    """Return a round tank with a cone on top."""
    tint, height = pick(rng, palette.HALLS[:2] + palette.METALS[2:]), float(rng.uniform(4.0, 9.0))
    foot, top = np.array([*xy_m, 0.0]), np.array([*xy_m, height])
    cone = stem(top, top + np.array([0.0, 0.0, 0.7]), (1.3, 0.25), 14, Material.METAL, tint, capped=True)
    return [stem(foot, top, (1.3, 1.3), 14, Material.METAL, tint), cone]
