from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREY, RED, SILVER, WHITE, Street

from grounding.parse import read
from grounding.predicates import fits
from grounding.query import Referent
from grounding.resolve import Resolution, resolve
from grounding.scene import Scene


def ask(phrase: str, scene: Scene) -> Resolution:
    referent = read(f"park behind {phrase}").query.referent
    assert referent is not None
    return resolve(referent, scene)


def row() -> Street:
    """Cars parked on the right, one oncoming and one driving ahead, one behind us."""
    street = Street().car("r1", 8, -5, RED).car("r2", 14, -5, WHITE).car("r3", 20, -5, BLUE).car("r4", 26, -5, WHITE)
    street.car("oncoming", 25, 3, BLACK, yaw_rad=np.pi, speed_mps=9.0)
    street.car("leader", 18, 0, GREY, speed_mps=6.0)
    return street.car("follower", -12, 0, RED, speed_mps=6.0)


@pytest.mark.parametrize(
    ("phrase", "meant"),
    [
        ("the blue car", "r3"),
        ("the nearest white car", "r2"),
        ("the farthest white car", "r4"),
        ("the first car on the right", "r1"),
        ("the second car on the right", "r2"),
        ("the third car on the right", "r3"),
        ("the last car on the right", "r4"),
        ("the second white car", "r4"),
        ("the second closest white car", "r4"),
        ("the black car on the left", "oncoming"),
        ("the oncoming car", "oncoming"),
        ("the grey car ahead", "leader"),
        ("the car behind us", "follower"),
        ("the red car", "r1"),
        ("the red car behind us", "follower"),
        ("the moving red car", "follower"),
        ("the leftmost vehicle", "oncoming"),
        ("a white car", "r2"),
        ("the dark car on the left", "oncoming"),
    ],
)
def test_the_vehicle_meant(phrase: str, meant: str) -> None:
    found = ask(phrase, row().scene())
    assert found.status == "ok", found
    assert found.candidates[0].item.id == meant


@pytest.mark.parametrize(
    ("phrase", "meant"),
    [
        ("the first car from the left", "l"),
        ("the second car from the left", "m"),
        ("the second car from the right", "n"),
        ("the last car from the left", "r"),
        ("the last car from the right", "l"),
        ("the second car", "n"),
    ],
)
def test_from_a_side_cars_are_counted_across(phrase: str, meant: str) -> None:
    street = Street().car("l", 30, 6).car("m", 22, 2).car("n", 14, -2).car("r", 6, -6)
    found = ask(phrase, street.scene())
    assert found.status == "ok", found
    assert found.candidates[0].item.id == meant


def test_two_alike_are_ambiguous_and_only_they_are_listed() -> None:
    found = ask("the white car", row().scene())
    assert found.status == "ambiguous"
    assert {one.item.id for one in found.candidates} == {"r2", "r4"}
    assert "2 vehicles fit 'white car'" in found.reasons[0]


def test_equally_far_is_ambiguous() -> None:
    scene = Street().car("left", 10, 4, WHITE).car("right", 10, -4, WHITE).scene()
    assert ask("the nearest car", scene).status == "ambiguous"
    assert ask("the nearest car on the left", scene).candidates[0].item.id == "left"


def test_one_vehicle_that_could_be_silver_or_grey_is_no_tie_when_alone() -> None:
    scene = Street().car("s", 12, -4, SILVER).car("b", 18, -4, BLACK).scene()
    for word in ("silver", "grey"):
        found = ask(f"the {word} car", scene)
        assert (found.status, found.candidates[0].item.id) == ("ok", "s")


def test_absent_gives_the_nearest_misses_and_what_lacks() -> None:
    found = ask("the pink bus", row().scene())
    assert found.status == "not_found"
    assert 0 < len(found.candidates) <= 3
    assert any("'bus'" in reason for reason in found.reasons)
    assert any("'pink'" in reason for reason in found.reasons)


def test_each_word_may_be_met_and_no_vehicle_meet_all() -> None:
    found = ask("the red car on the left", Street().car("a", 9, -4, RED).car("b", 9, 4, BLUE).scene())
    assert found.status == "not_found"
    assert found.reasons == ("no vehicle on the map fits 'red car on the left'",)


def test_too_few_to_count_to() -> None:
    found = ask("the fourth white car", row().scene())
    assert found.status == "not_found"
    assert "no vehicle is the 'fourth' one: 2 fit" in found.reasons[0]


def test_an_empty_street() -> None:
    found = ask("the car", Street().scene())
    assert (found.status, found.candidates) == ("not_found", ())
    assert found.reasons == ("the map shows no vehicle",)


def test_a_colour_word_never_matches_an_unknown_colour() -> None:
    scene = Street().car("unknown", 10, -4, None).scene()
    assert ask("the white car", scene).status == "not_found"
    assert ask("the car", scene).candidates[0].item.id == "unknown"


SIZES = {
    "bus": (2.9, 11.0, 3.4),
    "truck": (2.5, 8.0, 3.2),
    "motorcycle": (0.8, 2.2, 1.5),
    "car": (1.8, 4.4, 1.5),
}


def test_classes_of_annotations() -> None:
    street = Street().car("bus", 10, 4, category="vehicle.bus.rigid", size_wlh_m=SIZES["bus"])
    street.car("truck", 22, 4, category="vehicle.truck", size_wlh_m=SIZES["truck"])
    street.car("pickup", 10, -5, category="vehicle.truck", size_wlh_m=(2.0, 5.5, 1.9))
    street.car("van", 17, -5, category="vehicle.car", size_wlh_m=(2.0, 5.4, 2.3))
    street.car("suv", 24, -5, size_wlh_m=(1.9, 4.7, 1.8)).car("sedan", 31, -5, size_wlh_m=(1.8, 4.6, 1.4))
    scene = street.scene()
    for phrase, meant in (("bus", "bus"), ("pickup truck", "pickup"), ("van", "van"), ("suv", "suv")):
        assert ask(f"the {phrase}", scene).candidates[0].item.id == meant, phrase
    assert ask("the largest truck", scene).candidates[0].item.id == "truck"


def test_classes_of_blobs_by_their_size() -> None:
    street = Street()
    for i, (kind, size) in enumerate(SIZES.items()):
        street.car(kind, -30 + 16 * i, -5, size_wlh_m=size)
    objects = street.scene_without_boxes().objects
    for kind, (_, length, _) in SIZES.items():
        best = max(objects, key=lambda item: fits(Referent(kind, kind), item, street.scene())[kind])
        assert best.length_m == pytest.approx(length, abs=0.6), kind


def test_the_speed_of_a_blob_is_unknown_and_half_open() -> None:
    scene = Street().car("a", 12, -4).scene_without_boxes()
    referent = Referent("vehicle", "vehicle", qualifiers=("parked", "oncoming"))
    assert fits(referent, scene.objects[0], scene) == pytest.approx({"vehicle": 1.0, "parked": 0.5, "oncoming": 0.25})
