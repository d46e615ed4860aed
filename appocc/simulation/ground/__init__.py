"""The ground of a town: areas, markings and colours from a street network."""

from appocc.simulation.ground.building import build_ground

__all__ = ["build_ground"]
