"""Place buildings on their plots, by style."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.simulation.scenery.apartments import add_apartment_building
from appocc.simulation.scenery.builder import Builder
from appocc.simulation.scenery.detached import add_detached_house
from appocc.simulation.scenery.industrial import add_industrial_building
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.terraces import add_town_house


def build_houses(builder: Builder, plots: Sequence[Plot], style: str, rng: np.random.Generator) -> None:
    """Add a building to every plot that has one; its faces are tagged with its index."""
    makers = {
        "old": add_town_house,
        "modern": add_apartment_building,
        "suburb": add_detached_house,
        "industrial": add_industrial_building,
    }
    for tag, plot in enumerate(plots):
        # Empty plots draw their random numbers, too, so that the other buildings do not depend on them.
        makers[style](builder if plot.built else Builder(), plot, tag, rng)
