"""The plan of a town: everything that is decided before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass

from appocc.checks import FloatArray
from appocc.simulation.network import RoadNetwork


@dataclass(frozen=True)
class CarPark:
    """An area beside a street where cars stand in bays.

    Attributes:
        outline_m: (N, 2) outline, the driveway to the street included, town frame; the first two points are the ends
            of the driveway's mouth at the carriageway.
        bays: (B, 3) x, y of each bay's centre and its yaw (nose in), metres and radians; a bay is 5.0 m x 2.5 m.
    """

    outline_m: FloatArray
    bays: FloatArray


@dataclass(frozen=True)
class TownPlan:
    """A town to be built: the same plan always gives the same town.

    Attributes:
        name: for people, and for `log.location`.
        seed: of all that is made up: buildings, trees, wear of the road.
        style: look of the buildings: `old` (brick and plaster, pitched roofs), `modern` (flat roofs, glass),
            `suburb` (detached houses, gardens, many trees), `industrial` (halls, few trees).
        network: streets.
        car_parks: areas beside them.
    """

    name: str
    seed: int
    style: str
    network: RoadNetwork
    car_parks: tuple[CarPark, ...] = ()
