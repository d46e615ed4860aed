"""What a passenger adds to a plan, or takes from it, is kept or told as not possible; the rest of the plan stays."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, RED, WHITE, Street, told

from grounding.answer import Answer
from grounding.dialogue.session import Session

IN_LANE_M, AT_EDGE_M = 1.75, -4.0


def drive() -> Session:
    """A blue and a white car at the kerb with a gap between them, a black one ahead that drives our way."""
    street = Street().car("blue", 10, -6.5, BLUE).car("white", 26, -6.5, WHITE)
    return street.car("black", 34, 0, BLACK, speed_mps=6.0).grounder().session()


def say(*turns: str, session: Session | None = None) -> Answer:
    """The answer to the last of some turns."""
    talk = session or drive()
    *before, last = turns
    for turn in before:
        talk.say(turn)
    return talk.say(last)


def actions(answer: Answer) -> list[str | None]:
    """The actions of the steps of an answer."""
    return [step.query.action for step in answer.steps]


def lateral_m(answer: Answer) -> float:
    """How far left of us a goal is."""
    assert answer.target is not None, answer.text()
    return float(answer.target.ego_m[1])


@pytest.mark.parametrize(
    "turn",
    ["not in the middle of the road please", "don't block the traffic", "at the side", "you're blocking the road"],
)
def test_a_place_in_the_road_moves_to_its_edge(turn: str) -> None:
    assert lateral_m(say("stop next to the white car", turn)) < AT_EDGE_M


def test_no_room_at_the_edge_is_told_and_the_goal_stays() -> None:
    row = Street().car("a", 8, -6.5, BLUE).car("b", 14, -6.5, RED).car("c", 20, -6.5, BLUE).grounder().session()
    goal = say("stop next to the red car", session=row).target
    answer = say("not in the road, find somewhere right after it", session=row)
    assert answer.target is goal
    assert answer.reasons[0] == "there is no free place at the edge of the road there: say where else"


@pytest.mark.parametrize(
    "turn", ["no, on our side", "keep on this side then", "don't cross the road", "the other side"]
)
def test_our_side_again_is_beside_the_same_vehicle(turn: str) -> None:
    session = drive()
    assert lateral_m(say("stop opposite the white car", session=session)) > IN_LANE_M
    answer = say(turn, session=session)
    assert (answer.query.relation, answer.referent.item.id if answer.referent else "") == ("next_to", "white")
    assert lateral_m(answer) < 0


def test_the_other_side_of_a_place_without_a_vehicle() -> None:
    answer = say("overtake the blue car", "then park on the right", "the other side")
    assert lateral_m(answer) > IN_LANE_M
    assert actions(answer) == ["overtake", "park"]


@pytest.mark.parametrize("turn", ["but stay in our lane", "without leaving our lane", "don't pull in after it"])
def test_a_parked_car_is_passed_in_our_lane(turn: str) -> None:
    assert abs(lateral_m(say("overtake the blue car", turn))) < IN_LANE_M


def test_what_is_said_about_the_lane_holds_for_the_rest_of_the_turn() -> None:
    answer = say("overtake the blue car", "i don't want to pull in after it, just pass it and keep going")
    assert actions(answer) == ["drive_past", "other"]
    assert abs(lateral_m(answer)) < IN_LANE_M


@pytest.mark.parametrize(
    "turn", ["no stop, that's too much reversing. what about somewhere ahead?", "find me any spot in front of us"]
)
def test_any_place_ahead_takes_that_of_one_behind_us(turn: str) -> None:
    session = Street().car("red", -10, -6.5, RED).car("blue", 30, -6.5, BLUE).grounder().session()
    assert (behind := say("park behind the red car", "yes", session=session).target) is not None
    assert behind.ego_m[0] < 0
    answer = say(turn, session=session)
    assert answer.target is not None
    assert answer.target.ego_m[0] > 4
    assert told(session, "I said ahead, not back").endswith("it is ahead of us")


@pytest.mark.parametrize(
    ("turn", "gap_m"),
    [
        ("half a metre would be enough", 0.5),
        ("leave at least a metre and a half to it", 1.5),
        ("don't get too close to the white car, say three metres", 3.0),
        ("four metres is plenty", 4.0),
    ],
)
def test_a_distance_alone_is_the_gap_in_force(turn: str, gap_m: float) -> None:
    answer = say("stop behind the white car", turn)
    assert (answer.query.relation, answer.query.distance_m) == ("behind", gap_m)
    assert answer.target is not None
    assert abs(26 - 2.2 - float(answer.target.ego_m[0]) - answer.target.ego.length_m / 2 - gap_m) < 0.5


def test_another_gap_than_asked_for_is_told() -> None:
    tight = Street().car("blue", 10, -6.5, BLUE).car("white", 21.4, -6.5, WHITE).grounder().session()
    assert "less than asked for" in "; ".join(
        say("park behind the white car", "leave two and a half metres", session=tight).reasons
    )


@pytest.mark.parametrize("turn", ["ok behind it is fine then", "alright, behind is ok"])
def test_after_a_wish_that_failed_another_place_is_no_mere_yes(turn: str) -> None:
    row = Street().car("a", 20, -6.5, RED).car("b", 26, -6.5, BLUE).grounder().session()
    assert say("park in front of the red car", session=row).status != "ok"
    assert say(turn, session=row).query.relation == "behind"


@pytest.mark.parametrize(
    "turn",
    [
        "but don't block the black car",
        "make sure you don't hold up the black car",
        "mind you don't box the blue car in",
        "don't block the driveway",
        "but not in front of the entrance",
        "no, not in front of it",
    ],
)
def test_what_is_ruled_out_keeps_the_goal(turn: str) -> None:
    session = drive()
    goal = say("park behind the white car", session=session).target
    answer = say(turn, session=session)
    assert answer.target is goal
    assert "the goal stays as it is" in answer.reasons[0]


@pytest.mark.parametrize(
    "turn", ["ok just the stop then", "only the stop please", "just the white car is fine, forget the second bit"]
)
def test_one_step_is_kept_and_the_others_are_dropped(turn: str) -> None:
    answer = say("stop behind the white car", "and then turn left", turn)
    assert (answer.status, actions(answer)) == ("ok", ["stop"])
    assert told_again(turn) == "the goal stays as it is: it is the only step"


def told_again(turn: str) -> str:
    """The answer to a turn that keeps the only step."""
    return told(session_at_white_car(), turn)


def session_at_white_car() -> Session:
    """A stop is the only step in force."""
    session = drive()
    session.say("stop behind the white car")
    return session


@pytest.mark.parametrize(
    "turn",
    ["stop following it, just drive normally", "let him go and carry on", "quit following that car, keep going"],
)
def test_who_follows_no_more_drives_on(turn: str) -> None:
    answer = say("follow the black car", turn)
    assert (answer.status, answer.query.manoeuvre, answer.query.referent) == ("ok", "onward", None)


def test_who_is_let_go_is_followed_no_more() -> None:
    answer = say("follow the black car", "ok let him go, stop at the white car instead")
    assert actions(answer) == ["stop"]
    assert "give_way" in actions(say("follow the black car", "let him go first"))


@pytest.mark.parametrize("turn", ["back to normal", "ok thats slow enough, normal speed again please"])
def test_the_usual_speed(turn: str) -> None:
    assert say("slow down", turn).pace is None
    assert "usual speed" in "; ".join(say("park behind the white car", "slow down", turn).reasons)


def test_a_wait_at_the_goal_and_what_comes_after_it() -> None:
    answer = say("stop behind the white car", "stay there for five minutes and then carry on")
    assert actions(answer) == ["stop", "wait", "other"]


@pytest.mark.parametrize(
    "turn", ["put me down at the white car first and then park", "first drop me at the white car, then park"]
)
def test_first_is_no_ordinal_of_a_vehicle(turn: str) -> None:
    answer = say("pull over", turn)
    assert actions(answer) == ["stop", "park"]
    assert answer.steps[0].query.referent is not None
    assert answer.steps[0].query.referent.qualifiers == ()


@pytest.mark.parametrize("turn", ["not too close tho", "not so near please"])
def test_not_too_close_is_a_larger_gap(turn: str) -> None:
    assert "as asked" in told(session_at_white_car(), turn)


def test_the_one_that_was_followed() -> None:
    session = drive()
    say("follow the black car", "stop behind the white car", session=session)
    assert "that was the black car" in told(session, "the one we were following")


def test_the_way_back_to_our_lane_after_a_place_beside_it() -> None:
    street = Street().car("white", 16, -2.4, WHITE)
    answer = say("park behind the white car", "and then drive on", session=street.grounder().session())
    assert abs(lateral_m(answer)) < IN_LANE_M


def test_past_a_vehicle_that_drives_is_where_we_are_then() -> None:
    street = Street().car("bus", 12, 0, RED, speed_mps=2.0, size_wlh_m=(2.5, 8.0, 3.0), category="vehicle.bus.rigid")
    answer = say(
        "overtake the bus", "and then stop at the side once we're past it", session=street.grounder().session()
    )
    assert (answer.status, actions(answer)) == ("ok", ["overtake", "stop"])
