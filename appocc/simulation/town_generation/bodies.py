"""Body types of vehicles and people: sizes, shares and speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Range = tuple[float, float]


@dataclass(frozen=True)
class BodyType:
    """A body type.

    Attributes:
        kind: kind of the actor.
        name: body of the actor.
        moving: share in moving traffic.
        parked: share in parked vehicles.
        length_m: minimum and maximum.
        width_m: minimum and maximum.
        height_m: minimum and maximum, riders included.
        sumo: SUMO's vehicle class.
        speed_mps: top speed.
    """

    kind: str
    name: str
    moving: float
    parked: float
    length_m: Range
    width_m: Range
    height_m: Range
    sumo: str = "passenger"
    speed_mps: float = 40.0


VEHICLES = (
    BodyType("car", "sedan", 20, 22, (4.5, 4.95), (1.79, 1.88), (1.40, 1.48)),
    BodyType("car", "hatchback", 19, 26, (3.8, 4.4), (1.70, 1.81), (1.43, 1.55)),
    BodyType("car", "estate", 8, 11, (4.55, 4.9), (1.80, 1.87), (1.45, 1.53)),
    BodyType("car", "suv", 16, 20, (4.3, 4.9), (1.82, 1.96), (1.60, 1.78)),
    BodyType("car", "minivan", 5, 7, (4.5, 5.1), (1.83, 1.95), (1.70, 1.86)),
    BodyType("truck", "pickup", 4, 5, (5.2, 5.6), (1.86, 2.0), (1.76, 1.90)),
    BodyType("van", "van", 7, 8, (4.9, 5.9), (1.93, 2.05), (2.0, 2.6), "delivery"),
    BodyType("truck", "box_truck", 4, 1, (6.0, 8.0), (2.2, 2.4), (2.8, 3.4), "truck", 19.0),
    BodyType("bus", "bus", 4, 0, (10.5, 12.0), (2.5, 2.55), (3.0, 3.3), "bus", 16.0),
    BodyType("motorcycle", "motorcycle", 6, 0, (2.0, 2.2), (0.75, 0.85), (1.6, 1.7), "motorcycle"),
    BodyType("bicycle", "bicycle", 9, 0, (1.7, 1.82), (0.58, 0.66), (1.7, 1.8), "bicycle", 6.0),
)
ADULT = BodyType("pedestrian", "adult", 0, 0, (0.42, 0.55), (0.5, 0.65), (1.55, 1.90))
CHILD = BodyType("pedestrian", "child", 0, 0, (0.32, 0.4), (0.38, 0.46), (1.05, 1.4))


def draw_body(rng: np.random.Generator, parked: bool) -> BodyType:
    """Draw a body type by its share in moving or parked traffic."""
    share = np.array([body.parked if parked else body.moving for body in VEHICLES], dtype=np.float64)
    return VEHICLES[int(rng.choice(len(VEHICLES), p=share / share.sum()))]


def draw_size(rng: np.random.Generator, body: BodyType) -> tuple[float, float, float]:
    """Draw length, width and height in metres, to the centimetre."""
    ranges = (body.length_m, body.width_m, body.height_m)
    length, width, height = (round(float(rng.uniform(*r)), 2) for r in ranges)
    return length, width, height
