"""Corrections of a place in a conversation: away from a crossing, somewhere else, the other vehicle."""

from __future__ import annotations

import pytest
from street import BLUE, RED, WHITE, WORLD_FROM_EGO, Street, area

from appocc.nuscenes.maps import VectorMap
from grounding import Grounder
from grounding.answer import Answer
from grounding.dialogue.session import Session


def session_of(street: Street, vector: VectorMap | None = None) -> Session:
    grounder = Grounder()
    if vector is not None:
        grounder.set_street_map(vector)
    grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
    return grounder.session()


def ahead_m(answer: Answer) -> float:
    assert answer.target is not None, answer.text()
    return float(answer.target.ego_m[0])


@pytest.mark.parametrize("near_m", [22.0, 4.0])  # the crossing is ahead of the place, or behind it
@pytest.mark.parametrize(
    ("reply", "away"),
    [
        ("that's too close to the crossing", True),
        ("a bit further from the crossing", True),
        ("a bit closer to the crossing", False),
        ("that's too far from the crossing", False),
    ],
)
def test_a_place_is_moved_with_respect_to_a_crossing(near_m: float, reply: str, away: bool) -> None:
    crossing = VectorMap((), (), {"crossing": (area(near_m, near_m + 3),)})
    session = session_of(Street().car("b", 50, -5, BLUE), crossing)
    before = ahead_m(session.say("stop in 14 metres"))
    moved = ahead_m(session.say(reply)) - before
    assert abs(moved) > 0.5
    assert (moved < 0) == (away == (near_m > before))


def test_what_the_map_does_not_show_moves_nothing() -> None:
    session = session_of(Street().car("b", 50, -5, BLUE))
    before = ahead_m(session.say("stop in 14 metres"))
    answer = session.say("that's too close to the hydrant")
    assert ahead_m(answer) == before
    assert "no hydrant" in " ".join(answer.reasons)


def test_away_from_the_kerb_is_across_our_way() -> None:
    session = session_of(Street().car("b", 50, -5, BLUE))
    before = session.say("pull over in 14 metres").target
    after = session.say("a bit further from the kerb").target
    assert before is not None
    assert after is not None
    assert after.ego_m[1] > before.ego_m[1] + 0.3
    assert abs(after.ego_m[0] - before.ego_m[0]) < 1


def test_another_place_is_not_a_step_aside() -> None:
    session = session_of(Street().car("b", 12, -5, BLUE).car("w", 26, -5, WHITE))
    before = ahead_m(session.say("find a parking spot on the right"))
    assert abs(ahead_m(session.say("not there, that's too tight")) - before) > 4


def test_tight_is_no_side() -> None:
    answer = session_of(Street().car("b", 12, -5, BLUE)).say("too tight")
    assert "'tight' was read as" not in answer.text()
    assert answer.query.direction is None


def test_the_other_one_is_the_one_that_was_spoken_of() -> None:
    street = Street().car("small", 14, -5, WHITE).car("far", 45, -5, WHITE)
    session = session_of(street.car("big", 24, -5, WHITE, size_wlh_m=(2.5, 9.0, 3.2), category="vehicle.truck"))
    assert session.say("stop behind the nearest white vehicle").referent is not None
    big = session.say("no, the biggest one")
    assert big.referent is not None
    assert big.referent.item.id == "big"
    other = session.say("sorry, the other one")
    assert other.referent is not None
    assert other.referent.item.id == "small"


@pytest.mark.parametrize("reply", ["the one beside us", "I meant the one next to us"])
def test_a_vehicle_beside_us_is_meant(reply: str) -> None:
    session = session_of(Street().car("here", 2, -5, WHITE).car("there", 24, -5, WHITE))
    assert session.say("stop behind the white car").status in ("ok", "ambiguous")
    answer = session.say(reply)
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "here"


def test_the_vehicle_at_the_end_of_a_row() -> None:
    street = Street()
    for number, x in enumerate((10, 18, 26, 34)):
        street = street.car(f"r{number}", x, -5, RED)
    answer = session_of(street).say("stop next to the red car at the end of the row")
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "r3"


def test_who_repeats_a_wish_agrees_to_what_was_offered() -> None:
    session = session_of(Street().car("slow", 16, -1.5, BLUE, speed_mps=5.0))
    offer = session.say("park behind the blue car")
    assert offer.plan.question, offer.text()
    assert session.say("no, park behind the blue car").plan.question
    assert session.say("just park behind it").status == "ok"
