from __future__ import annotations

import numpy as np
import pytest
from street import BLUE, RED, WHITE, Street

from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from grounding.scene import Scene, SceneObject


def test_objects_are_the_vehicles_on_the_grid_with_colours_of_the_map() -> None:
    street = Street().car("red", 10, -3, RED, yaw_rad=0.3, speed_mps=4.0).car("far", 45, 0)
    street.car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(0.6, 0.6, 1.8))
    (item,) = street.scene().objects
    assert item.id == "red"
    assert item.noun == "car"
    assert item.centre_m == pytest.approx([10, -3])
    assert item.yaw_rad == pytest.approx(0.3)
    assert item.front_known
    assert (item.length_m, item.width_m, item.height_m) == pytest.approx((4.4, 1.8, 1.5))
    assert item.speed_mps == pytest.approx(4.0)
    assert item.rgb == pytest.approx(RED)
    assert item.distance_m == pytest.approx(np.hypot(8.7, 3.0))


def test_a_colour_the_map_does_not_know_stays_unknown() -> None:
    scene = Street().car("dark", 10, -3, None).scene()
    assert scene.objects[0].rgb is None
    assert scene.colour_name(scene.objects[0]) is None


def test_without_boxes_the_map_shows_blobs_whose_front_is_unknown() -> None:
    scene = Street().car("a", 12, -3, RED).car("b", -10, 4, WHITE).car("ego", 1.3, 0, BLUE).scene_without_boxes()
    assert len(scene.objects) == 2
    red = max(scene.objects, key=lambda item: item.centre_m[0])
    assert red.id.startswith("blob")
    assert red.centre_m == pytest.approx([12, -3], abs=0.3)
    assert red.length_m == pytest.approx(4.4, abs=0.5)
    assert not red.front_known
    assert red.speed_mps is None
    assert red.noun == "vehicle"
    assert red.rgb == pytest.approx(RED, abs=2)


def test_annotated_and_empty_is_empty_whatever_the_map_shows() -> None:
    street = Street().car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(1.8, 1.8, 1.8))
    assert street.scene().objects == ()
    assert len(street.scene_without_boxes().objects) == 1


def test_a_scene_without_vehicles_is_a_scene() -> None:
    assert Street().scene().objects == ()


def test_world_places_and_headings() -> None:
    scene = Street().scene()
    assert scene.world_xy([10.0, 2.0]) == pytest.approx([98.0, 60.0])
    assert scene.world_heading(0.0) == pytest.approx(np.pi / 2)
    assert scene.world_heading(0.25) == pytest.approx(np.pi / 2 + 0.25)


def test_footprint_and_covers_agree() -> None:
    corners = np.array([[2, 1], [2, -3], [4, -3], [4, 1]])
    item = SceneObject("x", "", np.array([3.0, -1.0]), np.pi / 2, False, 4.0, 2.0)
    assert item.footprint() == pytest.approx(corners)
    assert item.covers(corners * 0.999 + np.array([3.0, -1.0]) * 0.001).all()
    assert not item.covers(np.array([[3.0, 1.2], [4.2, -1.0]])).any()
    assert item.covers(np.array([[3.0, 1.2], [4.2, -1.0]]), 0.3).all()


@pytest.mark.parametrize(
    ("category", "noun"),
    [
        ("vehicle.car", "car"),
        ("vehicle.bus.rigid", "bus"),
        ("vehicle.emergency.ambulance", "ambulance"),
        ("vehicle.construction", "construction vehicle"),
        ("truck", "truck"),
        ("other_vehicle", "vehicle"),
        ("", "vehicle"),
    ],
)
def test_nouns(category: str, noun: str) -> None:
    assert SceneObject("x", category, np.zeros(2), 0.0, True, 4.0, 2.0).noun == noun


def test_values_are_checked() -> None:
    with pytest.raises(ShapeError, match="object centre_m"):
        SceneObject("x", "", np.zeros(3), 0.0, True, 4.0, 2.0)
    with pytest.raises(ShapeError, match="object rgb"):
        SceneObject("x", "", np.zeros(2), 0.0, True, 4.0, 2.0, rgb=np.zeros(4))
    with pytest.raises(ShapeError, match="world_from_ego"):
        Scene(Street().bev(), (), np.zeros((4, 4)))


def test_a_front_grid_holds_only_what_is_ahead() -> None:
    street = Street(BEVGrid.front()).car("ahead", 10, 0).car("behind", -10, 0)
    assert [item.id for item in street.scene().objects] == ["ahead"]
