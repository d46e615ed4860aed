"""What is not to be passed or to be near, small wishes to one side, and shifts along our lane."""

from __future__ import annotations

import pytest
from street import BLUE, RED, WHITE, WORLD_FROM_EGO, Street

from grounding import Answer, Grounder
from grounding.dialogue.session import Session
from grounding.language.parser import parse

PARKED = Street().car("r", 24, -6, RED).car("w", 38, -6, WHITE)
SILVER = (150, 152, 155)


def session(street: Street) -> Session:
    grounder = Grounder()
    grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
    return grounder.session()


def ask(text: str, street: Street = PARKED) -> Answer:
    return session(street).say(text)


@pytest.mark.parametrize(
    "text",
    [
        "don't go past the red car",
        "never drive beyond the red car",
        "no further than the red car",
        "stop no farther than the red car",
        "not past the red car please",
        "don't go any further than the red car",
    ],
)
def test_what_is_not_to_be_passed_is_a_limit(text: str) -> None:
    answer = ask(text)
    assert answer.target is not None, answer.text()
    assert answer.target.ego_m[0] < 24 - 2.3
    assert answer.query.limit is not None
    assert not answer.dropped


def test_a_goal_that_is_not_beyond_the_limit_stays() -> None:
    talk = session(PARKED)
    first = talk.say("park behind the red car").target
    kept = talk.say("don't go past it")
    assert first is not None
    assert kept.target is not None
    assert kept.target.cell == first.cell


@pytest.mark.parametrize("text", ["no further than the red car", "actually no further than the red car"])
def test_a_goal_beyond_the_limit_is_given_up(text: str) -> None:
    talk = session(PARKED)
    talk.say("stop past the red car")
    answer = talk.say(text)
    assert answer.target is not None
    assert answer.target.ego_m[0] < 24 - 2.3


@pytest.mark.parametrize("text", ["you must not go faster", "don't drive any faster", "never go faster"])
def test_not_faster_is_no_stop(text: str) -> None:
    assert ask(text).pace == "slower"


@pytest.mark.parametrize(
    ("text", "noun"),
    [
        ("park away from the red car", "car"),
        ("stop well away from the pedestrians", "pedestrian"),
        ("park somewhere without people near", "person"),
        ("pull over where there are no buses", "bus"),
        ("stop with no vans around", "van"),
    ],
)
def test_away_from_rules_nearness_out(text: str, noun: str) -> None:
    (excluded,) = parse(text, revised=False).query.excluded
    assert (excluded.relation, excluded.noun) == ("near", noun)


def test_a_place_away_from_a_vehicle_is_not_near_it() -> None:
    street = Street().car("r", 12, -6, RED)
    near, away = ask("park at the kerb", street).target, ask("park away from the red car", street).target
    assert near is not None
    assert away is not None
    assert abs(away.ego_m[0] - 12) > 4.6 + 5 - 0.5


def test_a_distance_away_from_a_vehicle_is_a_gap() -> None:
    query = parse("stop six metres away from the red car", revised=False).query
    assert (query.relation, query.distance_m, query.distance_of) == ("near", 6.0, "referent")


@pytest.mark.parametrize(
    ("text", "sign"),
    [
        ("keep left a touch", 1),
        ("move a bit to the right", -1),
        ("a touch closer to the kerb", -1),
        ("move a bit to the left, those cars are close", 1),
    ],
)
def test_a_small_wish_to_one_side_needs_no_goal(text: str, sign: int) -> None:
    plain, moved = ask("carry on", Street()).target, ask(text, Street()).target
    assert plain is not None
    assert moved is not None
    assert 0.2 < sign * float(moved.ego_m[1] - plain.ego_m[1]) < 1.0


@pytest.mark.parametrize(
    ("text", "metres"),
    [("back up two or three metres", 2.5), ("go forward 10 to 20 metres", 15.0), ("stop in 3 or 4 metres", 3.5)],
)
def test_an_estimate_is_its_middle(text: str, metres: float) -> None:
    reading = parse(text)
    assert reading.query.distance_m == metres
    assert not reading.corrections


@pytest.mark.parametrize(
    ("text", "relation"),
    [("don't park here, behind the red car", "behind"), ("don't stop here, past the van", "past")],
)
def test_a_place_instead_of_here(text: str, relation: str) -> None:
    query = parse(text, revised=False).query
    assert query.relation == relation
    assert not query.excluded


def test_a_turn_at_a_vehicle_is_made_there() -> None:
    here, there = ask("turn around").target, ask("turn around at the white car").target
    assert here is not None
    assert there is not None
    assert there.ego_m[0] > here.ego_m[0] + 10


def test_who_is_called_just_so_is_meant() -> None:
    street = Street().car("w", 14, -6, (235, 236, 238)).car("s", 30, -6, SILVER)
    answer = ask("stop next to the silver car", street)
    assert answer.referent is not None
    assert answer.referent.item.id == "s"


@pytest.mark.parametrize(
    "text", ["wait until the car coming up behind has gone past", "let the car behind us by first"]
)
def test_who_comes_up_from_behind_is_awaited(text: str) -> None:
    street = Street().car("b", -20, 0, BLUE, speed_mps=6).car("r", 20, -6, RED)
    answer = ask(text, street)
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "b"
    assert answer.query.trigger == "pass"


def test_a_fallback_behind_its_condition() -> None:
    reading = parse("stop behind the red car, or at the kerb if there's no room")
    assert reading.otherwise is not None
    assert reading.otherwise.query.road_side == "kerb"


def test_to_keep_a_distance_from_who_drives_ahead_is_to_follow() -> None:
    street = Street().car("r", 20, 0, RED, speed_mps=4)
    followed = ask("follow the red car", street).target
    careful = ask("keep a safe distance from the red car in front", street).target
    assert followed is not None
    assert careful is not None
    assert careful.cell == followed.cell
