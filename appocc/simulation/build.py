"""Build a renderable town from its plan."""

from __future__ import annotations

from appocc.simulation.ground import build_ground
from appocc.simulation.plan import TownPlan
from appocc.simulation.scenery import build_scenery
from appocc.simulation.town import Town


def build_town(plan: TownPlan) -> Town:
    """Build ground and scenery of a town; the same plan gives the same town."""
    ground, lines = build_ground(plan)
    solid, lamps_m = build_scenery(plan, ground)
    return Town(plan, ground, solid, lamps_m, lines)
