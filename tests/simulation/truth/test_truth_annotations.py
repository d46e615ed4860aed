from __future__ import annotations

import numpy as np
import pytest
from made_truth_town import made_street

from appocc.boxes import is_vehicle
from appocc.errors import ShapeError
from appocc.geometry import quaternion_from_yaw, transform, yaw_of
from appocc.nuscenes.writer import ATTRIBUTES, CATEGORIES
from appocc.simulation.traffic import Actor, Light
from appocc.simulation.truth.annotations import annotate, attribute_of
from appocc.simulation.truth.objects import category_of, objects_near


def test_rows_hold_category_box_and_visibility() -> None:
    street = made_street(
        [("car", "pickup", (5.2, 2.0, 1.8), 12, 3, 0.5), ("pedestrian", "child", (0.5, 0.5, 1.2), 4, -3, 0.0)]
    )
    around = objects_near(street.actors, street.state, np.zeros(2), 80.0)
    world_from_town = transform(quaternion_from_yaw(np.pi / 2), np.array([1000.0, 2000, 0]))
    truck, child = annotate(around, world_from_town, np.array([7, 0]), np.array([0.9, 0.1]))
    assert (truck.instance, truck.category, truck.visibility, truck.lidar_points) == (
        "actor-0", "vehicle.truck", "4", 7
    )  # fmt: skip
    assert truck.size_wlh_m == (2.0, 5.2, 1.8)
    assert truck.attribute == "vehicle.stopped"
    assert truck.world_from_box[:3, 3] == pytest.approx([1000 - 3, 2000 + 12, 0.9])
    assert yaw_of(truck.world_from_box) == pytest.approx(np.pi / 2 + 0.5)
    assert (child.category, child.visibility, child.attribute) == ("human.pedestrian.child", "1", "")


@pytest.mark.parametrize(
    ("kind", "lights", "speed", "attribute"),
    [
        ("car", 0, 5.0, "vehicle.moving"),
        ("car", Light.BRAKE, 0.0, "vehicle.stopped"),
        ("bus", Light.PARKED, 0.0, "vehicle.parked"),
        ("motorcycle", 0, 8.0, "cycle.with_rider"),
        ("bicycle", Light.PARKED, 0.0, "cycle.without_rider"),
        ("pedestrian", 0, 1.0, ""),
    ],
)
def test_attributes(kind: str, lights: int, speed: float, attribute: str) -> None:
    assert attribute_of(kind, lights, speed) == attribute
    assert not attribute or attribute in ATTRIBUTES


def test_every_body_has_a_category_of_nuscenes() -> None:
    bodies = [
        "sedan",
        "hatchback",
        "estate",
        "suv",
        "pickup",
        "minivan",
        "van",
        "box_truck",
        "bus",
        "motorcycle",
        "bicycle",
        "adult",
        "child",
    ]
    found = {body: category_of(Actor("x", "", body, (1.0, 1.0, 1.0))) for body in bodies}
    assert set(found.values()) <= set(CATEGORIES)
    assert [body for body in bodies if not is_vehicle(found[body])] == ["bicycle", "adult", "child"]
    with pytest.raises(ShapeError, match="expected a body of"):
        category_of(Actor("x", "", "tank", (1.0, 1.0, 1.0)))
