"""All that stands in a town: houses, trees, lamps, signals and street furniture."""

from appocc.simulation.scenery.build import build_scenery

__all__ = ["build_scenery"]
