from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, RED, WHITE, WORLD_FROM_EGO, Street

from appocc.bevmap import ROAD, VEHICLE
from appocc.checks import FloatArray
from appocc.drawing import EGO_LENGTH_M, EGO_WIDTH_M
from grounding.answer import Answer, ground
from grounding.scene import Scene
from grounding.target import Target

HALF_CELL_M = 0.2 + 1e-9
# Half a car (4.4 m x 1.8 m) and half the ego.
LENGTHWISE_M, SIDEWAYS_M = (4.4 + EGO_LENGTH_M) / 2, (1.8 + EGO_WIDTH_M) / 2


def target_of(text: str, scene: Scene) -> Target:
    answer = ground(text, scene)
    assert answer.target is not None, answer.text()
    check_invariants(answer)
    return answer.target


def check_invariants(answer: Answer) -> None:
    """What holds for every target, worked out apart from the code that chose it."""
    target, bev = answer.target, answer.scene.bev
    assert target is not None
    assert bev.grid.centre_of(target.cell) == pytest.approx(target.ego_m)
    assert (WORLD_FROM_EGO @ [*target.ego_m, 0, 1])[:2] == pytest.approx(target.world_m)
    assert np.cos(target.heading_rad - target.heading_ego_rad - np.pi / 2) == pytest.approx(1)
    assert 0 < target.score <= 1
    under = cells_under(target, bev.grid.centres())
    assert not bev.occupancy[VEHICLE][under].any()
    assert bev.occupancy[ROAD][under & bev.occupancy_valid[ROAD]].mean() > 0.85


def cells_under(target: Target, centres: FloatArray) -> FloatArray:
    offset = centres - target.ego_m
    cos, sin = np.cos(target.heading_ego_rad), np.sin(target.heading_ego_rad)
    along, across = offset @ [cos, sin], offset @ [-sin, cos]
    return np.asarray((np.abs(along) < EGO_LENGTH_M / 2) & (np.abs(across) < EGO_WIDTH_M / 2))


def near(target: Target, x_m: float, y_m: float) -> bool:
    """Whether the target is the cell of a place, or one beside it."""
    return bool(np.abs(target.ego_m - [x_m, y_m]).max() <= 2 * HALF_CELL_M)


@pytest.mark.parametrize(
    ("text", "x_m", "y_m"),
    [
        ("stop behind the car", 20 - LENGTHWISE_M - 2.0, -3),
        ("park behind the car", 20 - LENGTHWISE_M - 1.0, -3),
        ("park 4 metres behind the car", 20 - LENGTHWISE_M - 4.0, -3),
        ("stop in front of the car", 20 + LENGTHWISE_M + 2.0, -3),
        ("stop next to the car", 20, -3 + SIDEWAYS_M + 0.8),
        ("stop to the left of the car", 20, -3 + SIDEWAYS_M + 0.8),
        ("stop to the right of the car", 20, -3 - SIDEWAYS_M - 0.8),
        ("go to the car", 20 - LENGTHWISE_M - 2.0, -3),
    ],
)
def test_relations_to_a_car_that_faces_our_way(text: str, x_m: float, y_m: float) -> None:
    target = target_of(text, Street().car("car", 20, -3).scene())
    assert near(target, x_m, y_m), target
    assert target.heading_ego_rad == pytest.approx(0)
    assert target.score > 0.9


def test_a_named_distance_is_kept_or_refused() -> None:
    taken = Street().car("car", 25, -3, RED).car("blocker", 15, -3, BLACK).scene()
    assert ground("park 4 m behind the red car", taken).status == "not_found"
    assert ground("park behind the red car", taken).status == "ok"


def test_a_turned_car_turns_the_place() -> None:
    yaw = 0.3
    target = target_of("stop behind the car", Street().car("car", 15, 0, yaw_rad=yaw).scene())
    away = LENGTHWISE_M + 2.0
    assert near(target, 15 - away * np.cos(yaw), -away * np.sin(yaw))
    assert target.heading_ego_rad == pytest.approx(yaw)


@pytest.mark.parametrize(("relation", "sign"), [("behind", 1), ("in front of", -1)])
def test_a_car_that_comes_towards_us_keeps_its_own_front(relation: str, sign: int) -> None:
    scene = Street().car("car", 15, 3, yaw_rad=np.pi, speed_mps=8).scene()
    answer = ground(f"stop {relation} the car", scene)
    target = target_of(f"stop {relation} the car", scene)
    assert near(target, 15 + sign * (LENGTHWISE_M + 2.0), 3)
    assert target.heading_ego_rad == pytest.approx(0, abs=1e-6)
    assert any("it faces us" in reason for reason in answer.reasons)
    assert any("moves at 8 m/s" in reason for reason in answer.reasons)


def test_one_that_stands_facing_us_in_our_path_is_taken_along_our_way() -> None:
    scene = Street().car("car", 15, -3, yaw_rad=np.pi).scene()
    assert near(target_of("park behind the car", scene), 15 - LENGTHWISE_M - 1.0, -3)
    assert any("our direction of travel" in reason for reason in ground("park behind the car", scene).reasons)


def test_left_and_right_of_a_car_that_faces_us_are_ours() -> None:
    scene = Street().car("car", 15, 2, yaw_rad=np.pi).scene()
    assert near(target_of("stop right of the car", scene), 15, 2 - SIDEWAYS_M - 0.8)
    assert any("left and right are ours" in reason for reason in ground("stop right of the car", scene).reasons)


# Degrees the car is turned, how far the place is from its middle, and where (degrees from ahead, to the left).
ACROSS_M = (4.4 + EGO_WIDTH_M) / 2
LEFT_OF = [
    (0, SIDEWAYS_M, 90),
    (30, SIDEWAYS_M, 120),
    (89, ACROSS_M, 89),
    (90, ACROSS_M, 90),
    (91, ACROSS_M, 91),
    (-91, ACROSS_M, 89),
    (135, SIDEWAYS_M, 45),
    (180, SIDEWAYS_M, 90),
]


@pytest.mark.parametrize("boxes", [True, False])
@pytest.mark.parametrize(("yaw_deg", "contact_m", "at_deg"), LEFT_OF)
def test_left_and_right_are_ours_whichever_way_it_stands(
    yaw_deg: float, contact_m: float, at_deg: float, boxes: bool
) -> None:
    street = Street().car("car", 15, 0, RED, yaw_rad=np.radians(yaw_deg))
    scene = street.scene() if boxes else street.scene_without_boxes()
    away, at = contact_m + 0.8, np.radians(at_deg)
    if boxes and yaw_deg != 135:  # There either half-axis is as near to our left, and a cell decides.
        assert near(target_of("stop left of the red car", scene), 15 + away * np.cos(at), away * np.sin(at))
        assert near(target_of("stop right of the red car", scene), 15 - away * np.cos(at), -away * np.sin(at))
    left, right = (target_of(f"stop {side} of the red vehicle", scene) for side in ("left", "right"))
    assert left.ego_m[1] > 1.5
    assert right.ego_m[1] < -1.5
    assert abs(left.heading_ego_rad) <= np.pi / 4 + 0.05


@pytest.mark.parametrize("yaw_deg", [0, 45, 89, 91, 135, 180])
def test_whose_left_it_is_is_said(yaw_deg: float) -> None:
    scene = Street().car("car", 15, 0, RED, yaw_rad=np.radians(yaw_deg)).scene()
    answer = ground("stop left of the red car", scene)
    check_invariants(answer)
    reasons = " ".join(answer.reasons)
    assert "left and right are ours" in reasons
    assert "left of it" in reasons
    assert ("stands across our way" in reasons) == (yaw_deg in (89, 91)) or yaw_deg in (45, 135)
    assert ("side to bumper" in reasons) == ("stands across our way" in reasons)
    assert answer.target is not None
    assert answer.target.ego_m[1] > 1.5


@pytest.mark.parametrize("text", ["go to the vehicle", "stop behind the vehicle"])
def test_a_quarter_turn_does_not_flip_the_place(text: str) -> None:
    """Of a vehicle whose front is not known, just before and just past standing across our path."""
    places = [
        target_of(text, Street().car("car", 15, 0, RED, yaw_rad=np.radians(yaw)).scene_without_boxes())
        for yaw in (89, 91)
    ]
    assert places[0].ego_m == pytest.approx(places[1].ego_m, abs=0.81)
    assert max(abs(place.heading_ego_rad) for place in places) < 0.1


def test_the_sides_of_a_car_across_our_path_are_named_as_we_see_them() -> None:
    scene = Street().car("car", 15, 0, RED, yaw_rad=np.radians(91)).scene()
    assert any("short of it" in reason for reason in ground("stop next to the red car", scene).reasons)


def test_a_blob_has_no_front_and_says_so() -> None:
    scene = Street().car("car", 15, -3, yaw_rad=np.pi).scene_without_boxes()
    assert near(target_of("stop behind the vehicle", scene), 15 - LENGTHWISE_M - 2.0, -3)
    assert any("its front is not known" in reason for reason in ground("stop behind the vehicle", scene).reasons)


def test_next_to_takes_the_side_towards_us_and_the_other_if_it_must() -> None:
    assert near(target_of("stop next to the car", Street().car("car", 15, 4).scene()), 15, 4 - SIDEWAYS_M - 0.8)
    blocked = Street().car("car", 15, 4, RED).car("x", 14, 1, BLACK).car("y", 18, 1, BLACK)
    blocked.occupancy[ROAD] = 1
    answer = ground("stop next to the red car", blocked.scene())
    assert near(target_of("stop next to the red car", blocked.scene()), 15, 4 + SIDEWAYS_M + 0.8)
    assert any("right of it would be better" in reason and "black car" in reason for reason in answer.reasons)


def test_a_taken_place_moves_the_target_and_the_reason_names_what_took_it() -> None:
    scene = Street().car("car", 25, -3, RED).car("blocker", 18.5, -3, BLACK).scene()
    answer = ground("stop behind the red car", scene)
    target = target_of("stop behind the red car", scene)
    assert target.ego_m[0] < 18.5 - LENGTHWISE_M + 0.4
    assert target.score < 0.5
    assert any("moved" in reason and "taken by the black car" in reason for reason in answer.reasons)


def test_one_stops_behind_a_queue_and_parks_beside_the_vehicle_or_not_at_all() -> None:
    scene = Street().car("car", 25, -3, RED).car("blocker", 19.5, -3, BLACK).scene()
    assert target_of("stop behind the red car", scene).ego_m[0] < 19.5 - LENGTHWISE_M
    assert ground("park behind the red car", scene).status == "not_found"


def test_the_road_moves_the_target() -> None:
    street = Street().car("car", 20, -3, RED)
    street.occupancy[ROAD, 137:142, :] = 0  # from 14.8 to 16.8 m ahead
    answer = ground("park behind the red car", street.scene())
    assert answer.target is not None
    assert answer.target.ego_m[0] + EGO_LENGTH_M / 2 < 15.3
    assert any("leaves the road" in reason for reason in answer.reasons)


def test_road_that_is_not_known_forbids_nothing() -> None:
    street = Street().car("car", 20, -3, RED)
    street.occupancy[ROAD] = 0
    street.road_known[:] = False
    assert near(target_of_unknown(street.scene()), 20 - LENGTHWISE_M - 1.0, -3)


def target_of_unknown(scene: Scene) -> Target:
    target = ground("park behind the red car", scene).target
    assert target is not None
    return target


@pytest.mark.parametrize(
    ("text", "x_m", "y_m", "reason"),
    [
        ("stop right of the car", 20, -6.5, "leaves the road"),
        ("stop in front of the car", 37, 0, "no place in front of it"),
        ("stop 60 m behind the car", 10, 0, "no place behind it lies on the map"),
    ],
)
def test_where_nothing_fits_the_failed_constraint_is_named(text: str, x_m: float, y_m: float, reason: str) -> None:
    answer = ground(text, Street().car("car", x_m, y_m).scene())
    assert answer.status == "not_found"
    assert answer.target is None
    assert answer.referent is not None
    assert any(reason in line for line in answer.reasons), answer.reasons


def test_the_side_of_the_road_for_the_goal() -> None:
    scene = Street().car("car", 15, -0.5, WHITE).scene()
    assert target_of("park on the left near the car", scene).ego_m[1] > 0
    assert target_of("park on the right near the car", scene).ego_m[1] < 0
