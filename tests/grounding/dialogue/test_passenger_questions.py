"""Questions of passengers about the goal, free places and who is in the way; the goal in force stays."""

from __future__ import annotations

import pytest
from street import BLACK, BLUE, RED, WHITE, Street, told

from grounding.dialogue.session import Session


def drive() -> Session:
    """A gap between a blue and a white car at the kerb, a red van ahead of us in our lane, a black car behind us."""
    street = Street().car("blue", 10, -6, BLUE).car("white", 24, -6, WHITE).car("back", -12, 0, BLACK, speed_mps=3.0)
    street.car("van", 36, 0, RED, size_wlh_m=(2.0, 5.0, 2.2))
    return street.grounder().session()


def park() -> Session:
    """The goal in that gap is in force."""
    session = drive()
    assert session.say("park behind the white car").status == "ok"
    return session


def told_beside_goal(question: str) -> str:
    """The answer to a question while a goal is in force, which stays as it is."""
    session = park()
    goal = session.goal
    assert goal is not None
    answer = told(session, question)
    assert session.goal is not None
    assert session.goal.target is goal.target
    return answer


@pytest.mark.parametrize(
    "question",
    [
        "remind us once more where we stop",
        "tell us once again what you are planning",
        "could you quickly tell me what we are up to",
        "can you remind me once more where you are heading",
    ],
)
def test_the_plan_is_told_again(question: str) -> None:
    session = park()
    assert told(session, question).startswith("park behind the white car")
    assert session.say("warn me once we are past it").status == "not_a_command"


def test_a_time_in_the_order_of_a_statement_is_told() -> None:
    assert "the way to the goal is" in told(park(), "do you know how long that will take")


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("are there any free bays by the white car?", "'white car'"),
        ("can you see an empty spot behind the white car", "is behind it"),
        ("is there anywhere to park in front of the blue car", "is in front of it"),
        ("any gaps on the right?", "right edge of the road"),
        ("is the gap between the blue car and the white car big enough", "between"),
    ],
)
def test_a_free_place_is_told_and_can_be_taken(question: str, expected: str) -> None:
    session = drive()
    answer = told(session, question)
    assert answer.startswith("yes")
    assert expected in answer
    assert session.say("okay, do that").target is not None


@pytest.mark.parametrize(
    ("question", "left_out"),
    [
        ("will the cab really fit in there", ""),
        ("do you think this thing fits", ""),
        ("is there enough space there for a trolley", "left out: 'trolley'"),
    ],
)
def test_room_at_the_goal_is_told_with_its_length(question: str, left_out: str) -> None:
    answer = told(park(), question)
    assert answer.startswith("yes: there is room for us at the goal")
    assert "the gap is 9.6 m long" in answer
    assert ("left out" in answer) == bool(left_out)
    assert left_out in answer


def test_room_is_told_for_each_vehicle_that_a_question_may_mean() -> None:
    session = (
        Street().car("near", 14, -6, WHITE).car("wall", 8, -6, BLACK).car("far", 30, -6, WHITE).grounder().session()
    )
    answer = session.say("is there a free space behind the white car?")
    assert [one.split(",")[0] for one in answer.reasons] == ["no", "yes"]


def test_a_place_that_was_not_spoken_of_is_not_known() -> None:
    assert "not known here: which place is meant" in told(drive(), "is that spot taken?")


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("how far will she have to walk", "the place is 0.9 m from the white car"),
        ("is it a long walk to the blue car?", "m from the blue car"),
        ("how close will we stop to the blue car", "the place is 4.1 m from the blue car"),
        ("how far from the pavement are you going to park", "m from the kerb on our right"),
        ("are we near enough to the curb?", "m from the kerb on our right"),
    ],
)
def test_distances_are_those_from_the_goal(question: str, expected: str) -> None:
    assert expected in told(park(), question)


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("what happens after this", "after that nothing is planned"),
        ("did you understand what I said", "park behind the white car"),
        ("where do you think we'll end up", "park behind the white car"),
        ("what if somebody takes it", "the plan is made anew"),
        ("is it really the best spot you can find", "'white car' is the white car"),
        ("why not the other one", "'white car' is the white car"),
    ],
)
def test_questions_about_the_plan_leave_it_as_it_is(question: str, expected: str) -> None:
    assert expected in told_beside_goal(question)


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("is that red van blocking us", "yes: the red van"),
        ("is the white car in our way", "no: the white car"),
        ("are we held up by anything, the van is in the way isn't it", ""),
        ("anything in front of us", "red van"),
        ("any cars behind us", "yes: the black car"),
        ("are there any vans about", "yes: the red van"),
        ("what is moving", "1 fit 'moving vehicles'"),
        ("which cars are standing on the right", "2 fit 'parked cars on the right'"),
        ("is the blue car occupied", "not known here: who or what is in a vehicle"),
    ],
)
def test_who_is_there_and_what_they_do(question: str, expected: str) -> None:
    assert expected in told(drive(), question)


@pytest.mark.parametrize(
    ("question", "expected"),
    [
        ("will we arrive shortly", "the way to the goal is"),
        ("are we about to park", "the way to the goal is"),
        ("what did I tell you to do", "park behind the white car"),
        ("will we have to turn to get there", "park behind the white car"),
        ("what is wrong with the other place", "'white car' is the white car"),
        ("anything following that?", "after that nothing is planned"),
        ("have we missed it", "white car"),
        ("is it a tight spot", "no: there is room"),
        ("is waiting allowed there", "not known here: signs"),
        ("why is she doing that", "not known here: why others do so"),
        ("is the red van going to pull out", "not known here: what others will do"),
        ("what are we held up by", "ahead of us: the red van"),
    ],
)
def test_a_question_is_not_taken_for_another_one(question: str, expected: str) -> None:
    assert expected in told_beside_goal(question)


@pytest.mark.parametrize("question", ["which way will we go", "what did we ask you to do"])
def test_a_question_about_the_plan_does_nothing_without_one(question: str) -> None:
    session = drive()
    assert "no command is set" in told(session, question)
    assert session.goal is None


def test_room_for_a_manoeuvre_is_told() -> None:
    session = drive()
    assert told(session, "is there space to drive past the blue car").startswith("yes")
    assert session.goal is None


def test_a_place_is_offered_where_none_is_planned() -> None:
    assert told(drive(), "where would you stop").startswith("yes; the place is at the right edge")
