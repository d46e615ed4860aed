"""The plan of a town: everything that is decided before it is built."""

from __future__ import annotations

from dataclasses import dataclass

from appocc.checks import FloatArray
from appocc.simulation.network import RoadNetwork


@dataclass(frozen=True, eq=False)
class CarPark:
    """An off-street area with parking bays.

    Attributes:
        outline_m: (N, 2) outline, including the driveway to the street, town frame; the first two points are the ends
            of the driveway's mouth at the carriageway.
        bays: (B, 3) x, y of each bay's centre and its yaw (nose in), metres and radians; a bay is 5.0 m x 2.5 m.
    """

    outline_m: FloatArray
    bays: FloatArray


@dataclass(frozen=True)
class TownPlan:
    """Plan of a town; the same plan always gives the same town.

    Attributes:
        name: display name, also used as `log.location`.
        seed: random seed of buildings, trees and road wear.
        style: architectural style: `old` (brick and plaster, pitched roofs), `modern` (flat roofs, glass),
            `suburb` (detached houses, gardens, many trees), `industrial` (industrial buildings, few trees).
        network: streets.
        car_parks: off-street car parks.
    """

    name: str
    seed: int
    style: str
    network: RoadNetwork
    car_parks: tuple[CarPark, ...] = ()
