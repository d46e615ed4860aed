"""Plans of several steps in a conversation: what is said of one step leaves the others as they are."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, BLUE, RED, WHITE, WORLD_FROM_EGO, Street, area

from appocc.nuscenes.maps import VectorMap
from grounding import Answer, Grounder
from grounding.dialogue.session import Session

STREET = (
    Street()
    .car("w", 12, -5, WHITE)
    .car("b", 24, -5, BLUE)
    .car("t", 36, -5, RED, category="vehicle.truck", size_wlh_m=(2.4, 7.0, 3.0))
    .car("o", 20, 4, BLACK, yaw_rad=np.pi, speed_mps=5)
)
DRIVING = Street().car("b", 20, 0, BLUE, speed_mps=5).car("t", 36, -5, RED, category="vehicle.truck")


def talk(*turns: str, street: Street = STREET) -> tuple[Session, Answer]:
    """A conversation, and the answer to its last turn."""
    session = street.grounder().session()
    answers = [session.say(turn) for turn in turns]
    return session, answers[-1]


def steps_of(answer: Answer | None) -> list[str]:
    """Actions of the steps, each with the id of its vehicle or its direction."""
    assert answer is not None
    steps = answer.steps or (answer,)
    about = ((one, one.referent.item.id if one.referent else one.query.direction) for one in steps)
    return [f"{one.query.action} {what}" if what else str(one.query.action) for one, what in about]


THREE = (
    "three stops. first one is by the white car",
    "second stop behind the blue car",
    "and the third one is the truck",
)


def test_stops_are_named_in_their_order() -> None:
    session, answer = talk(*THREE)
    assert answer.status == "ok", answer.text()
    assert steps_of(session.goal) == ["stop w", "stop b", "stop t"]


@pytest.mark.parametrize(
    "turn", ["last stop is the red truck", "the second stop is by the truck", "next stop: the truck"]
)
def test_a_further_stop_needs_no_number_of_stops(turn: str) -> None:
    assert steps_of(talk("stop behind the blue car", turn)[1]) == ["stop b", "stop t"]


@pytest.mark.parametrize(
    ("turn", "left"),
    [
        ("just the truck", ["stop t"]),
        ("only the blue car, please", ["stop b"]),
        ("no truck today, it's only the blue one", ["stop b"]),
        ("she can't make it, so just the red truck", ["stop t"]),
        ("keep only the white car", ["stop w"]),
        ("leave the others. Just do the truck.", ["stop t"]),
        ("just the black car", ["stop w", "stop b", "stop o"]),
    ],
)
def test_only_one_of_the_stops(turn: str, left: list[str]) -> None:
    assert steps_of(talk(*THREE, turn)[1])[-len(left) :] == left


def test_a_stop_that_is_not_there_leaves_those_before_it() -> None:
    session, answer = talk("two stops. the first one is by the white car", "second stop behind the green bus")
    assert answer.status == "not_found"
    assert steps_of(session.goal) == ["stop w"]
    assert steps_of(session.say("behind the blue car")) == ["stop w", "stop b"]


def test_a_distance_is_no_number_of_a_stop() -> None:
    assert steps_of(talk("stop 10 metres behind the blue car")[1]) == ["stop b"]


@pytest.mark.parametrize(
    ("turn", "left"),
    [
        ("actually skip the truck", ["stop w", "stop b"]),
        ("scrap the second stop", ["stop w", "stop t"]),
        ("Very well. Cancel the last instruction, the rest stands.", ["stop w", "stop b"]),
        ("take the blue car off the list", ["stop w", "stop t"]),
        ("not the truck stop", ["stop w", "stop b"]),
        ("we don't need the first one any more", ["stop b", "stop t"]),
        ("swap the first and the second", ["stop b", "stop w", "stop t"]),
        ("do the white car last", ["stop b", "stop t", "stop w"]),
    ],
)
def test_steps_are_dropped_and_moved_by_words(turn: str, left: list[str]) -> None:
    session, _ = talk(*THREE)
    session.say(turn)
    about = session._talk.state.question or session.goal  # in another order the first one may be behind us
    assert steps_of(about) == left


def test_a_command_after_never_mind_is_none_to_drop() -> None:
    assert steps_of(talk("pull over", "oh never mind just let me out here")[1]) != ["None"]


@pytest.mark.parametrize("turn", ["skip the bus", "cancel the fourth stop", "swap the third and the fourth"])
def test_a_step_that_is_not_there_is_told(turn: str) -> None:
    session, answer = talk(*THREE, turn)
    assert "the plan has no such step" in answer.text()
    assert steps_of(session.goal) == ["stop w", "stop b", "stop t"]


def test_what_is_kept_is_no_further_command() -> None:
    _, answer = talk(
        "follow the blue car",
        "then pull over behind the truck",
        "forget the pulling over, just keep following",
        street=DRIVING,
    )
    assert steps_of(answer) == ["follow b"]


@pytest.mark.parametrize(
    "turn",
    [
        "wait until the black car has passed",
        "wait for the black car to go by first",
        "let the black car go first",
        "once the black car has gone by",
        "not until the black car is through",
        "go on when the black car is past",
        "stop when the black car has passed",
        "There's the black car. Wait for it to pass.",
    ],
)
def test_a_wait_comes_before_the_goal(turn: str) -> None:
    session, answer = talk("stop behind the blue car", turn)
    assert answer.status == "ok", answer.text()
    wait, goal = answer.steps
    assert wait.query.action in ("wait", "give_way")
    assert (wait.referent and wait.referent.item.id, wait.query.trigger) == ("o", "pass")
    assert goal.referent is not None
    assert goal.referent.item.id == "b"
    assert steps_of(session.say("ok go on")) == ["stop b"]


def test_a_wait_is_about_the_vehicle_in_talk() -> None:
    assert steps_of(talk("stop behind the blue car", "watch the black car", "when its out of the way go")[1]) == [
        "wait o",
        "stop b",
    ]


def test_a_wait_keeps_a_turn_and_what_follows_it() -> None:
    session, _ = talk("turn around", "wait until the black car has passed")
    assert steps_of(session.say("and after that park on the right")) == ["wait o", "turn around", "park"]


@pytest.mark.parametrize("turn", ["wait here", "wait behind the truck"])
def test_a_wait_for_nobody_or_at_a_place_takes_the_place_of_the_goal(turn: str) -> None:
    assert [one.split()[0] for one in steps_of(talk("stop behind the blue car", turn)[1])] == ["wait"]


def test_to_follow_until_an_event_is_no_wait() -> None:
    _, answer = talk("follow the blue car", "follow it until it turns right", street=DRIVING)
    assert steps_of(answer) == ["follow b"]
    assert answer.query.trigger == "turn"


def test_a_condition_is_a_further_step() -> None:
    _, answer = talk("follow the blue car", "if it turns off just go straight on", street=DRIVING)
    assert steps_of(answer) == ["follow b", "wait b", "other straight"]
    assert answer.steps[1].query.trigger == "turn"


def test_to_follow_ends_with_the_event_of_the_next_step() -> None:
    session = Street().car("b", 20, 0, BLUE, speed_mps=5).grounder().session()
    session.say("follow the blue car")
    session.say("if it turns off go straight on")
    turned = Street().car("b", 24, -4, BLUE, yaw_rad=-np.pi / 2, speed_mps=5)
    assert steps_of(session.update(turned.bev(), turned.boxes(), WORLD_FROM_EGO)) == ["other straight"]


@pytest.mark.parametrize("turn", ["tell me when we can park", "let me know once we're there"])
def test_nothing_is_told_later(turn: str) -> None:
    session, answer = talk("follow the blue car", turn, street=DRIVING)
    assert answer.status == "not_a_command"
    assert "that cannot be done" in answer.text()
    assert steps_of(session.goal) == ["follow b"]


@pytest.mark.parametrize(
    "turn", ["don't go past the crossing until I say so", "don't cross the crossing till I tell you"]
)
def test_what_is_not_to_be_passed_until_we_say_so(turn: str) -> None:
    grounder = Grounder()
    low, high = 18, 21
    grounder.set_street_map(VectorMap((), (), {"crossing": (area(low, high),)}))
    grounder.set_scene(STREET.bev(), STREET.boxes(), WORLD_FROM_EGO)
    session = grounder.session()
    session.say("stop behind the truck")
    answer = session.say(turn)
    assert steps_of(answer) == ["stop", "wait", "stop t"], answer.text()
    assert answer.steps[0].target is not None
    assert answer.steps[0].target.ego_m[0] < low
    assert steps_of(session.say("you can go now")) == ["stop t"]


@pytest.mark.parametrize("turn", ["and now go back", "back to our lane please"])
def test_a_change_of_lane_is_undone_by_one_to_the_other_side(turn: str) -> None:
    empty = Street()
    answers = talk("change lane to the left", turn, street=empty)[1]
    assert steps_of(answers) == ["change_lane left", "change_lane right"]


def test_a_change_of_lane_and_back_in_one_sentence() -> None:
    answer = Street().grounder().ground("move one lane to the left and then come back")
    assert steps_of(answer) == ["change_lane left", "change_lane right"]


def test_the_place_of_the_goal_and_what_follows_it() -> None:
    session, answer = talk("stop behind the blue car", "drop me there and then go home")
    assert answer.status == "not_found"
    assert steps_of(session.goal) == ["stop b"]


# The plan begins


@pytest.mark.parametrize("go", ["okay go", "ok, off you go", "right, let's go", "go ahead", "great, away you go"])
def test_a_plan_begins_with_what_it_waits_for(go: str) -> None:
    assert steps_of(talk("let the black car pass, then stop behind the blue car", go)[1]) == ["give_way o", "stop b"]


@pytest.mark.parametrize("go", ["okay go", "off you go", "lovely, let's go", "as you were"])
def test_to_begin_a_plan_changes_no_place(go: str) -> None:
    session, before = talk("stop behind the blue car")
    answer = session.say(go)
    assert steps_of(answer) == ["stop b"]
    assert answer.target == before.target


@pytest.mark.parametrize("go", ["yes, carry on", "ok go on"])
def test_a_wait_of_the_same_command_stays(go: str) -> None:
    assert steps_of(talk("wait for the black car, then stop behind the blue car", go)[1]) == ["wait o", "stop b"]


def test_a_wait_until_we_are_told_ends() -> None:
    assert steps_of(talk("wait until I say so, then stop behind the blue car", "okay, off you go")[1]) == ["stop b"]


@pytest.mark.parametrize(("speed_mps", "action"), [(5.0, "follow"), (0.0, "overtake")])
def test_the_case_that_is_seen_decides(speed_mps: float, action: str) -> None:
    street = Street().car("t", 16, -2, BLUE, speed_mps=speed_mps)
    first = street.grounder().ground("if the blue car moves, follow it, otherwise pass it")
    assert first.query.action == action
    session = street.grounder().session()
    session.say("stop behind the blue car")
    answer = session.say("if it is moving, follow it, otherwise overtake it")
    assert answer.query.action == action, answer.text()
    assert "the case now" in answer.text()


def test_a_case_that_is_not_seen_is_asked_about() -> None:
    session = Street().car("t", 20, -2, BLUE).grounder().session()
    asked = session.say("if the blue car leaves, stop in 20 metres, otherwise overtake it")
    assert (asked.status, len(asked.alternatives)) == ("ambiguous", 2)
    assert session.say("the second").query.action == "overtake"


@pytest.mark.parametrize("turn", ["stay as you are", "okay, then stay so", "no no, keep like that", "as you were"])
def test_to_stay_as_we_are_goes_on_with_what_is_done(turn: str) -> None:
    answer = talk("follow the blue car", turn, street=DRIVING)[1]
    assert (steps_of(answer), answer.pace) == (["follow b"], None)
