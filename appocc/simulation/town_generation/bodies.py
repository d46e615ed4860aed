"""Body types of vehicles and people: sizes, shares and speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
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
    BodyType(
        kind="car",
        name="sedan",
        moving=20,
        parked=22,
        length_m=(4.5, 4.95),
        width_m=(1.79, 1.88),
        height_m=(1.40, 1.48),
    ),
    BodyType(
        kind="car",
        name="hatchback",
        moving=19,
        parked=26,
        length_m=(3.8, 4.4),
        width_m=(1.70, 1.81),
        height_m=(1.43, 1.55),
    ),
    BodyType(
        kind="car",
        name="estate",
        moving=8,
        parked=11,
        length_m=(4.55, 4.9),
        width_m=(1.80, 1.87),
        height_m=(1.45, 1.53),
    ),
    BodyType(
        kind="car", name="suv", moving=16, parked=20, length_m=(4.3, 4.9), width_m=(1.82, 1.96), height_m=(1.60, 1.78)
    ),
    BodyType(
        kind="car",
        name="minivan",
        moving=5,
        parked=7,
        length_m=(4.5, 5.1),
        width_m=(1.83, 1.95),
        height_m=(1.70, 1.86),
    ),
    BodyType(
        kind="truck",
        name="pickup",
        moving=4,
        parked=5,
        length_m=(5.2, 5.6),
        width_m=(1.86, 2.0),
        height_m=(1.76, 1.90),
    ),
    BodyType(
        kind="van",
        name="van",
        moving=7,
        parked=8,
        length_m=(4.9, 5.9),
        width_m=(1.93, 2.05),
        height_m=(2.0, 2.6),
        sumo="delivery",
    ),
    BodyType(
        kind="truck",
        name="box_truck",
        moving=4,
        parked=1,
        length_m=(6.0, 8.0),
        width_m=(2.2, 2.4),
        height_m=(2.8, 3.4),
        sumo="truck",
        speed_mps=19.0,
    ),
    BodyType(
        kind="bus",
        name="bus",
        moving=4,
        parked=0,
        length_m=(10.5, 12.0),
        width_m=(2.5, 2.55),
        height_m=(3.0, 3.3),
        sumo="bus",
        speed_mps=16.0,
    ),
    BodyType(
        kind="motorcycle",
        name="motorcycle",
        moving=6,
        parked=0,
        length_m=(2.0, 2.2),
        width_m=(0.75, 0.85),
        height_m=(1.6, 1.7),
        sumo="motorcycle",
    ),
    BodyType(
        kind="bicycle",
        name="bicycle",
        moving=9,
        parked=0,
        length_m=(1.7, 1.82),
        width_m=(0.58, 0.66),
        height_m=(1.7, 1.8),
        sumo="bicycle",
        speed_mps=6.0,
    ),
)
ADULT = BodyType(
    kind="pedestrian",
    name="adult",
    moving=0,
    parked=0,
    length_m=(0.42, 0.55),
    width_m=(0.5, 0.65),
    height_m=(1.55, 1.90),
)
CHILD = BodyType(
    kind="pedestrian",
    name="child",
    moving=0,
    parked=0,
    length_m=(0.32, 0.4),
    width_m=(0.38, 0.46),
    height_m=(1.05, 1.4),
)


def draw_body(rng: np.random.Generator, parked: bool) -> BodyType:
    """Draw a body type by its share in moving or parked traffic."""
    share = np.array([body.parked if parked else body.moving for body in VEHICLES], dtype=np.float64)
    return VEHICLES[int(rng.choice(len(VEHICLES), p=share / share.sum()))]


def draw_size(rng: np.random.Generator, body: BodyType) -> tuple[float, float, float]:
    """Draw length, width and height in metres, to the centimetre."""
    ranges = (body.length_m, body.width_m, body.height_m)
    length, width, height = (round(float(rng.uniform(*r)), 2) for r in ranges)
    return length, width, height
