"""Turns that add to a plan, or correct one part of it: what they do not name stays, and what they name is found."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, GREY, RED, WHITE, WORLD_FROM_EGO, YELLOW, Street, area

from appocc.nuscenes.maps import VectorMap
from grounding import Grounder
from grounding.answer import Answer
from grounding.dialogue.session import Session
from grounding.language.parser import parse

VAN = "vehicle.van"


def street() -> Street:
    """Cars on the right: white, red, white, blue, white; a yellow one moves ahead of us, a black one comes."""
    row = Street().car("w1", 10, -5, WHITE).car("red", 18, -5, RED).car("w2", 27, -5, WHITE)
    row = row.car("blue", 33, -5, BLUE).car("w3", 39, -5, WHITE)
    return row.car("black", 35, 4, BLACK, np.pi, 6.0)


def free() -> Session:
    return Street().car("behind", -30, -5, WHITE).grounder().session()


def say(session: Session, *turns: str) -> Answer:
    *before, last = turns
    for turn in before:
        session.say(turn)
    return session.say(last)


def vehicle(answer: Answer) -> str:
    assert answer.referent is not None, answer.text()
    return answer.referent.item.id


def ahead_m(answer: Answer) -> float:
    assert answer.target is not None, answer.text()
    return float(answer.target.ego_m[0])


def plan(answer: Answer) -> list[str | None]:
    return [step.query.action for step in answer.steps]


# The place of a landmark


@pytest.mark.parametrize(
    "turn", ["a bit before it", "on the right shortly before it", "no, before it please", "short of it on the left"]
)
def test_a_place_without_a_noun_is_at_the_landmark_spoken_of(turn: str) -> None:
    grounder = Grounder()
    grounder.set_street_map(VectorMap((), (), {"crossing": (area(22, 25),)}))
    scene = Street().car("b", 50, -5, BLUE)
    grounder.set_scene(scene.bev(), scene.boxes(), WORLD_FROM_EGO)
    answer = say(grounder.session(), "stop at the crossing", turn)
    assert answer.status == "ok", answer.text()
    assert [one.noun for one in answer.query.secondary] == ["crossing"]
    assert ahead_m(answer) < 22


# What belongs to which vehicle


@pytest.mark.parametrize(
    ("command", "noun", "colour"),
    [
        ("drive past the red car and stop behind the truck", "truck", None),
        ("pass the white van and stop next to the car", "car", None),
        ("overtake the blue car and then park behind the bus", "bus", None),
        ("follow the nearest van and then stop by the car", "car", None),
        ("go past the silver truck, then pull over in front of the black van", "van", "black"),
    ],
)
def test_the_vehicle_of_a_step_keeps_to_its_own_words(command: str, noun: str, colour: str | None) -> None:
    reading = parse(command)
    assert not reading.doubt
    referent = reading.query.referent
    assert referent is not None
    assert (referent.noun, referent.colour, referent.qualifiers) == (noun, colour, ())


@pytest.mark.parametrize(
    ("turn", "id_"),
    [
        ("no, behind the first white car after it", "w2"),
        ("better next to the white car before it", "w1"),
        ("sorry, in front of the blue car past it", "blue"),
        ("actually behind the white car in front of it", "w2"),
    ],
)
def test_a_vehicle_is_told_by_the_one_spoken_of(turn: str, id_: str) -> None:
    assert vehicle(say(street().grounder().session(), "stop next to the red car", turn)) == id_


@pytest.mark.parametrize(
    ("turn", "id_"),
    [("no, the first one", "w1"), ("make it the third one", "w3"), ("sorry, I meant the first", "w1")],
)
@pytest.mark.parametrize("command", ["park behind the second white car", "stop next to the second white car"])
def test_an_ordinal_counts_vehicles_and_not_what_is_offered(command: str, turn: str, id_: str) -> None:
    assert vehicle(say(street().grounder().session(), command, turn)) == id_


@pytest.mark.parametrize(
    "asked", ["is there anything coming?", "any oncoming traffic?", "what is the black car doing?"]
)
@pytest.mark.parametrize("turn", ["leave it then, stay behind", "no then, just stay behind"])
def test_to_stay_behind_is_behind_the_vehicle_of_the_plan(asked: str, turn: str) -> None:
    session = street().car("yellow", 20, 0, YELLOW, 0.0, 4.0).grounder().session()
    answer = say(session, "overtake the yellow car", asked, turn)
    assert (vehicle(answer), answer.query.action) == ("yellow", "follow")


def test_another_place_is_no_yes_to_the_one_that_is_offered() -> None:
    tight = Street().car("g", 14, -5, GREY).car("van", 20, -5, WHITE, category=VAN, size_wlh_m=(2.0, 5.0, 2.0))
    session = tight.car("w", 26, -5, WHITE).grounder().session()
    assert say(session, "park behind the van", "then after the van please").query.relation == "past"


# Additions


@pytest.mark.parametrize(
    "turn",
    [
        "but first drop me off at the red car",
        "oh and before that, stop by the red car",
        "on the way, stop at the red car",
        "I need to get something from the red car first",
        "before we do that, swing by the red car",
        "can we stop at the red car on the way?",
        "the red car first",
    ],
)
def test_a_stop_before_the_plan_keeps_the_plan(turn: str) -> None:
    answer = say(street().grounder().session(), "stop next to the blue car", turn)
    assert answer.status == "ok", answer.text()
    assert [step.referent.item.id for step in answer.steps if step.referent] == ["red", "blue"]


def test_a_stop_without_a_place_on_the_way() -> None:
    answer = say(street().grounder().session(), "stop next to the blue car", "stop for a sec on the way")
    assert plan(answer) == ["stop", "stop"]
    assert vehicle(answer) == "blue"


@pytest.mark.parametrize("turn", ["first right", "the first", "let the red car go first", "the first white car"])
def test_first_is_not_always_before(turn: str) -> None:
    answer = say(street().grounder().session(), "stop next to the blue car", turn)
    assert plan(answer) in (["stop"], ["give_way", "stop"])


@pytest.mark.parametrize(
    "turn",
    [
        "and wait there five minutes for my wife",
        "wait there till my mum comes out",
        "then wait there for two minutes",
        "stay there until I'm back",
        "wait there for her, it takes ten minutes",
    ],
)
def test_a_wait_at_the_goal_keeps_the_goal(turn: str) -> None:
    session = street().car("p", 12, 6, None, category="human.pedestrian.adult", size_wlh_m=(0.6, 0.6, 1.7))
    talk = session.grounder().session()
    before = ahead_m(talk.say("stop next to the blue car"))
    answer = talk.say(turn)
    assert answer.status == "ok", answer.text()
    assert vehicle(answer) == "blue"
    assert ahead_m(answer) == pytest.approx(before, abs=0.5)


@pytest.mark.parametrize("turn", ["keep a good distance please", "keep a safe gap", "keep some distance"])
def test_distance_to_the_vehicle_that_is_followed(turn: str) -> None:
    session = street().car("yellow", 24, 0, YELLOW, 0.0, 2.0).grounder().session()
    before = ahead_m(session.say("follow the yellow car"))
    answer = session.say(turn)
    assert answer.query.action == "follow"
    assert ahead_m(answer) <= before


# Distances


@pytest.mark.parametrize(
    ("turns", "metres"),
    [
        (("drive on 20 metres, then stop",), 20),
        (("go 20 metres and pull over on the right",), 20),
        (("go straight ahead for 15 metres and let me out",), 15),
        (("carry on", "and then stop in 15 metres"), 15),
        (("keep going straight for now", "then pull over on the right after 25 metres"), 25),
        (("keep going straight for now", "then pull over on the right after 25 metres", "make it 15"), 15),
        (("go 20 metres and park on the right", "no wait, 12"), 12),
    ],
)
def test_a_distance_is_driven_once(turns: tuple[str, ...], metres: float) -> None:
    answer = say(free(), *turns)
    assert len(answer.steps) == 1
    assert ahead_m(answer) == pytest.approx(metres + 1.3, abs=2.5)


def test_a_drive_before_a_place_of_its_own_stays() -> None:
    answer = say(street().grounder().session(), "go 8 metres and then stop next to the blue car")
    assert plan(answer) == ["other", "stop"]


# Ordinary talk


@pytest.mark.parametrize(
    ("command", "turn"),
    [
        ("stop for a moment", "found it, carry on"),
        ("stop here a sec", "okay, you can drive on"),
        ("pull over a minute", "all good, keep going"),
        ("stop next to the blue car", "cancel, keep driving"),
        ("stop next to the blue car", "forget it, drive on"),
        ("park on the right", "never mind, keep going"),
        ("park on the right", "cancel that and carry on"),
    ],
)
def test_driving_on_gives_up_a_stop(command: str, turn: str) -> None:
    answer = say(Street().car("blue", 33, -5, BLUE).grounder().session(), command, turn)
    assert answer.status == "ok", answer.text()
    assert (answer.query.action, answer.query.manoeuvre, answer.query.referent) == ("other", "onward", None)


@pytest.mark.parametrize("turn", ["yes carry on", "do carry on"])
def test_carrying_on_agrees_with_a_place(turn: str) -> None:
    assert vehicle(say(street().grounder().session(), "stop next to the blue car", turn)) == "blue"


@pytest.mark.parametrize(
    ("turn", "side", "metres"),
    [
        ("drop me 20 metres further on, on the right", "right", 20),
        ("let me out 15 metres further on on the left side", "left", 15),
    ],
)
def test_a_side_and_a_distance_are_a_new_place(turn: str, side: str, metres: float) -> None:
    answer = say(free(), "stop in 8 metres", turn)
    assert (answer.query.goal_side, answer.query.distance_m) == (side, metres)
    assert ahead_m(answer) == pytest.approx(metres + 1.3, abs=2.5)


@pytest.mark.parametrize(
    "remark",
    ["my friend lives by the blue car", "my sister is parked in the blue car", "that blue car is my brother's"],
)
def test_it_is_the_vehicle_of_a_remark(remark: str) -> None:
    assert vehicle(say(street().grounder().session(), "go straight", remark, "stop next to it")) == "blue"


# Corrections that begin with "but"


@pytest.mark.parametrize(
    ("turn", "named"),
    [
        ("but stop before the blue car", "blue"),
        ("but park behind the blue car please", "blue"),
        ("but I get out at the blue car, so stop just after it", "blue"),
    ],
)
def test_but_and_a_command_is_another_place_and_no_stop_on_the_way(turn: str, named: str) -> None:
    answer = say(street().grounder().session(), "stop behind the red car", turn)
    assert (vehicle(answer), len(answer.steps)) == (named, 1)


def test_but_first_is_a_stop_on_the_way() -> None:
    answer = say(street().grounder().session(), "stop behind the blue car", "but first drop me at the red car")
    assert plan(answer) == ["stop", "stop"]


@pytest.mark.parametrize(
    ("turn", "nearer"), [("but closer to the blue car", 1.0), ("a bit closer to the red one", -1.0)]
)
def test_a_place_between_two_moves_towards_the_one_that_is_named(turn: str, nearer: float) -> None:
    scene = Street().car("red", 15, -5, RED).car("blue", 35, -5, BLUE)
    session = scene.grounder().session()
    before = say(session, "stop between the red car and the blue car")
    assert nearer * (ahead_m(say(session, turn)) - ahead_m(before)) > 0.5


# What "that" points at


@pytest.mark.parametrize(
    "asked", ["is there a blue car about?", "how far is the blue car?", "is that a blue car up there?"]
)
@pytest.mark.parametrize("turn", ["stop behind that", "yes that's ours. pull in behind that instead"])
def test_that_is_what_was_asked_about(asked: str, turn: str) -> None:
    assert vehicle(say(street().grounder().session(), "stop behind the red car", asked, turn)) == "blue"


def test_a_place_without_that_is_at_the_vehicle_of_the_goal() -> None:
    turns = ("stop next to the red car", "is there a blue car about?", "stop behind")
    assert vehicle(say(street().grounder().session(), *turns)) == "red"
