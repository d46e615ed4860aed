from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from street import BLACK, BLUE, GREEN, GREY, RED, SILVER, WHITE, YELLOW, Street

from appocc.bevmap import ROAD
from appocc.errors import DataError
from appocc.files import write_json
from benchmarks.real_commands import main, measure
from grounding.query import Exclusion, Landmark, Query, Referent
from grounding.resolve import Resolution, forbidden, resolve
from grounding.scene import Scene

SIZES = {
    "vehicle.bus.rigid": (2.9, 11.0, 3.4),
    "vehicle.truck": (2.5, 8.0, 3.2),
    "vehicle.motorcycle": (0.8, 2.2, 1.5),
    "vehicle.car": (1.8, 4.4, 1.5),
}
VAN = (2.0, 5.4, 2.3)


def car(colour: str | None = None, *qualifiers: str, **more: Any) -> Referent:
    return Referent("car", "car", colour, qualifiers, **more)


def ask(referent: Referent, scene: Scene) -> Resolution:
    return resolve(Query("", referent=referent), scene)


def best(found: Resolution) -> str:
    assert found.status == "ok", found
    return found.candidates[0].item.id


def row() -> Street:
    """Cars parked on the right, one oncoming and one driving ahead, one behind us."""
    street = Street().car("r1", 8, -5, RED).car("r2", 14, -5, WHITE).car("r3", 20, -5, BLUE).car("r4", 26, -5, WHITE)
    street.car("oncoming", 25, 3, BLACK, yaw_rad=np.pi, speed_mps=9.0)
    street.car("leader", 18, 0, GREY, speed_mps=6.0)
    return street.car("follower", -12, 0, RED, speed_mps=6.0)


@pytest.mark.parametrize(
    ("referent", "meant"),
    [
        (car("blue"), "r3"),
        (car("white", "nearest"), "r2"),
        (car("white", "farthest"), "r4"),
        (car(None, "first", "right_side"), "r1"),
        (car(None, "next", "right_side"), "r1"),
        (car(None, "second", "right_side"), "r2"),
        (car(None, "third", "right_side"), "r3"),
        (car(None, "fourth", "right_side"), "r4"),
        (car(None, "last", "right_side"), "r4"),
        (car("white", "second"), "r4"),
        (car("white", "second", "nearest"), "r4"),
        (car("black", "left_side"), "oncoming"),
        (car(None, "oncoming"), "oncoming"),
        (car("grey", "ahead"), "leader"),
        (car(None, "own_lane"), "leader"),
        (car(None, "behind_ego"), "follower"),
        (car("red"), "r1"),
        (car("red", "behind_ego"), "follower"),
        (car("red", "moving"), "follower"),
        (Referent("vehicle", "vehicle", None, ("leftmost",)), "oncoming"),
        (car("white", definite=False), "r2"),
        (car("dark", "left_side"), "oncoming"),
    ],
)
def test_the_vehicle_meant(referent: Referent, meant: str) -> None:
    assert best(ask(referent, row().scene())) == meant


@pytest.mark.parametrize(
    ("qualifiers", "meant"),
    [
        (("first", "leftmost"), "l"),
        (("second", "leftmost"), "m"),
        (("second", "rightmost"), "n"),
        (("last", "leftmost"), "r"),
        (("last", "rightmost"), "l"),
        (("second",), "n"),
        (("third", "nearest"), "m"),
        (("second", "largest"), "m"),
        (("smallest",), "r"),
    ],
)
def test_counting(qualifiers: tuple[str, ...], meant: str) -> None:
    street = Street().car("l", 30, 6, size_wlh_m=(2.0, 5.4, 1.5)).car("m", 22, 2, size_wlh_m=(1.9, 5.0, 1.5))
    street.car("n", 14, -2, size_wlh_m=(1.8, 4.4, 1.5)).car("r", 6, -6, size_wlh_m=(1.6, 3.6, 1.5))
    assert best(ask(car(None, *qualifiers), street.scene())) == meant


def test_a_row_is_counted_though_each_hides_the_next() -> None:
    street = Street()
    for i in range(5):
        street.car(str(i), 9 + 6 * i, 0, speed_mps=5)
    scene = street.scene()
    assert scene.crowd.visible.tolist() == [1, 0, 0, 0, 0]
    assert [best(ask(car(None, word), scene)) for word in ("first", "second", "third")] == ["0", "1", "2"]


def test_two_alike_are_ambiguous_and_only_they_are_listed() -> None:
    found = ask(car("white"), row().scene())
    assert found.status == "ambiguous"
    assert {one.item.id for one in found.candidates} == {"r2", "r4"}
    assert "2 vehicles fit 'white car'" in found.reasons[0]
    assert found.differences == ("the white car, 14 m ahead", "the one, 25 m ahead")
    assert found.question == "the white car, 14 m ahead, or the one, 25 m ahead?"


def test_equally_far_is_ambiguous() -> None:
    scene = Street().car("left", 10, 4, WHITE).car("right", 10, -4, WHITE).scene()
    found = ask(car(None, "nearest"), scene)
    assert found.status == "ambiguous"
    assert "on the left" in found.question
    assert best(ask(car(None, "nearest", "left_side"), scene)) == "left"


@pytest.mark.parametrize("colour", ["silver", "grey"])
def test_one_vehicle_that_could_be_silver_or_grey_is_no_tie_when_alone(colour: str) -> None:
    scene = Street().car("s", 12, -4, SILVER).car("b", 18, -4, BLACK).scene()
    assert best(ask(car(colour), replace(scene, bev=None))) == "s"


def test_absent_gives_the_nearest_misses_and_what_lacks() -> None:
    found = ask(Referent("bus", "bus", "pink"), row().scene())
    assert found.status == "not_found"
    assert 0 < len(found.candidates) <= 3
    assert "none of the 7 here is 'bus'" in found.reasons
    assert "none of the 7 here is 'pink'" in found.reasons


def test_each_word_may_be_met_and_no_vehicle_meet_all() -> None:
    found = ask(car("red", "left_side"), Street().car("a", 9, -4, RED).car("b", 9, 4, BLUE).scene())
    assert found.status == "not_found"
    assert found.reasons == ("nothing here fits 'red car on the left'",)


def test_too_few_to_count_to() -> None:
    found = ask(car("white", "fourth"), row().scene())
    assert found.status == "not_found"
    assert "no vehicle is the 'fourth' one: 2 fit" in found.reasons[0]


def test_an_empty_street() -> None:
    scene = Street().scene()
    found = ask(car(), scene)
    assert (found.status, found.candidates, found.reasons) == ("not_found", (), ("the map shows no vehicle",))
    assert ask(car(), replace(scene, bev=None)).reasons == ("no vehicle is known here",)
    assert ask(Referent("person", "man"), scene).reasons == ("only vehicles are known here, and no people",)


def test_no_vehicle_is_named() -> None:
    found = resolve(Query("", "pull_over", excluded=(Exclusion("on", "double_yellow_line"),)), row().scene())
    assert (found.status, found.candidates) == ("ok", ())
    assert found.reasons == ("the map holds no double yellow line: it was left out",)


def test_a_vehicle_that_only_the_goal_names_is_looked_for() -> None:
    query = Query("", "stop", relation="next_to", landmark="secondary", secondary=(Landmark("car", "next_to"),))
    assert best(resolve(query, Street().car("a", 12, -4).scene())) == "a"


def test_an_unknown_colour_is_told() -> None:
    scene = Street().car("unknown", 10, -4, None).scene()
    found = ask(car("white"), scene)
    assert best(found) == "unknown"
    assert "its colour is not known: 'white' could not be checked" in found.reasons
    # What certainly is not green beats what may be anything, but not where green is seldom.
    seen = Street().car("unknown", 10, -4, None).car("red", 16, -4, RED).scene()
    assert ask(car("green"), seen).status == "not_found"


def test_a_colour_that_hardly_fits_is_told() -> None:
    found = ask(car("grey"), Street().car("w", 10, -4, (205, 205, 207)).scene())
    assert (
        (found.status == "not_found")
        or "rather than grey" in found.reasons[-1]
        or found.candidates[0].fits["grey"] > 0.35
    )


def test_people_and_bicycles_where_they_are_known() -> None:
    street = Street().car("man", 14, 0.5, category="human.pedestrian.adult", size_wlh_m=(0.6, 0.6, 1.8))
    street.car("rider", 14, -4, category="vehicle.bicycle", size_wlh_m=(0.6, 1.8, 1.7)).car("car", 20, 0)
    scene = street.scene()
    assert best(ask(Referent("person", "man"), scene)) == "man"
    assert best(ask(Referent("bicycle", "bicycle"), scene)) == "rider"
    assert best(ask(Referent("vehicle", "vehicle"), scene)) == "car"
    on_bike = Query("", referent=Referent("person", "man"), secondary=(Landmark("bicycle", "on", "referent"),))
    assert best(resolve(on_bike, scene)) == "rider"
    ridden = Query("", referent=Referent("bicycle", "bicycle"), secondary=(Landmark("man", "on", "inverse"),))
    assert best(resolve(ridden, scene)) == "rider"
    assert (
        best(resolve(Query("", referent=car(), secondary=(Landmark("person", "behind", "inverse"),)), scene)) == "car"
    )


def test_what_no_map_shows_is_told_and_not_failed_on() -> None:
    scene = Street().car("a", 12, -4).scene()
    query = Query(
        "",
        referent=car(extra=("my uncle's",)),
        secondary=(Landmark("tree", "next_to", "referent"), Landmark("sign", "near")),
    )
    found = resolve(query, scene)
    assert best(found) == "a"
    assert found.reasons[1:] == (
        "no map shows 'my uncle's': it was left out",
        "the map holds no tree: it was left out",
    )


# Further vehicles ---------------------------------------------------------------------------------------------------


def vans() -> Scene:
    street = (
        Street().car("v1", 14, -4, BLUE, size_wlh_m=VAN).car("t1", 8, -4, WHITE, size_wlh_m=SIZES["vehicle.truck"])
    )
    street.rows[-1] = (*street.rows[-1][:1], "vehicle.truck", *street.rows[-1][2:])
    street.car("v2", 30, 4, BLUE, size_wlh_m=VAN).car("k", 22, 4, BLACK)
    return street.scene()


@pytest.mark.parametrize(
    ("relation", "noun", "colour", "meant"),
    [
        ("in_front_of", "truck", "white", "v1"),
        ("past", "truck", "white", "v1"),
        ("in_front_of", "car", "black", "v2"),
        ("near", "car", "black", "v2"),
        ("opposite", "car", "black", "v1"),
        ("left_of", "van", None, ""),
    ],
)
def test_the_van_that_stands_so_to_another(relation: str, noun: str, colour: str | None, meant: str) -> None:
    query = Query("", referent=Referent("van", "van"), secondary=(Landmark(noun, relation, "referent", colour),))
    found = resolve(query, vans())
    assert found.status == "not_found" if not meant else best(found) == meant


def test_the_car_that_another_stands_behind() -> None:
    scene = Street().car("a", 12, -4, WHITE).car("b", 26, 4, WHITE).car("v", 20, 4, RED, size_wlh_m=VAN).scene()
    query = Query("", referent=car("white"), secondary=(Landmark("van", "behind", "inverse", "red"),))
    found = resolve(query, scene)
    assert best(found) == "b"
    assert set(found.candidates[0].fits) == {"car", "white", "the red van behind it"}


def test_the_next_one_in_line_is_the_one_behind() -> None:
    street = Street().car("t", 30, -4, WHITE, size_wlh_m=SIZES["vehicle.truck"], category="vehicle.truck")
    scene = street.car("near", 22, -4).car("far", 15, -4).scene()
    query = Query("", referent=car(), secondary=(Landmark("truck", "behind", "referent"),))
    assert best(resolve(query, scene)) == "near"


def test_behind_is_taken_from_the_other_vehicle_unless_it_stands_facing_us() -> None:
    def scene(speed_mps: float, y_m: float) -> Scene:
        street = Street().car("t", 20, y_m, RED, yaw_rad=np.pi, speed_mps=speed_mps)
        return street.car("short", 12, y_m, yaw_rad=np.pi).car("beyond", 28, y_m, yaw_rad=np.pi).scene()

    query = Query("", referent=car("white"), secondary=(Landmark("car", "behind", "referent", "red"),))
    assert best(resolve(query, scene(8.0, 3))) == "beyond"
    assert best(resolve(query, scene(0.0, 7))) == "beyond"
    assert best(resolve(query, scene(0.0, 3))) == "short"


def test_excluded_vehicles_are_not_meant() -> None:
    street = Street().car("red", 10, -4, RED, size_wlh_m=VAN).car("blue", 12, 4, BLUE, size_wlh_m=VAN)
    query = Query("", referent=Referent("van", "van"))
    assert resolve(query, street.scene()).status == "ambiguous"
    not_red = replace(query, excluded=(Exclusion(None, "van", "red"),))
    assert best(resolve(not_red, street.scene())) == "blue"
    assert "not red van" in resolve(not_red, street.scene()).candidates[0].fits


def test_forbidden_places() -> None:
    scene = row().scene()
    query = Query("", excluded=(Exclusion("next_to", "car", "blue"), Exclusion(None, "car"), Exclusion("on", "lawn")))
    assert [(relation, item.id) for relation, item in forbidden(query, scene)] == [("next_to", "r3")]
    white = Query("", excluded=(Exclusion("behind", "car", "white"),))
    assert {item.id for _, item in forbidden(white, scene)} == {"r2", "r4"}
    assert forbidden(white, Street().scene()) == ()


def between(referent: Referent, *secondary: Landmark) -> Query:
    return Query("", "park", relation="between", landmark="referent", referent=referent, secondary=secondary)


def test_between_two_that_are_named() -> None:
    street = Street().car("b", 10, -5, BLUE).car("t", 22, -5, RED, size_wlh_m=SIZES["vehicle.truck"])
    street.rows[-1] = (*street.rows[-1][:1], "vehicle.truck", *street.rows[-1][2:])
    scene = street.car("b2", 30, 5, BLUE).scene()
    found = resolve(between(car("blue"), Landmark("truck", "between", "goal", "red")), scene)
    assert best(found) == "b"
    assert found.candidates[0].partner is not None
    assert found.candidates[0].partner.id == "t"
    lacking = resolve(between(car("blue"), Landmark("bus", "between", "goal", "red")), scene)
    assert lacking.status == "not_found"
    assert lacking.reasons[0] == "nothing here fits 'red bus', to be between it and 'blue car'"


def test_between_two_alike_takes_those_with_room() -> None:
    scene = Street().car("a", 8, -5, WHITE).car("b", 14, -5, WHITE).car("c", 24.5, -5, WHITE).scene()
    found = resolve(between(car("white", number=2)), scene)
    pair = found.candidates[0]
    assert found.status == "ok"
    assert pair.partner is not None
    assert {pair.item.id, pair.partner.id} == {"b", "c"}


def test_two_pairs_that_fit_are_ambiguous() -> None:
    scene = Street().car("a", 8, -5, WHITE).car("b", 18, -5, WHITE).car("c", 28, -5, WHITE).scene()
    found = resolve(between(car("white", number=2)), scene)
    assert found.status == "ambiguous"
    assert "2 pairs fit" in found.reasons[0]
    assert found.question.count(" and the white car") == 2


def test_one_is_not_two() -> None:
    found = resolve(between(car("red", number=2)), Street().car("a", 8, -5, RED).car("b", 18, -5, BLUE).scene())
    assert found.status == "not_found"
    assert found.reasons[0] == "only 1 here fits 'red car', and two are asked for"


def test_the_first_two() -> None:
    scene = Street().car("a", 8, -5).car("b", 18.5, -5).car("c", 29, -5).scene()
    found = resolve(between(car(None, "first", number=2)), scene)
    assert found.status == "ok"
    partner = found.candidates[0].partner
    assert partner is not None
    assert {best(found), partner.id} == {"a", "b"}


def test_between_a_vehicle_and_a_thing_that_no_map_holds() -> None:
    query = between(car(), Landmark("tree", "between", "goal"))
    assert best(resolve(query, Street().car("a", 8, -5).scene())) == "a"


@pytest.mark.parametrize(("distance_m", "meant"), [(10, "near"), (22, "far"), (25, "far")])
def test_so_far_away(distance_m: float, meant: str) -> None:
    scene = Street().car("near", 11, -4).car("far", 24, -4).scene()
    query = Query("", referent=car(), distance_m=distance_m, distance_of="descriptor")
    found = resolve(query, scene)
    assert best(found) == meant
    assert f"{distance_m:g} m away" in found.candidates[0].fits
    gap = replace(query, distance_of="referent")
    assert resolve(gap, scene).status == "ambiguous"


# What is not said ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("action", "trigger", "relation", "meant"),
    [
        ("follow", None, "none", "leader"),
        ("park", None, "behind", "parked"),
        ("overtake", None, "none", "leader"),
        ("turn", "pass", "none", "leader"),
    ],
)
def test_actions_hint_at_vehicles(action: str, trigger: str | None, relation: str, meant: str) -> None:
    scene = Street().car("parked", 14, -4.5, WHITE).car("leader", 16, 0, WHITE, speed_mps=6).scene()
    query = Query("", action, relation=relation, trigger=trigger, referent=car("white"))
    assert best(resolve(query, scene)) == meant


@pytest.mark.parametrize("action", ["give_way", "wait", "avoid", "slow_down"])
def test_who_crosses_our_way_is_let_pass(action: str) -> None:
    street = Street().car("leader", 16, 0, speed_mps=8).car("crossing", 20, 6, yaw_rad=-np.pi / 2, speed_mps=4)
    scene = street.car("parked", 14, -6).scene()
    found = resolve(Query("", action, referent=car()), scene)
    assert found.candidates[0].item.id == "crossing" or action in ("avoid", "slow_down")
    assert "parked" not in [one.item.id for one in found.candidates[:1]]


def test_words_are_stronger_than_hints() -> None:
    scene = Street().car("parked", 14, -4.5, RED).car("leader", 16, 0, WHITE, speed_mps=6).scene()
    assert best(resolve(Query("", "follow", referent=car("red")), scene)) == "parked"
    assert best(resolve(Query("", "park", relation="behind", referent=car("white")), scene)) == "leader"


def test_people_speak_of_what_lies_before_them() -> None:
    scene = Street().car("behind", -9, 0).car("ahead", 14, -3).car("far", 38, 20).scene()
    assert best(ask(car(), scene)) == "ahead"


def test_optional_qualifiers_weigh_a_little() -> None:
    scene = Street().car("l", 12, 5, WHITE).car("r", 12, -5, WHITE).scene()
    found = ask(car("white", qualifiers_optional=("left_side",)), scene)
    assert best(found) == "l"
    assert set(found.candidates[0].fits) == {"car", "white"}


def test_a_vehicle_hidden_by_others_is_not_spoken_of() -> None:
    street = Street().car("bus", 16, 4, YELLOW, size_wlh_m=(2.9, 11.0, 3.4), category="vehicle.bus.rigid")
    scene = street.car("hidden", 26, 6.3, WHITE).car("seen", 24, -5, WHITE).scene()
    visible = {item.id: share for item, share in zip(scene.crowd.items, scene.crowd.visible, strict=True)}
    assert visible == {"bus": 1.0, "hidden": 0.0, "seen": 1.0}
    assert best(ask(car("white"), scene)) == "seen"


def test_behind_houses_nobody_sees() -> None:
    street = Street().car("here", 20, -3, WHITE).car("beyond", 22, 26, WHITE)
    street.occupancy[ROAD, 150:160, :] = 1  # a side street
    assert best(ask(car("white"), street.scene())) == "here"


def test_who_is_beside_us_is_not_counted() -> None:
    scene = Street().car("beside", 1.8, -4).car("a", 9, -4).car("b", 16, -4).scene()
    assert [best(ask(car(None, word, "right_side"), scene)) for word in ("first", "second")] == ["a", "b"]


def test_the_car_ahead_is_the_first_of_a_queue() -> None:
    street = Street()
    for i in range(3):
        street.car(str(i), 11 + 7 * i, 0, speed_mps=4)
    assert best(ask(car(None, "ahead"), street.scene())) == "0"
    assert best(resolve(Query("", "follow", referent=car()), street.scene())) == "0"


def test_without_a_map() -> None:
    scene = replace(row().scene(), bev=None)
    assert best(ask(car(None, "second", "right_side"), scene)) == "r2"
    bare = replace(scene, objects=tuple(replace(item, rgb=None) for item in scene.objects))
    found = ask(car("black", "left_side"), bare)
    assert best(found) == "oncoming"
    assert "its colour is not known: 'black' could not be checked" in found.reasons


def test_at_most_so_many() -> None:
    street = Street()
    for i in range(9):
        street.car(str(i), 6 + 3.5 * i, -6 + 12 * (i % 2), WHITE, size_wlh_m=(1.5, 3.2, 1.5))
    found = resolve(Query("", referent=car("white")), street.scene(), limit=4)
    assert found.status == "ambiguous"
    assert len(found.candidates) == len(found.differences) == 4


# Invariances --------------------------------------------------------------------------------------------------------

PAINTS = (WHITE, BLACK, RED, BLUE, GREEN, SILVER)
PLACES = st.lists(
    st.tuples(st.integers(5, 35), st.integers(-7, 7), st.sampled_from(PAINTS), st.sampled_from([0.0, 7.0])),
    min_size=1,
    max_size=6,
    unique_by=lambda place: (place[0] // 6, place[1] // 4),
)
WORDS = st.sampled_from(
    [
        (),
        ("left_side",),
        ("right_side",),
        ("nearest",),
        ("second",),
        ("leftmost",),
        ("last", "right_side"),
        ("ahead",),
    ]
)
MIRROR = {"left_side": "right_side", "right_side": "left_side", "leftmost": "rightmost"}
Place = tuple[int, int, tuple[int, int, int], float]


def placed(places: list[Place], sign: int = 1) -> Scene:
    street = Street()
    for i, (x, y, rgb, speed) in enumerate(places):
        street.car(str(i), x, sign * y, rgb, speed_mps=speed)
    return street.scene()


def answer(found: Resolution) -> tuple[str, list[str]]:
    return found.status, sorted(one.item.id for one in found.candidates) if found.status == "ambiguous" else [
        one.item.id for one in found.candidates[:1]
    ]


@given(PLACES, WORDS, st.sampled_from([None, "white", "red"]))
def test_a_mirrored_scene_has_the_mirrored_answer(
    places: list[Place], words: tuple[str, ...], colour: str | None
) -> None:
    mirrored = tuple(MIRROR.get(word, word) for word in words)
    one, other = ask(car(colour, *words), placed(places)), ask(car(colour, *mirrored), placed(places, -1))
    scores = [found.candidates[0].score - found.candidates[-1].score for found in (one, other) if found.candidates]
    # A place on the very edge between two answers may fall to either.
    assume(all(abs(score - np.log(2.0)) > 1e-6 for score in scores))
    assert answer(one) == answer(other)


@given(PLACES, WORDS, st.randoms(use_true_random=False))
def test_the_order_of_vehicles_does_not_matter(places: list[Place], words: tuple[str, ...], random: Random) -> None:
    scene = placed(places)
    objects = list(scene.objects)
    random.shuffle(objects)
    one, other = ask(car(None, *words), scene), ask(car(None, *words), replace(scene, objects=tuple(objects)))
    assert answer(one) == answer(other)
    assert [c.score for c in one.candidates] == pytest.approx([c.score for c in other.candidates])


@given(PLACES, WORDS)
def test_a_far_vehicle_of_another_kind_changes_nothing(places: list[Place], words: tuple[str, ...]) -> None:
    bus = (
        Street()
        .car("bus", -38, 30, YELLOW, size_wlh_m=(2.9, 11.0, 3.4), category="vehicle.bus.rigid")
        .scene()
        .objects
    )
    scene = placed(places)
    more = replace(scene, objects=(*scene.objects, *bus))
    assert answer(ask(car(None, *words), scene)) == answer(ask(car(None, *words), more))


# Human commands on tracks -------------------------------------------------------------------------------------------


@pytest.mark.realdata
def test_human_commands_on_real_tracks(data_root: Path) -> None:
    outcomes = [one.outcome for one in measure(data_root / "nuscenes_mini_tracks")]
    assert len(outcomes) == 27
    assert outcomes.count("top") >= 9
    assert outcomes.count("missed") <= 8


def recorded(folder: Path, **more: Any) -> dict[str, Any]:
    """A recording of two cars ahead, the second of which is named, and the sentence about it."""
    moments, cars = 8, 2
    parts: dict[str, Any] = {
        "t": np.arange(moments) / 10,
        "ids": np.array(["first", "second"]),
        "category": np.array(["vehicle.car", "vehicle.car"]),
        "position": np.tile(np.array([[[10.0, -4, 0.8]], [[20.0, 4, 0.8]]]), (1, moments, 1)),
        "heading": np.zeros((cars, moments)),
        "velocity": np.zeros((cars, moments, 2)),
        "valid": np.ones((cars, moments), np.bool_),
        "size_lwh": np.tile([4.5, 1.8, 1.5], (cars, 1)),
        "ego_position": np.zeros((moments, 3)),
        "ego_heading": np.zeros(moments),
    } | more
    np.savez(folder / "scene-1.npz", **{name: part for name, part in parts.items() if part is not None})
    return {"command": "stop behind the car on the left", "scene": "scene-1", "track": "second", "t_best": 0.6}


def test_a_made_recording(tmp_path: Path) -> None:
    record = recorded(tmp_path)
    unnamed = {**record, "track": None}
    write_json(tmp_path / "talk2car_commands.json", [record, {**record, "t_best": 0.0}, unnamed])
    assert [(one.outcome, one.rank, one.lacked) for one in measure(tmp_path)] == [("top", 1, ""), ("top", 1, "")]
    asked = {**record, "command": "stop behind the red car"}
    write_json(tmp_path / "talk2car_commands.json", [asked, {**asked, "command": "stop behind the bus"}])
    assert [(one.outcome, one.lacked) for one in measure(tmp_path)] == [("among", "colour"), ("missed", "language")]


@pytest.mark.parametrize(
    ("record", "parts", "message"),
    [
        ({"track": "nobody"}, {}, "track nobody: expected it among those of its scene, got none"),
        ({"scene": "scene-2"}, {}, "scene-2.npz: expected tracks of a scene"),
        ({}, {"heading": None}, "scene-1.npz: expected tracks of a scene"),
    ],
)
def test_damaged_recordings(tmp_path: Path, record: dict[str, Any], parts: dict[str, Any], message: str) -> None:
    write_json(tmp_path / "talk2car_commands.json", [recorded(tmp_path, **parts) | record])
    with pytest.raises(DataError, match=message):
        measure(tmp_path)


@pytest.mark.parametrize(
    ("records", "message"),
    [
        ({}, "talk2car_commands.json: expected a list of records, got dict"),
        ([{"track": "second", "scene": "scene-1"}], "expected command, scene, t_best, track in each record"),
    ],
)
def test_damaged_sentences(tmp_path: Path, records: Any, message: str) -> None:
    write_json(tmp_path / "talk2car_commands.json", records)
    with pytest.raises(DataError, match=message):
        measure(tmp_path)


def test_the_command_line_of_the_benchmark(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_json(tmp_path / "talk2car_commands.json", [recorded(tmp_path)])
    main([str(tmp_path), "--json"])
    assert json.loads(capsys.readouterr().out)["counts"] == {"top": 1}
    main([str(tmp_path)])
    assert "top 1, among 0, missed 0" in capsys.readouterr().out
    with pytest.raises(SystemExit) as stopped:
        main([str(tmp_path / "nothing")])
    assert stopped.value.code == 2
