"""Build the ground of a town from its plan."""

from __future__ import annotations

from collections.abc import Sequence

from appocc.checks import FloatArray
from appocc.polylines import strip
from appocc.simulation.ground.areas import canvas_of, draw_car_park, draw_streets, road_mask
from appocc.simulation.ground.colours import coloured
from appocc.simulation.ground.crossings import arrows, stop_lines, zebras
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.land import draw_land, lots_of
from appocc.simulation.ground.looks import look_of
from appocc.simulation.ground.markings import LINE_WIDTH_M, Habits, Line, lines_of
from appocc.simulation.ground.outlines import outlines_of
from appocc.simulation.ground.road_segments import Stretch, stretches_of
from appocc.simulation.ground.surroundings import draw_kerb, draw_surroundings
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import Ground, Surface
from appocc.simulation.town import VectorMap


def build_ground(plan: TownPlan) -> tuple[Ground, VectorMap]:
    """Draw the ground of a town and its vector map; the same plan gives the same bytes.

    Raises:
        NotFoundError: if the style is unknown.
    """
    look = look_of(plan.style)
    stretches = stretches_of(plan.network)
    lots = lots_of(stretches, look, plan.seed)
    canvas = canvas_of(plan)
    label = canvas.raster[:, :, 0]
    draw_land(canvas, lots, look, plan.seed)
    draw_streets(canvas, plan.network)
    draw_surroundings(label, look.pavement_m)
    for car_park in plan.car_parks:
        draw_car_park(canvas, car_park)
    if plan.car_parks:
        draw_kerb(label)
    drivable = outlines_of(road_mask(label), canvas.low_m)
    lines = lines_of(stretches, Habits.of(plan.seed))
    stops = stop_lines(stretches)
    _draw_markings(canvas, plan, stretches, lines, stops)
    colour = coloured(canvas, plan, stretches, lots)
    vector_map = VectorMap(
        tuple(line.points_m for line in lines if not line.between),
        tuple(line.points_m for line in lines if line.between),
        tuple(stops),
        drivable,
    )
    return Ground(canvas.low_m, label, colour), vector_map


def _draw_markings(
    canvas: Canvas, plan: TownPlan, stretches: Sequence[Stretch], lines: Sequence[Line], stops: Sequence[FloatArray]
) -> None:
    canvas.fill(zebras(stretches), Surface.ZEBRA)
    canvas.fill(arrows(stretches, plan.network.connections), Surface.ARROW)
    half = LINE_WIDTH_M / 2
    for surface in (Surface.LINE_WHITE, Surface.LINE_YELLOW):
        painted = (line.points_m for line in lines if line.surface == surface)
        canvas.fill((strip(points, half, -half) for points in painted), surface)
    canvas.fill(stops, Surface.STOP_LINE)
