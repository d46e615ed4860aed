"""All that stands in a town, from its plan and its ground."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.mesh import Mesh, joined
from appocc.simulation.plan import TownPlan
from appocc.simulation.scenery.builder import Builder
from appocc.simulation.scenery.houses import build_houses
from appocc.simulation.scenery.plots import lay_plots
from appocc.simulation.scenery.site import Site
from appocc.simulation.surface import Ground


def build_scenery(plan: TownPlan, ground: Ground) -> tuple[Mesh, FloatArray]:
    """Everything that stands, as one mesh, and where the street lamps' lights are, (L, 3) town frame."""
    rng = np.random.default_rng([plan.seed, 7])
    site = Site(ground, plan.network)
    builder = Builder()
    build_houses(builder, lay_plots(site, plan.style, rng), plan.style, rng)
    return joined([builder.mesh()]), np.zeros((0, 3))
