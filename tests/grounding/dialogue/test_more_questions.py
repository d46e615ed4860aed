"""Questions about landmarks, room, what comes, and what is or will be done; the plan and an open question stay."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, RED, WHITE, WORLD_FROM_EGO, Street, area, told

from appocc.nuscenes.maps import VectorMap
from grounding import Grounder
from grounding.dialogue.session import Session


def drive() -> Session:
    """A van that drives ahead of us, one that comes, one that has passed; two crossings and lights."""
    street = Street().car("van", 22, 0, RED, speed_mps=5.0, size_wlh_m=(2.0, 5.0, 2.2))
    street.car("coming", 34, 4, BLUE, yaw_rad=np.pi, speed_mps=6.0)
    street.car("passed", -15, 4, BLACK, yaw_rad=np.pi, speed_mps=6.0).car("parked", 14, -6, WHITE)
    grounder = Grounder()
    landmarks = {"crossing": (area(20, 24), area(32, 35)), "traffic light": (area(18, 18.4),)}
    grounder.set_street_map(VectorMap((), (), landmarks))
    grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
    session = grounder.session()
    assert session.say("follow the van").status == "ok"
    return session


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("how many zebra crossings can you see?", "2 crossings on our way"),
        ("how far off are the lights?", "the traffic light is 14 m ahead"),
        ("where are the traffic lights?", "the traffic light is 14 m ahead"),
        ("how far to the second crossing?", "the crossing is 28 m ahead"),
        ("is there a crosswalk?", "the crossing is 16 m ahead"),
        ("when do we reach the lights?", "some 4 s at 4 m/s"),
        ("is there a stop line?", "no stop line is known here"),
        ("how soon will the light change?", "not known here: the state of traffic lights"),
        ("where is the van at the crossing?", "red van"),
        ("which bus stop?", ""),
        ("which stop sign?", "no stop sign is known here"),
    ],
)
def test_landmarks_of_the_map_are_told(question: str, expected: str) -> None:
    session = drive()
    goal = session.goal
    assert expected in told(session, question)
    assert goal is not None
    assert session.goal is not None
    assert session.goal.target is goal.target


@pytest.mark.parametrize(
    "question",
    ["is anyone coming?", "any traffic coming?", "what's coming towards us?", "can you see any oncoming cars?"],
)
def test_who_has_passed_does_not_come(question: str) -> None:
    answer = told(drive(), question)
    assert "blue car" in answer
    assert "black car" not in answer


def test_it_is_still_the_vehicle_spoken_of_after_a_look_at_the_others() -> None:
    session = drive()
    session.say("is there anyone coming?")
    answer = session.say("overtake it")
    assert answer.referent is not None
    assert answer.referent.item.id == "van"


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("what are you up to?", "follow the red van"),
        ("what are we doing right now?", "follow the red van"),
        ("which direction are we heading in?", "the same way as we do now"),
        ("what will you do if it turns off?", "the plan is made anew"),
        ("what happens when it brakes?", "the plan is made anew"),
        ("is it driving too slowly?", "moving at 5 m/s"),
        ("are we going too fast?", "not known here: our own speed"),
        ("how long are we going to stay there?", "not known here: how long a stop takes"),
        ("how long do we have to stand there?", "not known here: how long a stop takes"),
        ("how fast is it going, just out of curiosity?", "moving at 5 m/s"),
        ("how far away is it, if you don't mind me asking?", "21 m away"),
    ],
)
def test_what_is_done_and_what_will_be(question: str, expected: str) -> None:
    assert expected in told(drive(), question)


@pytest.mark.parametrize("question", ["will it fit?", "do we have enough space there?", "is there any room?"])
def test_room_is_told_for_each_vehicle_that_may_be_meant(question: str) -> None:
    street = Street().car("near", 14, -6, WHITE).car("wall", 8, -6, BLACK).car("far", 30, 6, WHITE)
    session = street.grounder().session()
    asked = session.say("park behind the white car")
    assert len(asked.candidates) == 2
    answer = session.say(question)
    assert [one.split(",")[0] for one in answer.reasons] == ["no", "yes"]
    assert answer.question == asked.question
    assert session.question == asked.question
