"""Vehicles of plain geometry: two or three painted boxes each, driving straight on or standing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from appocc.checks import FloatArray
from appocc.demo.bodies import FRONT, GLASS, LEFT, REAR, RIGHT, RUBBER, Colour, Patch, Solid, painted
from appocc.geometry import quaternion_from_yaw, transform

Kind = Literal["car", "truck", "bus"]
_SIDES = (LEFT, RIGHT)
_TAIL, _LAMP = (176, 26, 24), (240, 238, 222)
_SIZES_LWH_M: dict[Kind, tuple[float, float, float]] = {
    "car": (4.6, 1.85, 1.5),
    "truck": (6.4, 2.3, 2.7),
    "bus": (11.0, 2.55, 3.1),
}
_CATEGORIES: dict[Kind, str] = {"car": "vehicle.car", "truck": "vehicle.truck", "bus": "vehicle.bus.rigid"}


@dataclass(frozen=True)
class Vehicle:
    """A vehicle of the scene.

    Attributes:
        name: what it is called in the tables.
        kind: its shape.
        paint: sRGB of its bodywork.
        x_m: centre along the street at time 0.
        y_m: centre across the street at time 0.
        yaw_rad: heading in the street frame.
        speed_mps: constant, along the heading.
    """

    name: str
    kind: Kind
    paint: Colour
    x_m: float
    y_m: float
    yaw_rad: float = 0.0
    speed_mps: float = 0.0

    @property
    def size_lwh_m(self) -> tuple[float, float, float]:
        """Length, width, height."""
        return _SIZES_LWH_M[self.kind]

    @property
    def category(self) -> str:
        """Category of nuScenes."""
        return _CATEGORIES[self.kind]

    def street_from_vehicle(self, time_s: float) -> FloatArray:
        """(4, 4) pose of the middle of its footprint, on the ground, at a time."""
        way = self.speed_mps * time_s
        place = [self.x_m + way * np.cos(self.yaw_rad), self.y_m + way * np.sin(self.yaw_rad), 0.0]
        return transform(quaternion_from_yaw(self.yaw_rad), place)

    def solids(self, time_s: float) -> list[Solid]:
        """Its boxes at a time."""
        pose = self.street_from_vehicle(time_s)
        length, width, _ = self.size_lwh_m
        axles = (-0.31 * length, 0.31 * length)
        under = _Part((0.05 - length / 2, length / 2 - 0.05), width / 2 - 0.03, (0.12, 0.3), ())
        solids = []
        for part in (under, *_PARTS[self.kind](self)):
            paint = RUBBER if part is under else self.paint
            look = partial(painted, paint=paint, patches=part.patches, axles_m=axles)
            low, high = ([part.x_m[i], (2 * i - 1) * part.half_y_m, part.z_m[i]] for i in (0, 1))
            solids.append(Solid(pose, np.array(low), np.array(high), look))
        return solids


class _Part(NamedTuple):
    """A box of a vehicle in its own frame: x forward, y left, z up from the ground."""

    x_m: tuple[float, float]
    half_y_m: float
    z_m: tuple[float, float]
    patches: tuple[Patch, ...]


def _lamps(half_y_m: float) -> tuple[Patch, ...]:
    """Red lamps behind, white ones ahead, on both sides."""
    sides = ((-half_y_m, 0.4 - half_y_m), (half_y_m - 0.4, half_y_m))
    return tuple(
        Patch((face,), across, height, colour)
        for across in sides
        for face, height, colour in ((REAR, (0.62, 0.82), _TAIL), (FRONT, (0.58, 0.76), _LAMP))
    )


def _car(car: Vehicle) -> tuple[_Part, ...]:
    """A body and a narrower cabin with windscreens and two panes a side."""
    length, width, height = car.size_lwh_m
    belt, half = 0.6 * height, width / 2 - 0.13
    rise = (belt + 0.03, height - 0.08)
    panes = (
        Patch((FRONT, REAR), (0.09 - half, half - 0.09), rise, GLASS),
        Patch(_SIDES, (-0.40 * length, -0.13 * length), rise, GLASS),
        Patch(_SIDES, (-0.11 * length, 0.18 * length), rise, GLASS),
    )
    body = _Part((-length / 2, length / 2), width / 2, (0.26, belt), _lamps(width / 2))
    return body, _Part((-0.42 * length, 0.2 * length), half, (belt, height), panes)


def _truck(truck: Vehicle) -> tuple[_Part, ...]:
    """A cab and a closed load of the same paint."""
    length, width, height = truck.size_lwh_m
    front, half, cab = length / 2, width / 2 - 0.05, length / 2 - 1.9
    panes = (
        Patch((FRONT,), (0.1 - half, half - 0.1), (1.35, 2.05), GLASS),
        Patch(_SIDES, (cab + 0.5, front - 0.25), (1.35, 2.0), GLASS),
    )
    load = _Part((-front, cab - 0.15), width / 2, (0.42, height), _lamps(width / 2))
    return _Part((cab, front), half, (0.28, 2.2), (*_lamps(half), *panes)), load


def _bus(bus: Vehicle) -> tuple[_Part, ...]:
    """One body with a row of panes a side."""
    length, width, height = bus.size_lwh_m
    front, half = length / 2, width / 2
    row = [Patch(_SIDES, (x, x + 1.25), (1.55, 2.6), GLASS) for x in np.arange(0.3 - front, front - 1.2, 1.4)]
    screens = Patch((FRONT, REAR), (0.15 - half, half - 0.15), (1.45, 2.7), GLASS)
    return (_Part((-front, front), half, (0.28, height), (*_lamps(half), screens, *row)),)


_PARTS = {"car": _car, "truck": _truck, "bus": _bus}
