"""Cars, pickups and vans: a lower body with wheel arches and a cabin."""

from __future__ import annotations

from appocc.simulation.actors.cabins import Cabin
from appocc.simulation.actors.car_ends import CarFrontRear
from appocc.simulation.actors.car_frame import SHARE_LOW
from appocc.simulation.actors.car_sides import CarSides
from appocc.simulation.actors.materials import CHROME, DARK_HUB, GREY_TRIM, GRILLE, PAINT
from appocc.simulation.actors.modelling import Modeller
from appocc.simulation.actors.profiles import car_profile
from appocc.simulation.actors.wheels import add_wheels


def model_car(body: str, variant: int, detail: int) -> Modeller:
    """Model a car, pickup or van."""
    profile = car_profile(body, variant)
    model = Modeller(profile.size_lwh_m)
    CarSides(model, profile, detail).build()
    front_rear = CarFrontRear(model, profile, detail)
    front_rear.add_end(front=True, grille=(GRILLE, CHROME, GREY_TRIM)[variant])
    front_rear.add_end(front=False, grille=PAINT)
    front_rear.add_bonnet()
    if profile.bed:
        front_rear.add_bed()
    else:
        front_rear.add_boot()
    Cabin(model, profile, detail).build()
    half = profile.size_lwh_m[1] / 2
    hub = (CHROME, DARK_HUB, CHROME)[variant]
    outer = half * SHARE_LOW - 0.012 if detail == 0 else half - 0.006
    add_wheels(model, profile.axles_x_m, profile.wheel_m, outer, 0.21, hub=hub, detail=detail)
    return model
