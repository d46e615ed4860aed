"""From a plan to a town that can be rendered."""

from __future__ import annotations

from appocc.simulation.ground import build_ground
from appocc.simulation.plan import TownPlan
from appocc.simulation.scenery import build_scenery
from appocc.simulation.town import Town


def build_town(plan: TownPlan) -> Town:
    """Draw the ground of a town and put everything on it; the same plan gives the same town."""
    ground, lines = build_ground(plan)
    solid, lamps_m = build_scenery(plan, ground)
    return Town(plan, ground, solid, lamps_m, lines)
