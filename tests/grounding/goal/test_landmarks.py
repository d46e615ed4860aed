"""Places at landmarks of the vector map, and places that keep clear of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from street import EGO, RED, WORLD_FROM_EGO, Street, area

from appocc.bevmap import ROAD
from appocc.checks import FloatArray
from appocc.nuscenes.maps import VectorMap
from grounding import Answer, DrivingStyle, Grounder, GrounderConfig

HALF_M = EGO.length_m / 2


def ask(text: str, landmarks: Mapping[str, list[FloatArray]] | None, street: Street | None = None) -> Answer:
    made = street or Street()
    grounder = Grounder()
    if landmarks is not None:
        grounder.set_street_map(VectorMap((), (), {kind: tuple(found) for kind, found in landmarks.items()}))
    grounder.set_scene(made.bev(), made.boxes(), WORLD_FROM_EGO)
    return grounder.ground(text)


def x_of(answer: Answer) -> float:
    assert answer.target is not None, answer.reasons
    return float(answer.target.ego_m[0])


CROSSING = {"crossing": [area(20, 24)]}


@pytest.mark.parametrize(
    ("text", "gap_m"),
    [
        ("stop before the crossing", 1.0),
        ("stop at the zebra crossing", 1.0),
        ("stop 3 metres before the crosswalk", 3.0),
    ],
)
def test_a_place_short_of_a_crossing(text: str, gap_m: float) -> None:
    assert 20 - (x_of(ask(text, CROSSING)) + HALF_M) == pytest.approx(gap_m, abs=0.5)


def test_a_place_past_a_crossing_is_beyond_it() -> None:
    assert x_of(ask("pull over after the crossing", CROSSING)) - HALF_M > 24


def test_a_stop_line_is_waited_at_and_nobody_stops_behind_it() -> None:
    line = {"stop line": [area(15, 15.4, -8, 2)]}
    for text in ("wait at the stop line", "stop behind the stop line", "stop before the stop line"):
        assert 13 < x_of(ask(text, line)) + HALF_M < 15, text


def test_the_second_crossing_is_counted_along_our_lane() -> None:
    two = {"crossing": [area(20, 24, 0.5, 8), area(20, 24, -8, 0.5), area(32, 35)]}
    assert 30 < x_of(ask("stop at the second crossing", two)) + HALF_M < 32
    assert "no more" in ask("stop at the third crossing", two).reasons[0]


@pytest.mark.parametrize(
    ("landmarks", "told"),
    [(None, "no crossing is known here"), ({"crossing": []}, "no crossing is known ahead of us")],
)
def test_a_landmark_that_is_not_known_is_told_with_a_place_that_would_do(
    landmarks: Mapping[str, list[FloatArray]] | None, told: str
) -> None:
    answer = ask("stop before the crossing", landmarks)
    assert answer.status == "not_found"
    assert told in answer.reasons[0]
    assert answer.plan.nearest is not None


def test_a_landmark_behind_us_is_not_ahead() -> None:
    assert ask("stop before the crossing", {"crossing": [area(-12, -8)]}).status == "not_found"


def test_a_crossing_is_kept_free() -> None:
    assert "kept free" in ask("stop on the crossing", CROSSING).reasons[0]
    place = x_of(ask("pull over", {"crossing": []}))
    moved = x_of(ask("pull over", {"crossing": [area(place - 3, place + 2)]}))
    assert moved - HALF_M > place + 1.5 or moved + HALF_M < place - 2.5


def test_a_turn_at_a_junction_takes_its_side_road() -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    for at in (12.0, 30.0):
        street.occupancy[ROAD, (np.abs(x - at) < 4) & (y > 0)] = 1
    answer = ask("turn left at the second junction", {"junction": [area(8, 16), area(26, 34)]}, street)
    assert x_of(answer) == pytest.approx(30, abs=4)


def test_parking_in_a_car_park_is_beside_those_who_stand_there() -> None:
    street = Street()
    x, y = np.moveaxis(street.grid.centres(), -1, 0)
    street.occupancy[ROAD, (x > 8) & (x < 36) & (y > 0) & (y < 26)] = 1
    street.car("car", 22, 16, RED, yaw_rad=np.pi / 2)
    answer = ask("park in the car park", {"car park": [area(8, 36, 8, 26)]}, street)
    assert answer.target is not None
    assert answer.target.ego_m[1] > 8
    assert abs(answer.target.ego_m[0] - 22) < 5


def test_gaps_are_settings() -> None:
    places = []
    for style in (DrivingStyle(), DrivingStyle(stop_gap_m=4.0)):
        grounder = Grounder(config=GrounderConfig(style=style))
        street = Street().car("car", 25, 0, RED)
        grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
        places.append(x_of(grounder.ground("stop behind the red car")))
    assert places[0] - places[1] == pytest.approx(2.0, abs=0.5)


def test_a_vehicle_by_a_landmark_of_the_map() -> None:
    street = Street().car("near", 12, -5, RED).car("by", 30, -5, RED)
    crossing = {"crossing": [area(34, 38)], "junction": []}
    for text in ("stop behind the car by the crossing", "stop behind the car at the crossing"):
        answer = ask(text, crossing, street)
        assert answer.referent is not None, answer.text()
        assert answer.referent.item.id == "by"
        assert not any("left out" in reason for reason in answer.reasons)
    assert ask("stop behind the car by the junction", crossing, street).status != "ok"
    unknown = ask("stop behind the car by the crossing", None, street)
    assert any("holds no crossing" in reason for reason in unknown.reasons)
