"""Priors: salience and plausibility for an action."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from asking import ask, best, car, row
from street import RED, WHITE, YELLOW, Street

from appocc.bevmap import ROAD
from grounding.query import Query, Referent
from grounding.referent.resolver import resolve
from grounding.vocabulary import Action, Relation, Trigger


@pytest.mark.parametrize(
    ("action", "trigger", "relation", "meant"),
    [
        ("follow", None, "none", "leader"),
        ("park", None, "behind", "parked"),
        ("overtake", None, "none", "leader"),
        ("turn", "pass", "none", "leader"),
    ],
)
def test_actions_suggest_vehicles(action: Action, trigger: Trigger | None, relation: Relation, meant: str) -> None:
    scene = Street().car("parked", 14, -4.5, WHITE).car("leader", 16, 0, WHITE, speed_mps=6).scene()
    query = Query("", action, relation=relation, trigger=trigger, referent=car("white"))
    assert best(resolve(query, scene)) == meant


@pytest.mark.parametrize("action", ["give_way", "wait", "avoid", "slow_down"])
def test_crossing_traffic_gets_the_right_of_way(action: Action) -> None:
    street = Street().car("leader", 16, 0, speed_mps=8).car("crossing", 20, 6, yaw_rad=-np.pi / 2, speed_mps=4)
    scene = street.car("parked", 14, -6).scene()
    found = resolve(Query("", action, referent=car()), scene)
    assert found.candidates[0].item.id == "crossing" or action in ("avoid", "slow_down")
    assert "parked" not in [one.item.id for one in found.candidates[:1]]


def test_words_outweigh_priors() -> None:
    scene = Street().car("parked", 14, -4.5, RED).car("leader", 16, 0, WHITE, speed_mps=6).scene()
    assert best(resolve(Query("", "follow", referent=car("red")), scene)) == "parked"
    assert best(resolve(Query("", "park", relation="behind", referent=car("white")), scene)) == "leader"


def test_objects_ahead_are_more_salient() -> None:
    scene = Street().car("behind", -9, 0).car("ahead", 14, -3).car("far", 38, 20).scene()
    assert best(ask(car(), scene)) == "ahead"


def test_optional_qualifiers_have_a_small_weight() -> None:
    scene = Street().car("l", 12, 5, WHITE).car("r", 12, -5, WHITE).scene()
    found = ask(car("white", qualifiers_optional=("left_side",)), scene)
    assert best(found) == "l"
    assert set(found.candidates[0].fits) == {"car", "white"}


def test_an_occluded_vehicle_is_not_salient() -> None:
    street = Street().car("bus", 16, 4, YELLOW, size_wlh_m=(2.9, 11.0, 3.4), category="vehicle.bus.rigid")
    scene = street.car("hidden", 26, 6.3, WHITE).car("seen", 24, -5, WHITE).scene()
    visible = {item.id: share for item, share in zip(scene.table.items, scene.table.visible_share, strict=True)}
    assert visible == {"bus": 1.0, "hidden": 0.0, "seen": 1.0}
    assert best(ask(car("white"), scene)) == "seen"


def test_vehicles_behind_buildings_are_not_salient() -> None:
    street = Street().car("here", 20, -3, WHITE).car("beyond", 22, 26, WHITE)
    street.occupancy[ROAD, 150:160, :] = 1  # a side street
    assert best(ask(car("white"), street.scene())) == "here"


def test_vehicles_next_to_the_ego_are_not_counted() -> None:
    scene = Street().car("beside", 1.8, -4).car("a", 9, -4).car("b", 16, -4).scene()
    assert [best(ask(car(None, word, "right_side"), scene)) for word in ("first", "second")] == ["a", "b"]


def test_the_car_ahead_is_the_first_of_a_queue() -> None:
    street = Street()
    for i in range(3):
        street.car(str(i), 11 + 7 * i, 0, speed_mps=4)
    assert best(ask(car(None, "ahead"), street.scene())) == "0"
    assert best(resolve(Query("", "follow", referent=car()), street.scene())) == "0"


def lanes() -> Street:
    """Make a street with cars ahead and behind in the ego lane, and nearer cars in the adjacent lanes."""
    street = Street().car("left", 13, 3.5, WHITE, speed_mps=6).car("right", 15, -3.5, WHITE, speed_mps=6)
    street.car("ours", 19, 0, WHITE, speed_mps=6).car("beyond", 32, 0, WHITE, speed_mps=6)
    return street.car("after", -14, 0, WHITE, speed_mps=6).car("beside", -8, 3.5, WHITE, speed_mps=6)


@pytest.mark.parametrize("action", ["follow", "avoid", "stop", "park"])
def test_the_car_in_front_of_us_is_the_one_in_our_lane(action: Action) -> None:
    relation: Relation = "behind" if action in ("stop", "park") else "none"
    for colour in (None, "white"):
        query = Query("", action, relation=relation, referent=car(colour, "ahead", in_line=True))
        assert best(resolve(query, lanes().scene())) == "ours"


def test_the_car_behind_us_is_the_one_in_our_lane() -> None:
    assert best(ask(car(None, "behind_ego", in_line=True), lanes().scene())) == "after"


def test_if_our_lane_is_empty_the_nearest_car_is_in_front_of_us() -> None:
    street = Street().car("near", 12, 3.5, speed_mps=6).car("far", 20, -3.5, speed_mps=6)
    assert best(ask(car(None, "ahead", in_line=True), street.scene())) == "near"


def test_other_words_outweigh_in_front_of_us() -> None:
    scene = lanes().car("red", 24, -3.5, RED, speed_mps=6).scene()
    assert best(ask(car("red", "ahead", in_line=True), scene)) == "red"
    assert best(ask(car(None, "ahead", "left_lane", in_line=True), lanes().scene())) == "left"


def test_ahead_is_not_only_the_lead_vehicle() -> None:
    several = Referent("car", "cars", None, ("ahead",), in_line=True)
    assert ask(several, lanes().scene()).status == "ambiguous"
    assert ask(car(None, "ahead"), lanes().scene()).status == "ambiguous"


def test_without_a_map() -> None:
    scene = replace(row().scene(), bev=None)
    assert best(ask(car(None, "second", "right_side"), scene)) == "r2"
    bare = replace(scene, objects=tuple(replace(item, rgb=None) for item in scene.objects))
    found = ask(car("black", "left_side"), bare)
    assert best(found) == "oncoming"
    assert "its colour is not known: 'black' could not be checked" in found.reasons


def test_the_number_of_candidates_is_limited() -> None:
    street = Street()
    for i in range(9):
        street.car(str(i), 6 + 3.5 * i, -6 + 12 * (i % 2), WHITE, size_wlh_m=(1.5, 3.2, 1.5))
    found = resolve(Query("", referent=car("white")), street.scene(), limit=4)
    assert found.status == "ambiguous"
    assert len(found.candidates) == len(found.differences) == 4
