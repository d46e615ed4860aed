"""Both ends of "between", the closest to a landmark, distances in words, conditions on room, and later steps."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, GREEN, RED, WHITE, WORLD_FROM_EGO, Street

from grounding import Answer, Grounder
from grounding.dialogue.session import Session
from grounding.language.alternatives import as_condition
from grounding.language.parser import parse

# Two gaps of a car in a row at the kerb: behind and in front of the red car.
ROW = Street().car("b", 8, -6, BLUE).car("r", 20, -6, RED).car("w", 32, -6, WHITE)


def session(street: Street) -> Session:
    grounder = Grounder()
    grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
    return grounder.session()


def ask(text: str, street: Street = ROW) -> Answer:
    return session(street).say(text)


def place_of(answer: Answer) -> float:
    assert answer.target is not None, answer.text()
    return float(answer.target.ego_m[0])


@pytest.mark.parametrize(
    ("text", "x_m"),
    [
        ("park between the red car and the car behind it", 14),
        ("stop between the red car and the one in front of it", 26),
        ("park in the gap between the red car and the vehicle ahead of it", 26),
        ("park between the red car and the next car", 26),
    ],
)
def test_the_other_end_of_between_is_told_by_its_relation(text: str, x_m: float) -> None:
    assert abs(place_of(ask(text)) - x_m) < 2


def test_a_vehicle_in_between_makes_no_pair() -> None:
    answer = ask("park between the blue car and a car")
    assert answer.referent is not None
    assert answer.referent.partner is not None
    assert answer.referent.partner.id == "r"


@pytest.mark.parametrize(
    "text",
    [
        "stop beside the car nearest the bus",
        "stop next to the car closest to the bus",
        "stop by the nearest car to the bus",
    ],
)
def test_the_closest_to_a_landmark_is_measured_from_it_however_far(text: str) -> None:
    bus = {"size_wlh_m": (2.5, 11.0, 3.2), "category": "vehicle.bus.rigid"}
    street = Street().car("near", 12, -6, RED).car("far", 20, 6, BLUE, 3.14).car("bus", 36, -6, GREEN, **bus)  # type: ignore[arg-type]
    answer = ask(text, street)
    assert answer.referent is not None
    assert answer.referent.item.id == "far"


def test_a_colour_of_the_landmark_is_not_that_of_the_vehicle() -> None:
    query = parse("go to the car nearest to the red one and stop behind it").query
    assert query.referent is not None
    assert query.referent.colour is None
    assert [(one.colour, one.of) for one in query.secondary] == [("red", "referent")]


@pytest.mark.parametrize(
    "text",
    [
        "stop behind the red car, but not too close",
        "stop behind the red car at a safe distance",
        "stop behind the red car and leave some room",
        "stop behind the red car with plenty of space",
    ],
)
def test_a_distance_in_words_is_a_larger_gap(text: str) -> None:
    street = Street().car("r", 24, -6, RED)
    assert place_of(ask(text, street)) < place_of(ask("stop behind the red car", street)) - 0.7


def test_a_follower_keeps_a_safe_distance_anyway() -> None:
    street = Street().car("v", 30, 0, RED, speed_mps=6.0)
    answer = ask("follow the red car at a safe distance", street)
    assert not answer.dropped
    assert place_of(answer) == place_of(ask("follow the red car", street))


def test_who_drives_is_followed_rather_than_who_is_parked() -> None:
    street = Street().car("parked", 10, -6, WHITE).car("moving", 34, 0, WHITE, speed_mps=8.0)
    answer = ask("follow the white car", street)
    assert answer.referent is not None
    assert answer.referent.item.id == "moving"


@pytest.mark.parametrize(
    ("question", "condition"),
    [
        ("is there a gap behind the bus? if so park there", "if there is a gap behind the bus, park there"),
        (
            "any room by it? if there is stop there, if not go on",
            "if there is any room by it, stop there, if not go on",
        ),
        ("is there any space behind it? if not, go on", "if there is no space behind it, go on"),
        ("is there a gap behind the bus? park there", ""),
        ("is the bus moving? if so follow it", "if the bus is moving, follow it"),
        ("is the red car parked? if not, stay behind it", "if the red car is not parked, stay behind it"),
        ("is the red car far away? if not, stop", ""),
    ],
)
def test_a_question_whose_answer_decides_is_a_condition(question: str, condition: str) -> None:
    assert as_condition(question) == condition


@pytest.mark.parametrize(
    ("text", "x_m"),
    [
        ("is there a gap behind the red car? if so park there, otherwise stop beside the white car", 14),
        ("is there room behind the red car? if not, stop beside the white car", 14),
        ("if there's room behind the red car, park there, otherwise drive on", 14),
    ],
)
def test_the_scene_tells_whether_there_is_room(text: str, x_m: float) -> None:
    assert abs(place_of(ask(text)) - x_m) < 3


def test_a_step_beyond_the_map_is_planned_later() -> None:
    street = Street().car("far", 28, -6, WHITE)
    answer = ask("drive past the white car and then pull over on the right", street)
    assert answer.status == "ok"
    assert [step.plan.later for step in answer.steps] == [False, True]
    assert place_of(answer) > 30
    assert "is planned once more of the road is seen" in answer.text()
    assert answer.to_dict()["steps"][1]["later"] is True


def test_past_a_vehicle_that_the_step_before_overtakes_is_where_that_ends() -> None:
    street = Street().car("bus", 12, 0, RED, speed_mps=2.0, category="vehicle.bus.rigid", size_wlh_m=(2.5, 8.0, 3.2))
    answer = ask("overtake the bus and then stop at the side once we're past it", street)
    assert answer.status == "ok"
    assert place_of(answer) > 20


def test_without_room_at_the_kerb_our_lane_is_asked_about() -> None:
    row = Street()
    for i in range(10):
        row.car(f"c{i}", 4.9 * i - 4, -6.8, BLACK)
    talk = session(row)
    asked = talk.say("pull over")
    assert asked.status == "ambiguous"
    assert asked.question.startswith("there is no room at the edge of the road ahead: shall we stop in our lane")
    assert talk.say("yes").target is not None


def test_an_offer_in_our_lane_says_so() -> None:
    row = Street()
    for i in range(14):
        row.car(f"c{i}", 4.9 * i - 30, -6.8, RED if i == 9 else BLACK)
    asked = ask("park behind the red car", row)
    assert "shall we stop in our lane, " in asked.question


def test_who_is_followed_once_it_leaves_is_named_in_both_steps() -> None:
    street = Street().car("bus", 14, 0, RED, speed_mps=1.0, category="vehicle.bus.rigid", size_wlh_m=(2.5, 8.0, 3.2))
    answer = ask("follow the bus when it leaves", street)
    assert answer.status == "ok"
    assert [(step.query.action, step.referent and step.referent.item.id) for step in answer.steps] == [
        ("wait", "bus"),
        ("follow", "bus"),
    ]


@pytest.mark.parametrize("text", ["set off", "let the green car go by first, then set off"])
def test_to_set_off_is_to_drive_on(text: str) -> None:
    street = Street().car("g", 30, 3.5, GREEN, 3.14, speed_mps=8.0)
    answer = ask(text, street)
    assert answer.status == "ok"
    assert answer.steps[-1].target is not None
    assert answer.steps[-1].target.ego_m[0] > 12


def test_a_stop_beyond_the_map_is_at_its_end_for_now() -> None:
    answer = ask("stop right after the white car", Street().car("w", 36, -6, WHITE))
    assert place_of(answer) > 30
    assert "we go to the end of the map for now" in answer.text()


def test_a_place_that_gives_way_for_another_moves_too() -> None:
    row = Street()
    for i in range(6):
        row.car(f"c{i}", 5.2 * i + 12, -3.4, RED if i == 3 else BLACK)
    talk = session(row)
    before = place_of(talk.say("stop behind the red car"))
    assert place_of(talk.say("a bit further back please")) < before - 1
