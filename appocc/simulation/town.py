"""A town that can be rendered: ground, static scenery, street lamps, and its vector map."""

from __future__ import annotations

from dataclasses import dataclass

from appocc.checks import FloatArray
from appocc.simulation.mesh import Mesh
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import Ground


@dataclass(frozen=True, eq=False)
class TownMap:
    """Lines and areas of the street map, (N, 2) each, town frame.

    Attributes:
        lane_dividers: painted lines between lanes of one direction and along edges; each dash is a line.
        road_dividers: painted lines between the two directions.
        stop_lines: outlines of stop lines where traffic gives way.
        drivable: outlines of the drivable area.
        light_lines: outlines of stop lines at traffic lights.
        crossings: outlines of pedestrian crossings, one for each direction of a street.
        junctions: outlines of junctions where streets branch.
        car_parks: outlines of car parks with their driveways.
    """

    lane_dividers: tuple[FloatArray, ...]
    road_dividers: tuple[FloatArray, ...]
    stop_lines: tuple[FloatArray, ...]
    drivable: tuple[FloatArray, ...]
    light_lines: tuple[FloatArray, ...] = ()
    crossings: tuple[FloatArray, ...] = ()
    junctions: tuple[FloatArray, ...] = ()
    car_parks: tuple[FloatArray, ...] = ()


@dataclass(frozen=True, eq=False)
class Town:
    """The static part of a town.

    Attributes:
        plan: the plan it was built from.
        ground: labels and colours of the plane z = 0.
        solid: mesh of the static scenery.
        lamps_m: (L, 3) positions of the street lamps' light sources, town frame.
        map: its vector map.
    """

    plan: TownPlan
    ground: Ground
    solid: Mesh
    lamps_m: FloatArray
    map: TownMap
