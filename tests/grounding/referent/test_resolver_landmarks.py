"""Landmarks, pairs and exclusions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from asking import SIZES_WLH_M, VAN_WLH_M, best, car, row
from street import BLACK, BLUE, RED, WHITE, Street

from grounding.goal.exclusions import resolve_exclusions
from grounding.query import Exclusion, Landmark, LandmarkRelation, Query, Referent
from grounding.referent.resolver import resolve
from grounding.referent.scene import SceneModel


def vans() -> SceneModel:
    street = (
        Street()
        .car("v1", 14, -4, BLUE, size_wlh_m=VAN_WLH_M)
        .car("t1", 8, -4, WHITE, size_wlh_m=SIZES_WLH_M["vehicle.truck"])
    )
    street.rows[-1] = (*street.rows[-1][:1], "vehicle.truck", *street.rows[-1][2:])
    street.car("v2", 30, 4, BLUE, size_wlh_m=VAN_WLH_M).car("k", 22, 4, BLACK)
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
def test_a_van_in_a_relation_to_a_landmark(
    relation: LandmarkRelation, noun: str, colour: str | None, meant: str
) -> None:
    query = Query("", referent=Referent("van", "van"), secondary=(Landmark(noun, relation, "referent", colour),))
    found = resolve(query, vans())
    assert found.status == "not_found" if not meant else best(found) == meant


def test_inverse_relations() -> None:
    scene = Street().car("a", 12, -4, WHITE).car("b", 26, 4, WHITE).car("v", 20, 4, RED, size_wlh_m=VAN_WLH_M).scene()
    query = Query("", referent=car("white"), secondary=(Landmark("van", "behind", "inverse", "red"),))
    found = resolve(query, scene)
    assert best(found) == "b"
    assert set(found.candidates[0].fits) == {"car", "white", "the red van behind it"}


def test_the_next_vehicle_in_line_is_the_one_behind() -> None:
    street = Street().car("t", 30, -4, WHITE, size_wlh_m=SIZES_WLH_M["vehicle.truck"], category="vehicle.truck")
    scene = street.car("near", 22, -4).car("far", 15, -4).scene()
    query = Query("", referent=car(), secondary=(Landmark("truck", "behind", "referent"),))
    assert best(resolve(query, scene)) == "near"


def test_behind_uses_the_landmarks_heading_unless_it_stands_facing_us() -> None:
    def scene(speed_mps: float, y_m: float) -> SceneModel:
        street = Street().car("t", 20, y_m, RED, yaw_rad=np.pi, speed_mps=speed_mps)
        return street.car("short", 12, y_m, yaw_rad=np.pi).car("beyond", 28, y_m, yaw_rad=np.pi).scene()

    query = Query("", referent=car("white"), secondary=(Landmark("car", "behind", "referent", "red"),))
    assert best(resolve(query, scene(8.0, 3))) == "beyond"
    assert best(resolve(query, scene(0.0, 7))) == "beyond"
    assert best(resolve(query, scene(0.0, 3))) == "short"


def test_excluded_vehicles_are_not_referents() -> None:
    street = Street().car("red", 10, -4, RED, size_wlh_m=VAN_WLH_M).car("blue", 12, 4, BLUE, size_wlh_m=VAN_WLH_M)
    query = Query("", referent=Referent("van", "van"))
    assert resolve(query, street.scene()).status == "ambiguous"
    not_red = replace(query, excluded=(Exclusion(None, "van", "red"),))
    assert best(resolve(not_red, street.scene())) == "blue"
    assert "not red van" in resolve(not_red, street.scene()).candidates[0].fits


def test_excluded_relations_and_their_vehicles() -> None:
    scene = row().scene()
    query = Query("", excluded=(Exclusion("next_to", "car", "blue"), Exclusion(None, "car"), Exclusion("on", "lawn")))
    assert [(one.relation, one.item.id) for one in resolve_exclusions(query, scene)] == [("next_to", "r3")]
    white = Query("", excluded=(Exclusion("behind", "car", "white"),))
    assert {one.item.id for one in resolve_exclusions(white, scene)} == {"r2", "r4"}
    assert resolve_exclusions(white, Street().scene()) == ()


def between(referent: Referent, *secondary: Landmark) -> Query:
    return Query("", "park", relation="between", landmark="referent", referent=referent, secondary=secondary)


def test_between_two_named_vehicles() -> None:
    street = Street().car("b", 10, -5, BLUE).car("t", 22, -5, RED, size_wlh_m=SIZES_WLH_M["vehicle.truck"])
    street.rows[-1] = (*street.rows[-1][:1], "vehicle.truck", *street.rows[-1][2:])
    scene = street.car("b2", 30, 5, BLUE).scene()
    found = resolve(between(car("blue"), Landmark("truck", "between", "goal", "red")), scene)
    assert best(found) == "b"
    assert found.candidates[0].partner is not None
    assert found.candidates[0].partner.id == "t"
    lacking = resolve(between(car("blue"), Landmark("bus", "between", "goal", "red")), scene)
    assert lacking.status == "not_found"
    assert lacking.reasons[0] == "nothing here fits 'red bus', to be between it and 'blue car'"


def test_between_two_alike_requires_room() -> None:
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
    shared, others = found.question.split(", and which other one: ")
    assert shared == "the white car on the right, 17 m ahead"
    assert others == "the white car, 8 m ahead, or the one, 27 m ahead?"


def test_a_pair_needs_two_vehicles() -> None:
    found = resolve(between(car("red", number=2)), Street().car("a", 8, -5, RED).car("b", 18, -5, BLUE).scene())
    assert found.status == "not_found"
    assert found.reasons[0] == "only 1 here fits 'red car', and two are asked for"


def test_the_first_two_vehicles() -> None:
    scene = Street().car("a", 8, -5).car("b", 18.5, -5).car("c", 29, -5).scene()
    found = resolve(between(car(None, "first", number=2)), scene)
    assert found.status == "ok"
    partner = found.candidates[0].partner
    assert partner is not None
    assert {best(found), partner.id} == {"a", "b"}


def test_between_a_vehicle_and_an_unmapped_thing() -> None:
    query = between(car(), Landmark("tree", "between", "goal"))
    assert best(resolve(query, Street().car("a", 8, -5).scene())) == "a"


@pytest.mark.parametrize(("distance_m", "meant"), [(10, "near"), (22, "far"), (25, "far")])
def test_distances_as_descriptors(distance_m: float, meant: str) -> None:
    scene = Street().car("near", 11, -4).car("far", 24, -4).scene()
    query = Query("", referent=car(), distance_m=distance_m, distance_of="descriptor")
    found = resolve(query, scene)
    assert best(found) == meant
    assert f"{distance_m:g} m away" in found.candidates[0].fits
    gap = replace(query, distance_of="referent")
    assert resolve(gap, scene).status == "ambiguous"
