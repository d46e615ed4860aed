"""Build the ground of a town from its plan."""

from __future__ import annotations

from collections.abc import Sequence

from appocc.checks import FloatArray
from appocc.polylines import strip
from appocc.simulation.ground.areas import draw_car_park, draw_streets, empty_canvas, road_mask
from appocc.simulation.ground.colours import colour_ground
from appocc.simulation.ground.crossings import arrows, stop_lines, zebra_areas, zebras
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.land import draw_land, lay_lots
from appocc.simulation.ground.land_styles import find_land_style
from appocc.simulation.ground.markings import LINE_WIDTH_M, MarkingLine, MarkingStyle, marking_lines
from appocc.simulation.ground.outlines import trace_outlines
from appocc.simulation.ground.road_segments import RoadSegment, find_road_segments, junction_outlines
from appocc.simulation.ground.surroundings import draw_kerb, draw_surroundings
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import Ground, Surface
from appocc.simulation.town import TownMap


def build_ground(plan: TownPlan) -> tuple[Ground, TownMap]:
    """Draw the ground of a town and its vector map; the same plan gives the same bytes.

    Raises:
        NotFoundError: if the style is unknown.
    """
    land_style = find_land_style(plan.style)
    segments = find_road_segments(plan.network)
    lots = lay_lots(segments, land_style, plan.seed)
    canvas = empty_canvas(plan)
    label = canvas.raster[:, :, 0]
    draw_land(canvas, lots, land_style, plan.seed)
    draw_streets(canvas, plan.network)
    draw_surroundings(label, land_style.pavement_m)
    for car_park in plan.car_parks:
        draw_car_park(canvas, car_park)
    if plan.car_parks:
        draw_kerb(label)
    drivable = trace_outlines(road_mask(label), canvas.low_m)
    lines = marking_lines(segments, MarkingStyle.draw(plan.seed))
    stops = stop_lines(segments)
    _draw_markings(canvas, plan, segments, lines, stops)
    colour = colour_ground(canvas, plan, segments, lots)
    vector_map = TownMap(
        tuple(line.points_m for line in lines if not line.between),
        tuple(line.points_m for line in lines if line.between),
        tuple(stop_lines(segments, signal=False)),
        drivable,
        tuple(stop_lines(segments, signal=True)),
        tuple(zebra_areas(segments)),
        tuple(junction_outlines(plan.network)),
        tuple(car_park.outline_m for car_park in plan.car_parks),
    )
    return Ground(canvas.low_m, label, colour), vector_map


def _draw_markings(
    canvas: Canvas,
    plan: TownPlan,
    segments: Sequence[RoadSegment],
    lines: Sequence[MarkingLine],
    stops: Sequence[FloatArray],
) -> None:
    canvas.fill(zebras(segments), Surface.ZEBRA)
    canvas.fill(arrows(segments, plan.network.connections), Surface.ARROW)
    half = LINE_WIDTH_M / 2
    for surface in (Surface.LINE_WHITE, Surface.LINE_YELLOW):
        painted = (line.points_m for line in lines if line.surface == surface)
        canvas.fill((strip(points, half, -half) for points in painted), surface)
    canvas.fill(stops, Surface.STOP_LINE)
