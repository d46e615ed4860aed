"""Types of KITTI and labels of KITTI-360 in nuScenes' terms; those without one are left out.

KITTI's cyclist is a box around cycle and rider, as is nuScenes' bicycle; a rider of KITTI-360 has a box of its own
and is left out, because in nuScenes it belongs to the box of its cycle.
"""

from __future__ import annotations

from collections.abc import Mapping

CATEGORIES: Mapping[str, str] = {
    # KITTI
    "Car": "vehicle.car",
    "Van": "vehicle.car",
    "Truck": "vehicle.truck",
    "Tram": "vehicle.bus.bendy",
    "Cyclist": "vehicle.bicycle",
    "Pedestrian": "human.pedestrian.adult",
    "Person": "human.pedestrian.adult",
    "Person (sitting)": "human.pedestrian.adult",
    "Person_sitting": "human.pedestrian.adult",
    # KITTI-360
    "bicycle": "vehicle.bicycle",
    "bus": "vehicle.bus.rigid",
    "car": "vehicle.car",
    "caravan": "vehicle.trailer",
    "motorcycle": "vehicle.motorcycle",
    "pedestrian": "human.pedestrian.adult",
    "person": "human.pedestrian.adult",
    "trailer": "vehicle.trailer",
    "train": "vehicle.bus.bendy",
    "truck": "vehicle.truck",
}
# KITTI-360's numbers of labels (semanticId).
LABEL_IDS: Mapping[int, str] = {
    13: "car",
    14: "truck",
    15: "trailer",
    16: "caravan",
    17: "motorcycle",
    18: "bicycle",
    19: "person",
    20: "rider",
    33: "train",
    34: "bus",
}
# Cycles whose box includes a rider.
RIDDEN = frozenset({"Cyclist"})
