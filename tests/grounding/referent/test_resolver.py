from __future__ import annotations

from dataclasses import replace

import pytest
from asking import ask, best, car, row
from street import BLACK, BLUE, RED, SILVER, WHITE, Street

from grounding.goal.exclusions import resolve_exclusions
from grounding.query import Exclusion, Landmark, Query, Referent
from grounding.referent.resolver import resolve


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
def test_ordinals_and_superlatives(qualifiers: tuple[str, ...], meant: str) -> None:
    street = Street().car("l", 30, 6, size_wlh_m=(2.0, 5.4, 1.5)).car("m", 22, 2, size_wlh_m=(1.9, 5.0, 1.5))
    street.car("n", 14, -2, size_wlh_m=(1.8, 4.4, 1.5)).car("r", 6, -6, size_wlh_m=(1.6, 3.6, 1.5))
    assert best(ask(car(None, *qualifiers), street.scene())) == meant


def test_occluded_vehicles_in_a_queue_are_counted() -> None:
    street = Street()
    for i in range(5):
        street.car(str(i), 9 + 6 * i, 0, speed_mps=5)
    scene = street.scene()
    assert scene.table.visible_share.tolist() == [1, 0, 0, 0, 0]
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


def test_a_nearer_one_behind_us_is_explained() -> None:
    scene = Street().car("ahead", 14, -3, WHITE).car("behind", -9, 3, WHITE).scene()
    found = ask(car("white", "nearest"), scene)
    assert best(found) == "ahead"
    assert any("is nearer, but behind us" in reason for reason in found.reasons)
    assert best(ask(car("white", "nearest", "behind_ego"), scene)) == "behind"
    alone = ask(car("white", "nearest"), Street().car("ahead", 14, -3, WHITE).car("b", -30, 3, WHITE).scene())
    assert not any("behind us" in reason for reason in alone.reasons)


@pytest.mark.parametrize("colour", ["silver", "grey"])
def test_one_vehicle_that_is_silver_or_grey_is_not_ambiguous(colour: str) -> None:
    scene = Street().car("s", 12, -4, SILVER).car("b", 18, -4, BLACK).scene()
    assert best(ask(car(colour), replace(scene, bev=None))) == "s"


def test_not_found_lists_near_misses_and_lacking_words() -> None:
    found = ask(Referent("bus", "bus", "pink"), row().scene())
    assert found.status == "not_found"
    assert 0 < len(found.candidates) <= 3
    assert "none of the 7 here is 'bus'" in found.reasons
    assert "none of the 7 here is 'pink'" in found.reasons


def test_not_found_if_no_vehicle_fits_all_words() -> None:
    found = ask(car("red", "left_side"), Street().car("a", 9, -4, RED).car("b", 9, 4, BLUE).scene())
    assert found.status == "not_found"
    assert found.reasons == ("nothing here fits 'red car on the left'",)


def test_too_few_vehicles_for_an_ordinal() -> None:
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


def test_a_vehicle_landmark_of_the_goal_becomes_the_referent() -> None:
    query = Query("", "stop", relation="next_to", landmark="secondary", secondary=(Landmark("car", "next_to"),))
    assert best(resolve(query, Street().car("a", 12, -4).scene())) == "a"


def test_an_unknown_colour_is_reported() -> None:
    scene = Street().car("unknown", 10, -4, None).scene()
    found = ask(car("white"), scene)
    assert best(found) == "unknown"
    assert "its colour is not known: 'white' could not be checked" in found.reasons
    # An unknown colour could be green, but green is rare.
    seen = Street().car("unknown", 10, -4, None).car("red", 16, -4, RED).scene()
    assert ask(car("green"), seen).status == "not_found"


def test_a_doubtful_colour_is_reported() -> None:
    found = ask(car("grey"), Street().car("w", 10, -4, (205, 205, 207)).scene())
    assert (
        (found.status in ("not_found", "ambiguous"))
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


def test_unmapped_things_are_reported_and_ignored() -> None:
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


# More red than brown.
REDDISH = (113, 91, 93)


def test_the_better_one_of_a_pair_comes_first() -> None:
    street = Street().car("reddish", 18, -5, REDDISH).car("red", 12, -5, RED).car("white", 30, 5, WHITE)
    found = ask(car("red", number=2), street.scene())
    assert found.status == "ok"
    assert found.candidates[0].partner is not None
    assert (found.candidates[0].item.id, found.candidates[0].partner.id) == ("red", "reddish")


@pytest.mark.parametrize(("word", "meant"), [("first", "far"), ("nearest", "far"), ("second", "near")])
def test_an_excluded_order_excludes_the_vehicle_in_that_place(word: str, meant: str) -> None:
    scene = Street().car("near", 12, -5, RED).car("far", 28, -5, RED).scene()
    query = Query("", "park", relation="behind", referent=Referent("car", "car", "red"))
    excluded = (Exclusion(None, "car", "red", (word,)),)
    found = resolve(replace(query, excluded=excluded), scene)
    assert (found.status, found.candidates[0].item.id) == ("ok", meant)


def test_an_exclusion_applies_to_all_plausible_vehicles() -> None:
    scene = Street().car("red", 14, -6, RED).car("reddish", 14, 6, REDDISH).car("white", 24, 6, WHITE).scene()
    query = Query("", excluded=(Exclusion("behind", "car", "red"),))
    assert [(one.relation, one.item.id) for one in resolve_exclusions(query, scene)] == [
        ("behind", "red"),
        ("behind", "reddish"),
    ]


def test_near_misses_come_best_first() -> None:
    street = Street().car("black", 8, 0, BLACK).car("van", 30, -5, WHITE, size_wlh_m=(2.0, 5.4, 2.3))
    found = ask(Referent("van", "van", "green"), street.car("blue", 12, 5, BLUE).scene())
    assert found.status == "not_found"
    assert found.candidates[0].item.id == "van"
