"""Static scenery of a town: buildings, trees, street lamps, traffic lights and street furniture."""

from appocc.simulation.scenery.build import build_scenery

__all__ = ["build_scenery"]
