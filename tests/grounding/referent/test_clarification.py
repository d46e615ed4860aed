from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, SILVER, WHITE, Street

from grounding.describe import describe_motion
from grounding.referent.clarification import compose_question, describe_differences
from grounding.referent.scene import SceneModel


def words(scene: SceneModel, *names: str) -> tuple[str, ...]:
    by_name = {item.id: item for item in scene.table.items}
    return describe_differences([(by_name[name],) for name in names], scene)


def test_candidates_that_differ_only_by_side() -> None:
    scene = Street().car("a", 12, 3, WHITE).car("b", 20, -5, WHITE).scene()
    texts = words(scene, "a", "b")
    assert texts == ("the white car on the left, 11 m ahead", "the one on the right, 19 m ahead")
    assert compose_question(texts) == "the white car on the left, 11 m ahead, or the one on the right, 19 m ahead?"


def test_only_distinctive_traits_are_named() -> None:
    scene = Street().car("a", 10, -5, WHITE).car("b", 16, -5, BLACK).scene()
    assert words(scene, "a", "b") == ("the white car, 10 m ahead", "the black car, 16 m ahead")


def test_a_colour_that_may_be_the_same_is_not_distinctive() -> None:
    scene = Street().car("a", 10, -5, SILVER).car("b", 16, -5, None).scene()
    assert words(scene, "a", "b")[1] == "the one, 16 m ahead"


def test_classes_motion_and_lanes() -> None:
    street = Street().car("van", 10, -5, size_wlh_m=(2.0, 6.0, 2.6), category="vehicle.truck")
    street.car("moving", 16, -5, speed_mps=5).car("standing", 22, -5).car("own", 25, -1.6)
    scene = street.car("facing", 30, -5, yaw_rad=np.pi, speed_mps=5).scene()
    assert words(scene, "van", "moving")[0].startswith("the white truck, ")
    assert words(scene, "moving", "standing") == (
        "the white car, moving, 16 m ahead",
        "the one, standing, 21 m ahead",
    )
    assert words(scene, "moving", "facing")[1] == "the one, coming towards us, 29 m ahead"
    assert words(scene, "own", "standing")[0] == "the white car in our lane, 24 m ahead"


def test_unknown_motion_is_told_as_unknown_and_tells_nothing_apart() -> None:
    scene = Street().car("standing", 10, -5, WHITE).car("unknown", 16, -5, WHITE, speed_mps=np.nan).scene()
    assert words(scene, "standing", "unknown") == ("the white car, 10 m ahead", "the one, 16 m ahead")
    assert [describe_motion(item) for item in scene.objects] == ["standing", "speed not known"]


@pytest.mark.parametrize(("speed_mps", "told"), [(0.6, "hardly moving"), (4.0, "moving at 4 m/s")])
def test_motion_in_words(speed_mps: float, told: str) -> None:
    (car,) = Street().car("a", 10, -5, speed_mps=speed_mps).scene().objects
    assert describe_motion(car) == told


def test_behind_us() -> None:
    scene = Street().car("a", 12, 0, WHITE).car("b", -12, 0, WHITE).scene()
    assert words(scene, "a", "b") == ("the white car, 11 m ahead", "the one behind us, 13 m")


def test_equal_distances_are_shown_with_one_decimal() -> None:
    scene = Street().car("a", 12.0, -5, WHITE).car("b", 12.3, -5, WHITE).scene()
    assert words(scene, "a", "b") == ("the white car, 11.8 m ahead", "the one, 12.1 m ahead")


def test_a_question_names_at_most_four() -> None:
    street = Street()
    for i in range(6):
        street.car(str(i), 8 + 5 * i, -5, WHITE)
    texts = words(street.scene(), *"012345")
    assert len(texts) == 6
    assert compose_question(texts) == f"{texts[0]}; {texts[1]}; {texts[2]}; {texts[3]}; or another one?"


def test_pairs_are_described_by_both_vehicles() -> None:
    scene = Street().car("a", 8, -5, WHITE).car("b", 18, -5, BLACK).car("c", 28, -5, WHITE).scene()
    a, b, c = scene.objects
    texts = describe_differences([(a, b), (b, c)], scene)
    assert texts[0] == "the white car, 8 m ahead, and the black car, 17 m ahead"
    assert compose_question(texts) == f"{texts[0]}; or {texts[1]}?"


def test_one_that_has_passed_does_not_face_us() -> None:
    scene = Street().car("coming", 20, 4, yaw_rad=np.pi).car("passed", -20, 4, yaw_rad=np.pi).scene()
    assert {item.id: item.faces_ego(scene.ego) for item in scene.objects} == {"coming": True, "passed": False}
