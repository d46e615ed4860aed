"""The ground of a town from its plan."""

from __future__ import annotations

import numpy as np

from appocc.simulation.ground.areas import canvas_of, draw_car_park, draw_streets, road_mask
from appocc.simulation.ground.crossings import arrows, stop_lines, zebras
from appocc.simulation.ground.markings import LINE_WIDTH_M, Habits, lines_of
from appocc.simulation.ground.outlines import outlines_of
from appocc.simulation.ground.polylines import strip
from appocc.simulation.ground.stretches import stretches_of
from appocc.simulation.ground.surroundings import draw_surroundings
from appocc.simulation.ground.colours import coloured
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import Ground, Surface
from appocc.simulation.town import VectorMap


def build_ground(plan: TownPlan) -> tuple[Ground, VectorMap]:
    """Draw the ground of a town, and its vector map; the same plan gives the same bytes."""
    canvas = canvas_of(plan)
    draw_streets(canvas, plan)
    label = canvas.raster[:, :, 0]
    draw_surroundings(canvas, plan)
    for car_park in plan.car_parks:
        draw_car_park(canvas, car_park)
    drivable = outlines_of(road_mask(label), canvas.low_m)
    stretches = stretches_of(plan.network)
    lines = lines_of(stretches, Habits.of(plan.seed))
    stops = stop_lines(stretches)
    canvas.fill(zebras(stretches), Surface.ZEBRA)
    canvas.fill(arrows(stretches, plan.network.connections), Surface.ARROW)
    for surface in (Surface.LINE_WHITE, Surface.LINE_YELLOW):
        painted = [line.points_m for line in lines if line.surface == surface]
        canvas.fill((a for p in painted for a in strip(p, LINE_WIDTH_M / 2, -LINE_WIDTH_M / 2)), surface)
    canvas.fill(stops, Surface.STOP_LINE)
    vector_map = VectorMap(
        tuple(line.points_m for line in lines if not line.between),
        tuple(line.points_m for line in lines if line.between),
        tuple(stops),
        drivable,
    )
    return Ground(canvas.low_m, np.ascontiguousarray(label), coloured(canvas, plan)), vector_map
