"""Mapping of PandaSet's classes of boxes and points to nuScenes categories."""

from __future__ import annotations

import difflib

from appocc.errors import DataError

_CATEGORY = {
    "Car": "vehicle.car",
    "Pickup Truck": "vehicle.truck",
    "Medium-sized Truck": "vehicle.truck",
    "Semi-truck": "vehicle.truck",
    "Towed Object": "vehicle.trailer",
    "Motorcycle": "vehicle.motorcycle",
    "Other Vehicle - Construction Vehicle": "vehicle.construction",
    "Other Vehicle - Uncommon": "vehicle.car",
    "Other Vehicle - Pedicab": "vehicle.bicycle",
    "Emergency Vehicle": "vehicle.emergency.police",
    "Bus": "vehicle.bus.rigid",
    "Train": "vehicle.bus.bendy",
    "Trolley": "vehicle.bus.bendy",
    "Tram / Subway": "vehicle.bus.bendy",
    "Bicycle": "vehicle.bicycle",
    "Personal Mobility Device": "human.pedestrian.personal_mobility",
    "Motorized Scooter": "human.pedestrian.personal_mobility",
    "Pedestrian": "human.pedestrian.adult",
    "Pedestrian with Object": "human.pedestrian.adult",
    "Animals - Bird": "animal",
    "Animals - Other": "animal",
    "Pylons": "movable_object.trafficcone",
    "Cones": "movable_object.trafficcone",
    "Road Barriers": "movable_object.barrier",
    "Construction Signs": "movable_object.barrier",
    "Temporary Construction Barriers": "movable_object.barrier",
    "Rolling Containers": "movable_object.pushable_pullable",
    "Signs": "static.manmade",
    # Classes of points.
    "Smoke": "noise",
    "Exhaust": "noise",
    "Spray or rain": "noise",
    "Reflection": "noise",
    "Vegetation": "static.vegetation",
    "Ground": "flat.terrain",
    "Road": "flat.driveable_surface",
    "Lane Line Marking": "flat.driveable_surface",
    "Stop Line Marking": "flat.driveable_surface",
    "Other Road Marking": "flat.driveable_surface",
    "Sidewalk": "flat.sidewalk",
    "Driveway": "flat.sidewalk",
    "Building": "static.manmade",
    "Other Static Object": "static.other",
}
_ATTRIBUTE = {"Parked": "vehicle.parked", "Stopped": "vehicle.stopped", "Moving": "vehicle.moving"}


def category_of(label: str) -> str:
    """Return the nuScenes category of a PandaSet class.

    Raises:
        DataError: if PandaSet has no such class.
    """
    if label not in _CATEGORY:
        near = difflib.get_close_matches(label, _CATEGORY, n=1)
        raise DataError(f"PandaSet has no class '{label}'{f'; the nearest is {near[0]!r}' if near else ''}")
    return _CATEGORY[label]


def attribute_of(label: str, motion: str | None) -> str:
    """Return the nuScenes attribute of a box; '' if its motion is unknown or the category has no such attribute."""
    category = category_of(label)
    if category in ("vehicle.bicycle", "vehicle.motorcycle"):
        return ""
    return _ATTRIBUTE.get(motion or "", "") if category.startswith("vehicle.") else ""
