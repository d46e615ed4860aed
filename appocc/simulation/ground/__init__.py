"""The ground of a town: surface classes, markings and colours from a road network."""

from appocc.simulation.ground.building import build_ground

__all__ = ["build_ground"]
