"""A conversation while the scene moves on: the referent is kept, lost ones are told, events are awaited."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from street import BLUE, RED, WHITE, Street

from appocc.geometry import quaternion_from_yaw, transform
from grounding.dialogue.plans.following import has_happened
from grounding.dialogue.session import Session
from grounding.requests import Sighting


def pose(x_m: float) -> np.ndarray:
    return transform(quaternion_from_yaw(0.0), [x_m, 0.0, 0.0])


def begin(street: Street, boxes: bool = True) -> Session:
    grounder = street.grounder()
    grounder.set_scene(street.bev(), street.boxes() if boxes else None, pose(0.0))
    return grounder.session()


def test_the_referent_keeps_its_id() -> None:
    session = begin(Street().car("lead", 18, 0, RED, speed_mps=6).car("other", 30, -5, RED))
    session.say("follow the nearest red car")
    later = Street().car("lead", 24, 0, RED, speed_mps=6).car("other", 14, -5, RED)
    answer = session.update(later.bev(), later.boxes(), pose(16.0))
    assert answer is not None
    assert answer.referent is not None
    assert (answer.status, answer.referent.item.id) == ("ok", "lead")


def test_without_ids_it_is_the_nearest_vehicle_that_looks_the_same() -> None:
    session = begin(Street().car("a", 14, -5, RED).car("b", 26, -5, WHITE), boxes=False)
    session.say("stop behind the red vehicle")
    later = Street().car("b", 22, -5, WHITE).car("a", 10, -5, RED)
    answer = session.update(later.bev(), None, pose(4.0))
    assert answer is not None
    assert answer.referent is not None
    assert answer.referent.item.centre_m == pytest.approx([10, -5], abs=0.3)


def test_a_lost_referent_is_told_and_found_again() -> None:
    street = Street().car("lead", 18, 0, RED, speed_mps=6).car("other", 30, -5, BLUE)
    session = begin(street)
    session.say("follow the red car")
    without = Street().car("other", 28, -5, BLUE)
    lost = session.update(without.bev(), without.boxes(), pose(2.0))
    assert lost is not None
    assert (lost.status, lost.target) == ("not_found", None)
    assert "is lost" in lost.text()
    again = session.update(street.bev(), street.boxes(), pose(3.0))
    assert again is not None
    assert again.status == "ok"


def test_a_place_without_a_vehicle_stays_where_it_is_in_the_world() -> None:
    session = begin(Street().car("red", 30, -5, RED))
    first = session.say("stop in 16 metres")
    street = Street().car("red", 24, -5, RED)
    second = session.update(street.bev(), street.boxes(), pose(6.0))
    assert first.target is not None
    assert second is not None
    assert second.target is not None
    assert second.target.world_m == pytest.approx(first.target.world_m, abs=0.7)


def test_a_step_that_is_done_is_left_out() -> None:
    session = begin(Street().car("red", 30, -5, RED))
    answer = session.say("stop in 8 metres and then park behind the red car")
    assert len(answer.steps) == 2, answer.text()
    street = Street().car("red", 22, -5, RED)
    first = answer.steps[0].target
    assert first is not None
    driven_m = float(first.ego_m[0]) - 1.4
    later = session.update(street.bev(), street.boxes(), pose(driven_m))
    assert later is not None
    assert len(later.steps) == 1
    assert any("is done" in reason for reason in later.reasons)


@pytest.mark.parametrize(
    ("event", "x_m", "speed_mps", "happened"),
    [
        ("leave", 18.0, 0.0, False),
        ("leave", 26.0, 6.0, True),
        ("pass", 18.0, 0.0, False),
        ("pass", -6.0, 6.0, True),
        ("stop", 18.0, 0.0, True),
        ("stop", 18.0, 5.0, False),
        ("other", 18.0, 0.0, False),
    ],
)
def test_awaited_events(event: str, x_m: float, speed_mps: float, happened: bool) -> None:
    before = Street().car("a", 18, 0, RED).scene()
    first = Sighting.of(before.objects[0], before)
    now = Street().car("a", x_m, 0, RED, speed_mps=speed_mps).scene()
    assert has_happened(event, first, now.objects[0], now) == happened


def test_a_vehicle_that_is_gone_has_left() -> None:
    scene = Street().car("a", 18, 0, RED).scene()
    first = replace(Sighting.of(scene.objects[0], scene))
    assert has_happened("leave", first, None, scene)
    assert not has_happened("stop", first, None, scene)


def test_an_awaited_event_ends_its_step() -> None:
    street = Street().car("red", 14, -5, RED).car("blue", 28, -5, BLUE)
    session = begin(street)
    answer = session.say("wait until the red car leaves and then park behind the blue car")
    assert [step["awaits"] for step in answer.to_dict()["steps"]] == ["leave", None]
    still = session.update(street.bev(), street.boxes(), pose(0.0))
    assert still is not None
    assert len(still.steps) == 2
    later = Street().car("red", 24, 0, RED, speed_mps=6).car("blue", 28, -5, BLUE)
    gone = session.update(later.bev(), later.boxes(), pose(0.0))
    assert gone is not None
    assert [step.query.action for step in gone.steps] == ["park"]


def test_what_was_found_instead_is_no_question_at_the_next_moment() -> None:
    session = begin(Street().car("red", 18, -5, RED).car("white", 30, -5, WHITE))
    assert session.say("stop behind the bus").status == "not_found"
    offered = [one.item.id for one in session.candidates]
    later = Street().car("red", 17, -5, RED).car("white", 29, -5, WHITE)
    session.update(later.bev(), later.boxes(), pose(1.0))
    assert session.question == ""
    assert [one.item.id for one in session.candidates] == offered != []


def test_a_proposal_holds_at_the_next_moment() -> None:
    session = begin(Street().car("lead", 18, 0, RED, speed_mps=6).car("white", 30, -5, WHITE))
    asked = session.say("park behind the red car")
    assert "shall we follow it?" in asked.question
    later = Street().car("lead", 20, 0, RED, speed_mps=6).car("white", 29, -5, WHITE)
    session.update(later.bev(), later.boxes(), pose(1.0))
    assert (session.question, session.proposes) == (asked.question, True)
    answer = session.say("yes")
    assert answer.referent is not None
    assert (answer.status, answer.query.action) == ("ok", "follow")
    assert answer.referent.item.centre_m == pytest.approx([20, 0], abs=0.3), "where it is now"


def test_a_proposal_about_a_lost_vehicle_is_dropped() -> None:
    session = begin(Street().car("lead", 18, 0, RED, speed_mps=6).car("white", 30, -5, WHITE))
    session.say("park behind the red car")
    without = Street().car("white", 29, -5, WHITE)
    session.update(without.bev(), without.boxes(), pose(1.0))
    assert (session.question, session.proposes) == ("", False)


def no_room(x_m: float) -> Street:
    """Three parked cars close to each other, seen from `x_m` ahead of the start."""
    street = Street()
    for name, at_m, rgb in (("white", 14, WHITE), ("red", 20, RED), ("blue", 26, BLUE)):
        street.car(name, at_m - x_m, -5, rgb)
    return street


def test_a_place_that_was_agreed_to_stays_where_it_is_in_the_world() -> None:
    session = begin(no_room(0.0))
    asked = session.say("park behind the red car")
    assert "no room there" in asked.question
    agreed = session.say("yes")
    for x_m in (1.0, 2.0):
        street = no_room(x_m)
        later = session.update(street.bev(), street.boxes(), pose(x_m))
        assert later is not None
        assert later.status == "ok", later.text()
        assert agreed.target is not None
        assert later.target is not None
        assert later.target.world_m == pytest.approx(agreed.target.world_m, abs=0.7)


def test_a_place_that_was_agreed_to_can_be_moved_and_keeps_that_while_driving() -> None:
    session = begin(Street().car("white", 14, -5, WHITE).car("red", 20, -5, RED))
    assert "no room there" in session.say("park behind the red car").question
    agreed, moved = session.say("yes"), session.say("a metre further")
    assert agreed.target is not None
    assert moved.target is not None
    assert moved.target.world_m[0] - agreed.target.world_m[0] == pytest.approx(1.0, abs=0.45), moved.text()
    street = Street().car("white", 13, -5, WHITE).car("red", 19, -5, RED)
    later = session.update(street.bev(), street.boxes(), pose(1.0))
    assert later is not None
    assert later.target is not None, later.text()
    assert later.target.world_m == pytest.approx(moved.target.world_m, abs=0.7), "not moved twice"
