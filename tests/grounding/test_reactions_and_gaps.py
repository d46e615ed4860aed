"""Reactions to what others may do, the n-th gap at the kerb, lengths of vehicles as units, and limits."""

from __future__ import annotations

import pytest
from street import BLUE, RED, WHITE, WORLD_FROM_EGO, Street

from grounding import Answer, Grounder
from grounding.dialogue.session import Session
from grounding.language.parser import parse

# Two gaps of a car in a row at the kerb: behind and in front of the red car.
ROW = Street().car("b", 6, -6, BLUE).car("r", 20, -6, RED).car("w", 34, -6, WHITE)
LEADER = Street().car("l", 14, 0, RED, speed_mps=5)


def session(street: Street) -> Session:
    grounder = Grounder()
    grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
    return grounder.session()


def ask(text: str, street: Street) -> Answer:
    return session(street).say(text)


@pytest.mark.parametrize(
    "text",
    [
        "stop if a child runs out",
        "slow down if someone steps out",
        "brake if anybody crosses",
        "if the car in front stops, stop too",
        "in case a cyclist crosses, give way please",
    ],
)
def test_a_reaction_to_an_event_sets_no_place_now(text: str) -> None:
    answer = ask(text, LEADER)
    assert answer.status == "ok"
    assert answer.target is None
    assert answer.pace is None
    assert any("nothing changes now" in reason for reason in answer.reasons)


def test_a_reaction_to_an_event_keeps_the_goal() -> None:
    talk = session(LEADER)
    followed = talk.say("follow the red car").target
    assert talk.say("stop if somebody crosses").target is None
    kept = talk.say("where are you heading?").target
    assert followed is not None
    assert kept is not None
    assert kept.cell == followed.cell


@pytest.mark.parametrize("text", ["stop if you can", "stop if it is possible", "if the car in front is moving, wait"])
def test_what_is_no_event_is_a_command_now(text: str) -> None:
    assert not parse(text).condition


@pytest.mark.parametrize(
    "text", ["stop if", "if", "if, stop", "wait behind it if, otherwise", "slow down in case .", "stop if if"]
)
def test_a_condition_without_a_clause_is_no_condition(text: str) -> None:
    assert not parse(text).condition


def test_a_case_may_follow_its_command() -> None:
    answer = ask("overtake the red car if it stops, otherwise stay behind it", LEADER)
    assert [step.query.action for step in answer.steps] == ["follow", "overtake"]
    asked = ask("overtake the red car only if nobody comes the other way, otherwise stay behind it", LEADER)
    assert asked.status == "ambiguous"
    assert {one.query.action for one in asked.alternatives} == {"overtake", "follow"}


@pytest.mark.parametrize(
    ("text", "between"),
    [
        ("park in the second gap", ("r", "w")),
        ("take the second space on the right", ("r", "w")),
    ],
)
def test_gaps_at_the_kerb_are_counted(text: str, between: tuple[str, str]) -> None:
    answer = ask(text, ROW)
    assert answer.target is not None, answer.text()
    at = {"b": 6, "r": 20, "w": 34}
    assert at[between[0]] < answer.target.ego_m[0] < at[between[1]]
    assert not answer.dropped


def test_a_gap_that_is_not_there_is_told() -> None:
    answer = ask("park in the fifth gap", ROW)
    assert answer.status == "not_found"
    assert "gaps ahead at the right edge" in answer.reasons[0]


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("park in front of the red car, about a car length away", 4.5),
        ("park behind the red car, two metres from it", 2.0),
        ("stay a bus length behind the bus", 12.0),
        ("stop a van's length behind the bus", 6.0),
    ],
)
def test_a_short_distance_after_a_place_is_the_gap(text: str, metres: float) -> None:
    query = parse(text).query
    assert (query.distance_m, query.distance_of) == (metres, "referent")


def test_how_far_away_a_vehicle_is_stays_a_description() -> None:
    assert parse("stop behind the van 30 metres away").query.distance_of == "descriptor"


@pytest.mark.parametrize("text", ["no faster than 25", "and no quicker than 30 please"])
def test_a_limit_is_no_no(text: str) -> None:
    talk = session(LEADER)
    talk.say("follow the red car")
    assert talk.say(text).pace == "slower"


@pytest.mark.parametrize(
    "text", ["the next gap", "the one after that", "that's too small", "not that one it's too tight"]
)
def test_a_goal_at_the_kerb_moves_to_the_next_gap(text: str) -> None:
    talk = session(ROW)
    talk.say("park in the first gap")
    moved = talk.say(text)
    assert moved.target is not None, moved.text()
    assert 20 < moved.target.ego_m[0] < 34
    kept = [talk.say("the next gap") for _ in range(4)][-1]
    assert any("the goal stays as it is" in reason for reason in kept.reasons)


@pytest.mark.parametrize(
    ("question", "told"),
    [("how far is that?", "away"), ("how far is the nearest one?", "white car"), ("who's behind us?", "behind")],
)
def test_a_question_does_not_choose_among_the_candidates(question: str, told: str) -> None:
    talk = session(Street().car("w", 14, -6, WHITE).car("v", 26, 6, WHITE).car("o", -12, 0, BLUE, speed_mps=4))
    assert talk.say("stop by the white car").status == "ambiguous"
    answer = talk.say(question)
    assert answer.target is None
    assert any(told in reason for reason in answer.reasons), answer.text()
    assert talk.say("the far one").target is not None


def test_a_vehicle_of_another_description_is_not_the_one_in_talk() -> None:
    talk = session(Street().car("b", 14, -6, BLUE).car("w", 26, -6, WHITE))
    talk.say("what is the blue car doing?")
    answer = talk.say("wait until it leaves, then overtake the white one")
    chosen = [step.referent.item.id for step in answer.steps if step.referent is not None]
    assert chosen == ["b", "w"]


@pytest.mark.parametrize("text", ["ten would be better", "eight, please", "nine is safer"])
def test_a_number_alone_is_the_gap_in_force(text: str) -> None:
    talk = session(Street().car("w", 34, 0, WHITE))
    first = talk.say("stop 5 metres behind the white car").target
    then = talk.say(text).target
    assert first is not None
    assert then is not None
    assert then.ego_m[0] < first.ego_m[0] - 2


@pytest.mark.parametrize(
    "text", ["keep behind the red car but not too close", "stay behind the red car, not too close"]
)
def test_a_follower_keeps_its_distance_anyway(text: str) -> None:
    plain, careful = ask("follow the red car", LEADER), ask(text, LEADER)
    assert plain.target is not None
    assert careful.target is not None
    assert careful.target.cell == plain.target.cell
    assert not careful.dropped


def test_a_metre_or_two_is_a_distance() -> None:
    query = parse("reverse a metre or two").query
    assert (query.manoeuvre, query.distance_m) == ("back", 1.5)
