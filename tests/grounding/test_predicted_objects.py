"""Commands on predicted maps: classes, paints and people are those of the map's objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_map import WHITE
from made_objects import made_object, objects_of_boxes, together
from made_scene import with_maps
from street import BLUE, RED, WORLD_FROM_EGO, Street
from tiny_dataset import TinyDataset

from appocc.bevmap import VEHICLE, BEVMap, bev_path, load_map
from appocc.geometry import inverse
from appocc.objects import BEVObjects
from grounding import Answer, Grounder
from grounding.pipeline import set_key_frame
from grounding.referent.scene import scene_from_map


def paint(rgb: tuple[int, int, int]) -> tuple[float, ...]:
    return tuple(float(value) for value in rgb)


def predicted(*parts: BEVObjects) -> BEVMap:
    """A predicted map that shows a grey smear for each vehicle, with objects."""
    objects, street = together(*parts), Street()
    for place, size in zip(objects.centre_m[objects.are_vehicles], objects.size_wlh_m, strict=False):
        street.car("smear", float(place[0]), float(place[1]), (120, 120, 120), size_wlh_m=tuple(size.tolist()))
    bev = street.bev()
    occupancy = bev.occupancy.copy()
    occupancy[VEHICLE] *= 0.7
    return replace(bev, occupancy=occupancy, objects=objects)


def ask(text: str, *parts: BEVObjects) -> Answer:
    grounder = Grounder()
    grounder.set_scene(predicted(*parts), None, WORLD_FROM_EGO)
    return grounder.ground(text)


UNKNOWN = (np.nan, np.nan)
CARS = (
    made_object("car", 12.0, -5.0, rgb=paint(RED)),
    made_object("car", 26.0, -5.0, rgb=paint(BLUE)),
    made_object("bus", 30.0, 5.0, rgb=paint(WHITE), yaw_rad=np.pi),
)


@pytest.mark.parametrize(
    ("text", "centre_m"),
    [
        ("park behind the red car", (12, -5)),
        ("park behind the blue car", (26, -5)),
        ("stop beside the bus", (30, 5)),
    ],
)
def test_class_and_paint_are_those_of_the_objects(text: str, centre_m: tuple[float, float]) -> None:
    answer = ask(text, *CARS)
    assert answer.status == "ok", answer.reasons
    assert answer.referent is not None
    assert tuple(answer.referent.item.centre_m) == centre_m


@pytest.mark.parametrize(("noun", "x_m"), [("sedan", 10), ("van", 20), ("pickup", 36), ("transit van", 20)])
def test_cars_vans_and_pickups_are_told_apart_by_their_predicted_size(noun: str, x_m: float) -> None:
    """Networks find all of them as cars."""
    sizes = {
        10: (1.8, 4.6, 1.45),
        20: (2.0, 5.5, 2.3),
        36: (2.0, 5.4, 1.88),
        28: (1.9, 4.6, 1.7),
    }
    parked = (made_object("car", float(x), -5.0, size_wlh_m=size) for x, size in sizes.items())
    answer = ask(f"stop beside the {noun}", *parked)
    assert answer.referent is not None, answer.reasons
    assert answer.referent.item.centre_m[0] == x_m, answer.reasons


@pytest.mark.parametrize(
    ("velocity_mps", "state"),
    [((0.0, 0.0), "standing"), ((5.0, 0.0), "moving at 5 m/s"), (UNKNOWN, "speed not known")],
)
def test_velocities_of_the_map_are_told(velocity_mps: tuple[float, float], state: str) -> None:
    answer = ask("stop before the bus", made_object("bus", 24.0, 0.0, rgb=paint(WHITE), velocity_mps=velocity_mps))
    assert any("'bus' is" in reason and state in reason for reason in answer.reasons), answer.reasons


def test_a_goal_before_a_person() -> None:
    answer = ask("stop before the pedestrian", *CARS, made_object("pedestrian", 15.0, 0.0, velocity_mps=UNKNOWN))
    assert answer.status == "ok", answer.reasons
    assert answer.target is not None
    assert answer.referent is not None
    assert answer.referent.item.class_name == "person"
    assert 5 < answer.target.ego_m[0] < 15
    assert "'pedestrian' is the person 14 m away, ahead, speed not known" in answer.reasons
    without = ask("stop before the pedestrian", *CARS)
    assert without.status == "not_found"
    assert without.reasons[0] == "only vehicles are known here, and no people"


def test_a_cyclist() -> None:
    answer = ask("follow the cyclist", *CARS, made_object("bicycle", 14.0, 0.0, velocity_mps=(4.0, 0.0)))
    assert answer.status == "ok", answer.reasons
    assert answer.referent is not None
    assert answer.referent.item.category == "bicycle"


def test_only_detected_objects_are_there() -> None:
    unsure = made_object("car", 12.0, 5.0, rgb=paint(RED), score=0.3)
    assert len(scene_from_map(predicted(*CARS, unsure), WORLD_FROM_EGO).objects) == 3
    sure = replace(predicted(*CARS, unsure), meta={"object_threshold": 0.3})
    assert len(scene_from_map(sure, WORLD_FROM_EGO).objects) == 4


def test_what_is_known_of_an_object() -> None:
    scene = scene_from_map(
        predicted(
            made_object("truck", 12.0, -5.0, rgb=paint(RED), velocity_mps=(3.0, 0.0), yaw_rad=0.1),
            made_object("car", 20.0, -5.0, rgb=(np.nan,) * 3, velocity_mps=(np.nan,) * 2),
            made_object("pedestrian", 9.0, 4.0, rgb=paint(RED)),
        ),
        WORLD_FROM_EGO,
    )
    truck, car = scene.objects
    (person,) = scene.others
    assert (truck.id, truck.class_name, truck.speed_mps, truck.yaw_rad, truck.front_known) == (
        *("object 0", "truck", 3.0, 0.1),
        True,
    )
    assert (truck.length_m, truck.width_m, truck.height_m) == (7.5, 2.4, 2.8)
    assert scene.colour_name(truck) == "red"
    assert (car.rgb, car.velocity_mps) == (None, None)
    assert (person.class_name, person.rgb) == ("person", None)


def test_a_map_whose_network_detects_nothing_has_no_vehicles() -> None:
    bev = predicted(*CARS)
    none = replace(bev, objects=together(*CARS).select(np.zeros(3, np.bool_)))
    assert scene_from_map(none, WORLD_FROM_EGO).objects == ()
    assert len(scene_from_map(replace(bev, objects=None), WORLD_FROM_EGO).objects) == 3


def test_a_key_frame_of_a_predicted_source(tiny: TinyDataset) -> None:
    """The tiny dataset's own boxes as predictions: a parked car ahead, a pedestrian to the left."""
    dataset = with_maps(tiny, "model")
    sample = dataset.samples(dataset.scenes[0])[0]
    bev = load_map(tiny.root, "model", sample.token)
    boxes = dataset.boxes_world(sample).transformed(inverse(dataset.world_from_ego(sample)))
    objects = objects_of_boxes(boxes, np.tile(np.array(WHITE, np.float64), (len(boxes), 1)))
    occupancy = bev.occupancy.copy()
    occupancy[0] = 1
    replace(bev, occupancy=occupancy, objects=objects).save(bev_path(tiny.root, "model", sample.token))
    grounder = Grounder()
    set_key_frame(grounder, dataset, sample, "model", images=False)
    for text, category in (("stop next to the pedestrian", "pedestrian"), ("stop behind the white car", "car")):
        answer = grounder.ground(text)
        assert answer.status == "ok", answer.reasons
        assert answer.referent is not None
        # The class car includes vans: the size decides.
        assert answer.referent.item.category == ("" if category == "car" else category)
