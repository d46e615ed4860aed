"""Equipment of industrial yards: containers, tanks, stacks of pallets."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import Builder, LocalFrame, tapered_rod
from appocc.simulation.scenery.palette import pick_tint
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
            frame, kind = plot.frame.moved(float(s), float(d), int(rng.integers(2))), rng.random()
            length, width = (2.6, 2.6) if kind > 0.65 else _CONTAINER_M[:2]
            outline = frame.corners(-0.6, length + 0.6, -0.6, width + 0.6)
            if not site.is_free(outline):
                continue
            site.occupy(outline)
            if kind < 0.45:
                _containers(builder, frame, rng)
            elif kind < 0.65:
                _pallets(builder, frame, rng)
            else:
                tanks += _tank(frame.at(1.3, 1.3), rng)
    return tanks


def _containers(builder: Builder, frame: LocalFrame, rng: np.random.Generator) -> None:
    """Add one to three stacked containers with ribs along their sides."""
    length, width, height = _CONTAINER_M
    for level in range(int(rng.choice((1, 2, 3), p=(0.5, 0.35, 0.15)))):
        tint, z = pick_tint(rng, palette.AWNINGS + palette.INDUSTRIAL_WALLS), level * height
        builder.add_boxes(frame, [0.0, 0.0, z], [length, width, z + height - 0.02], Material.METAL, tint)
        s = np.linspace(0.3, length - 0.5, 9)
        for d, side in ((-0.04, "lrf"), (width, "lrb")):
            low = np.stack([s, np.full_like(s, d), np.full_like(s, z + 0.15)], axis=1)
            builder.add_boxes(frame, low, low + np.array([0.2, 0.04, height - 0.3]), Material.METAL, tint, sides=side)


def _pallets(builder: Builder, frame: LocalFrame, rng: np.random.Generator) -> None:
    """Add stacks of pallets."""
    for s in (0.0, 1.5, 3.0, 4.5):
        height = float(rng.uniform(0.3, 1.9))
        low = np.array([s, rng.uniform(0.0, 1.0), 0.0])
        builder.add_boxes(frame, low, low + np.array([1.2, 1.2, height]), Material.PLAIN, palette.FENCES[0])


def _tank(xy_m: FloatArray, rng: np.random.Generator) -> list[Mesh]:
    """Return a round tank with a cone on top."""
    tint, height = pick_tint(rng, palette.INDUSTRIAL_WALLS[:2] + palette.METALS[2:]), float(rng.uniform(4.0, 9.0))
    foot, top = np.array([*xy_m, 0.0]), np.array([*xy_m, height])
    cone = tapered_rod(top, top + np.array([0.0, 0.0, 0.7]), (1.3, 0.25), 14, Material.METAL, tint, capped=True)
    return [tapered_rod(foot, top, (1.3, 1.3), 14, Material.METAL, tint), cone]
