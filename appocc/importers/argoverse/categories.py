"""Categories of Argoverse 2 in nuScenes' terms; those without one are left out.

Riders (BICYCLIST, MOTORCYCLIST) are left out too: in nuScenes they belong to the box of their cycle.
"""

from __future__ import annotations

from collections.abc import Mapping

CATEGORIES: Mapping[str, str] = {
    "ANIMAL": "animal",
    "ARTICULATED_BUS": "vehicle.bus.bendy",
    "BICYCLE": "vehicle.bicycle",
    "BOX_TRUCK": "vehicle.truck",
    "BUS": "vehicle.bus.rigid",
    "CONSTRUCTION_BARREL": "movable_object.barrier",
    "CONSTRUCTION_CONE": "movable_object.trafficcone",
    "DOG": "animal",
    "LARGE_VEHICLE": "vehicle.truck",
    "MESSAGE_BOARD_TRAILER": "vehicle.trailer",
    "MOTORCYCLE": "vehicle.motorcycle",
    "OFFICIAL_SIGNALER": "human.pedestrian.adult",
    "PEDESTRIAN": "human.pedestrian.adult",
    "RAILED_VEHICLE": "vehicle.bus.bendy",
    "REGULAR_VEHICLE": "vehicle.car",
    "SCHOOL_BUS": "vehicle.bus.rigid",
    "STROLLER": "human.pedestrian.stroller",
    "TRAFFIC_LIGHT_TRAILER": "vehicle.trailer",
    "TRUCK": "vehicle.truck",
    "TRUCK_CAB": "vehicle.truck",
    "VEHICULAR_TRAILER": "vehicle.trailer",
    "WHEELCHAIR": "human.pedestrian.wheelchair",
    "WHEELED_DEVICE": "human.pedestrian.personal_mobility",
    "WHEELED_RIDER": "human.pedestrian.personal_mobility",
}
