from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from street import BLACK, BLUE, RED, SILVER, WHITE, Street

from grounding.query import Referent
from grounding.referent.predicates import QUALIFIERS, fit_words
from grounding.referent.scene import SceneModel

SIZES = {
    "bus": ("vehicle.bus.rigid", (2.9, 11.0, 3.4)),
    "truck": ("vehicle.truck", (2.5, 8.0, 3.2)),
    "pickup": ("vehicle.truck", (2.0, 5.4, 1.9)),
    "van": ("vehicle.car", (2.0, 5.4, 2.3)),
    "suv": ("vehicle.car", (1.9, 4.7, 1.75)),
    "sedan": ("vehicle.car", (1.8, 4.7, 1.45)),
    "hatchback": ("vehicle.car", (1.75, 4.0, 1.5)),
    "motorcycle": ("vehicle.motorcycle", (0.8, 2.2, 1.5)),
    "trailer": ("vehicle.trailer", (2.5, 10.0, 3.5)),
    "digger": ("vehicle.construction", (2.5, 6.0, 3.0)),
    "ambulance": ("vehicle.emergency.ambulance", (2.2, 6.0, 2.6)),
    "bicycle": ("vehicle.bicycle", (0.6, 1.7, 1.6)),
    "person": ("human.pedestrian.adult", (0.6, 0.6, 1.8)),
}


def sizes() -> SceneModel:
    street = Street()
    for i, (name, (category, size)) in enumerate(SIZES.items()):
        street.car(name, -36 + 12 * (i % 7), 5 if i < 7 else -5, size_wlh_m=size, category=category)
    return street.scene()


def value(referent: Referent, scene: SceneModel, name: str, word: str | None = None) -> float:
    row = next(i for i, item in enumerate(scene.table.items) if item.id == name)
    return float(fit_words(referent, scene)[word or referent.head][row])


def said(qualifier: str, scene: SceneModel) -> dict[str, float]:
    """Return the membership of each object in a qualifier, by id."""
    fit = QUALIFIERS[qualifier](scene.table)
    return {item.id: float(fit[i]) for i, item in enumerate(scene.table.items)}


@pytest.mark.parametrize(
    ("noun", "head", "best", "also", "never"),
    [
        ("car", "car", {"sedan", "suv", "hatchback"}, {"van"}, {"bus", "motorcycle", "bicycle", "person"}),
        ("car", "sedan", {"sedan", "hatchback"}, {"suv"}, {"van", "truck", "pickup"}),
        ("car", "suv", {"suv"}, {"sedan"}, {"truck", "bus"}),
        ("car", "hatchback", {"hatchback"}, {"sedan"}, {"van", "truck"}),
        ("van", "van", {"van", "ambulance"}, set(), {"sedan", "hatchback", "bus", "truck", "pickup"}),
        ("truck", "truck", {"truck", "pickup"}, {"van", "trailer", "digger"}, {"sedan", "bus"}),
        ("truck", "pickup truck", {"pickup"}, set(), {"truck", "van", "sedan"}),
        ("truck", "lorry", {"truck"}, {"pickup"}, {"sedan"}),
        ("bus", "bus", {"bus"}, set(), {"truck", "van", "trailer"}),
        ("trailer", "trailer", {"trailer"}, {"truck"}, {"bus", "sedan"}),
        ("motorcycle", "motorcycle", {"motorcycle"}, set(), {"sedan", "person"}),
        ("motorcycle", "bike", {"motorcycle", "bicycle"}, set(), {"sedan", "person"}),
        ("bicycle", "bicycle", {"bicycle"}, set(), {"sedan", "person"}),
        ("construction_vehicle", "digger", {"digger"}, set(), {"bus", "sedan"}),
        ("person", "man", {"person"}, set(), {"motorcycle", "bicycle", "sedan"}),
        ("vehicle", "vehicle", {*SIZES} - {"person", "bicycle"}, {"bicycle"}, {"person"}),
        ("lamp_post", "lamp post", set(), set(), set(SIZES)),
    ],
)
def test_classes_and_sizes(noun: str, head: str, best: set[str], also: set[str], never: set[str]) -> None:
    scene, referent = sizes(), Referent(noun, head)
    fit = {name: value(referent, scene, name) for name in SIZES}
    assert {name for name in SIZES if fit[name] > 0.65} == best, fit
    assert all(0.1 < fit[name] < 0.65 for name in also), fit
    assert all(fit[name] <= 0.1 for name in never), fit


def test_length_decides_the_class_of_a_shape() -> None:
    scene = Street().car("c", 10, -5).car("b", 22, 5, size_wlh_m=SIZES["bus"][1]).scene_without_boxes()
    car, bus = sorted(scene.objects, key=lambda item: item.length_m)
    assert value(Referent("car", "car"), scene, car.id) > 0.9
    assert value(Referent("bus", "bus"), scene, bus.id) > 0.9
    assert value(Referent("bus", "bus"), scene, car.id) < 0.01
    assert value(Referent("motorcycle", "bike"), scene, car.id) < 0.01
    # Parked cars merge on predicted maps.
    assert value(Referent("car", "car"), scene, bus.id) == pytest.approx(0.3)


def test_lengths_on_a_predicted_map_are_less_reliable() -> None:
    street = Street().car("van", 12, -5, size_wlh_m=(2.0, 5.6, 2.2))
    sure = street.scene_without_boxes()
    street.occupancy *= 0.9
    unsure = street.scene_without_boxes()
    van = Referent("van", "van")
    assert value(van, sure, "blob 0") > value(van, unsure, "blob 0") > 0.12
    assert value(Referent("car", "car"), unsure, "blob 0") > value(Referent("car", "car"), sure, "blob 0")


@pytest.mark.parametrize(
    ("colour", "best"),
    [
        ("red", "r"),
        ("white", "w"),
        ("black", "k"),
        ("blue", "b"),
        ("silver", "s"),
        ("dark blue", "b"),
        ("light", "w"),
    ],
)
def test_colours(colour: str, best: str) -> None:
    street = Street().car("r", 8, -5, RED).car("w", 14, -5, WHITE).car("k", 20, -5, BLACK).car("b", 26, -5, BLUE)
    scene = street.car("s", 32, -5, SILVER).scene()
    fit = {name: value(Referent("car", "car", colour), scene, name, colour) for name in "rwkbs"}
    assert max(fit, key=lambda name: fit[name]) == best


def test_unknown_colours() -> None:
    none = Street().car("a", 8, -5, None).scene()
    assert value(Referent("car", "car", "red"), none, "a", "red") == 0.5
    some = Street().car("a", 8, -5, None).car("b", 14, -5, RED).scene()
    # Its colour is unknown, but more vehicles are white than green.
    assert value(Referent("car", "car", "white"), some, "a", "white") == pytest.approx(0.35)
    assert value(Referent("car", "car", "green"), some, "a", "green") == pytest.approx(0.045)


def street() -> SceneModel:
    """Make a street: two lanes in ego direction, parked cars on the right, oncoming traffic on the left, and more."""
    made = Street().car("leader", 20, 0, speed_mps=8).car("left lane", 12, 3.5, speed_mps=9)
    made.car("oncoming", 25, 7, yaw_rad=np.pi, speed_mps=9).car("parked", 14, -3.6).car(
        "follower", -12, 0, speed_mps=8
    )
    made.car("stopped", 30, 0).car("turning", 34, -4, yaw_rad=-0.7, speed_mps=3)
    return made.car("starting", 24, -3.4, yaw_rad=0.25, speed_mps=1.0).car("facing", 36, 7, yaw_rad=np.pi).scene()


@pytest.mark.parametrize(
    ("qualifier", "yes", "no"),
    [
        ("left_side", {"left lane", "oncoming", "facing"}, {"leader", "parked", "turning"}),
        ("right_side", {"parked", "turning", "starting"}, {"leader", "left lane", "oncoming"}),
        ("opposite_side", {"oncoming", "facing"}, {"leader", "parked", "left lane"}),
        ("own_side", {"leader", "parked", "left lane"}, {"oncoming", "facing"}),
        ("own_lane", {"leader", "stopped", "follower"}, {"parked", "left lane", "oncoming"}),
        ("left_lane", {"left lane"}, {"parked", "starting"}),
        ("other_lane", {"left lane", "oncoming", "parked"}, {"leader", "stopped"}),
        ("ahead", {"leader", "stopped"}, {"follower"}),
        ("behind_ego", {"follower"}, {"leader", "parked", "oncoming"}),
        ("parked", {"parked", "facing"}, {"leader", "oncoming", "turning"}),
        ("stopped", {"stopped", "parked"}, {"leader", "oncoming", "turning"}),
        ("moving", {"leader", "oncoming", "turning"}, {"parked", "stopped"}),
        ("oncoming", {"oncoming"}, {"leader", "parked", "facing"}),
        ("same_way", {"leader", "parked", "starting"}, {"oncoming", "facing"}),
        ("turning", {"turning"}, {"leader", "oncoming", "parked"}),
        ("turning_right", {"turning"}, {"leader", "oncoming", "parked"}),
        ("turning_left", set(), {"leader", "oncoming", "parked", "turning"}),
        ("leaving", {"starting"}, {"leader", "oncoming", "stopped"}),
        ("passing", {"left lane"}, {"parked", "oncoming", "stopped"}),
    ],
)
def test_qualifiers(qualifier: str, yes: set[str], no: set[str]) -> None:
    fit = said(qualifier, street())
    assert all(fit[name] > 0.55 for name in yes), fit
    assert all(fit[name] < 0.3 for name in no), fit


def test_right_and_middle_lanes_depend_on_the_number_of_lanes() -> None:
    made = Street().car("l", 15, 3.5, speed_mps=8).car("own", 20, 0, speed_mps=8).car("r", 25, -3.5, speed_mps=8)
    made.occupancy[0] = 0
    made.occupancy[0][:, np.abs(made.grid.centres()[0, :, 1]) < 5.3] = 1
    scene = made.scene()
    assert (scene.lanes.lowest, scene.lanes.highest) == (-1, 1)
    assert said("middle_lane", scene) == pytest.approx({"l": 0.135, "own": 1.0, "r": 0.135}, abs=0.02)
    assert said("right_lane", scene)["r"] > 0.95
    assert said("right_lane", scene)["own"] < 0.35


def test_the_outermost_ego_lane_is_the_right_lane() -> None:
    made = Street().car("own", 20, 0, speed_mps=8).car("left", 15, 3.5, speed_mps=8)
    made.occupancy[0] = 0
    made.occupancy[0][:, (made.grid.centres()[0, :, 1] > -1.8) & (made.grid.centres()[0, :, 1] < 5.3)] = 1
    assert said("right_lane", made.scene())["own"] > 0.55


def test_yaw_rates_and_accelerations_override_headings() -> None:
    scene = Street().car("a", 20, 3, speed_mps=6).scene()
    (item,) = scene.objects

    def changing(yaw_rate_radps: float, acceleration_mps2: float) -> SceneModel:
        changed = replace(item, yaw_rate_radps=yaw_rate_radps, acceleration_mps2=acceleration_mps2)
        return replace(scene, objects=(changed,))

    assert said("turning_left", changing(0.4, 0))["a"] > 0.95
    assert said("turning_right", changing(0.4, 0))["a"] < 0.05
    assert said("turning", changing(-0.4, 0))["a"] > 0.95
    assert said("turning", changing(0, 0))["a"] < 0.1
    assert said("braking", scene)["a"] == pytest.approx(0.5, abs=0.01)
    assert said("braking", changing(0, -3.0))["a"] > 0.95
    assert said("braking", changing(0, 1.0))["a"] < 0.01


def test_unknown_values_have_half_membership() -> None:
    scene = Street().car("a", 20, 0).scene_without_boxes()
    assert {word: round(said(word, scene)["blob 0"], 2) for word in ("parked", "stopped", "moving", "oncoming")} == {
        "parked": 0.3,  # and it stands in our lane
        "stopped": 0.5,
        "moving": 0.5,
        "oncoming": 0.28,
    }


@pytest.mark.parametrize(
    ("noun", "large", "small"),
    [("car", (1.9, 5.0, 1.6), (1.7, 3.9, 1.5)), ("truck", (2.5, 9.0, 3.5), (2.0, 5.3, 1.9))],
)
def test_large_and_small_depend_on_the_class(
    noun: str, large: tuple[float, float, float], small: tuple[float, float, float]
) -> None:
    street = Street().car("l", 10, 5, size_wlh_m=large, category=f"vehicle.{noun}")
    scene = street.car("s", 10, -5, size_wlh_m=small, category=f"vehicle.{noun}").scene()
    for word, best, other in (("large", "l", "s"), ("small", "s", "l")):
        referent = Referent(noun, noun, qualifiers=(word,))
        assert value(referent, scene, best, word) > 0.6 > 0.4 > value(referent, scene, other, word)


def test_ordinals_are_not_predicates() -> None:
    scene = Street().car("a", 10, 5).scene()
    referent = Referent("car", "car", "white", ("second", "left_side", "nearest"))
    assert set(fit_words(referent, scene)) == {"car", "white", "left side"}


def test_every_qualifier_of_commands_has_a_predicate() -> None:
    counted = {"first", "second", "third", "fourth", "next", "last", "nearest", "farthest", "leftmost", "rightmost"}
    counted |= {"largest", "smallest", "large", "small"}
    assert set(QUALIFIERS) | counted == counted | {
        *(
            "facing_us",
            "in_row",
            "left_side",
            "right_side",
            "opposite_side",
            "own_side",
            "own_lane",
            "left_lane",
            "right_lane",
            "other_lane",
        ),
        *("middle_lane", "ahead", "behind_ego", "parked", "stopped", "moving", "oncoming", "same_way", "turning"),
        *("turning_left", "turning_right", "leaving", "passing", "braking", "beside_ego"),
    }


def test_an_empty_scene_has_empty_memberships() -> None:
    scene = Street().scene()
    every = Referent("car", "car", "red", tuple(QUALIFIERS))
    assert {fit.shape for fit in fit_words(every, scene).values()} == {(0,)}
