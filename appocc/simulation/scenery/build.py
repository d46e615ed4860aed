"""Build the static scenery of a town from its plan and ground."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import NotFoundError
from appocc.simulation.mesh import Mesh, join_meshes
from appocc.simulation.plan import TownPlan
from appocc.simulation.scenery.builder import Builder
from appocc.simulation.scenery.greenery import add_enclosures, plant_trees
from appocc.simulation.scenery.houses import build_houses
from appocc.simulation.scenery.plots import SPACINGS, lay_plots
from appocc.simulation.scenery.signals import build_signals
from appocc.simulation.scenery.site import Site
from appocc.simulation.scenery.streets import furnish_streets
from appocc.simulation.scenery.yards import fill_yards
from appocc.simulation.surface import Ground


def build_scenery(plan: TownPlan, ground: Ground) -> tuple[Mesh, FloatArray]:
    """Build the scenery as one mesh, and return it with the positions of the street lamps' light sources, (L, 3).

    Raises:
        NotFoundError: if the plan's style is unknown.
    """
    if plan.style not in SPACINGS:
        raise NotFoundError(f"{plan.name}: expected a style of {', '.join(SPACINGS)}, got '{plan.style}'")
    # Each part has its own random generator, so that a change in one does not affect the others.
    houses, streets, green = (np.random.default_rng([plan.seed, part]) for part in range(3))
    site = Site(ground, plan.network)
    builder = Builder()
    plots = lay_plots(site, plan.style, houses)
    build_houses(builder, plots, plan.style, houses)
    signals, poles_m = build_signals(site, plan.network)
    furniture, lights_m, street_trees_m = furnish_streets(site, plan.network, plan.style, poles_m, streets)
    add_enclosures(builder, site, plots, plan.style, green)
    if plan.style == "industrial":
        furniture += fill_yards(builder, site, plots, streets)
    trees = plant_trees(site, plan.style, street_trees_m, green)
    return join_meshes([builder.mesh(), *signals, *furniture, *trees]), lights_m
