"""Everyday turns: what people wear, places that are forbidden, what keeps the goal, and what was named in passing."""

import pytest
from street import BLACK, BLUE, GREEN, RED, WHITE, Street

from grounding.answer import Answer
from grounding.dialogue.session import Session

PERSON = {"size_wlh_m": (0.6, 0.6, 1.7), "category": "human.pedestrian.adult"}


def referent(answer: Answer) -> str | None:
    return answer.referent.item.id if answer.referent is not None else None


def row() -> Session:
    street = Street().car("a", 12, -5, RED).car("b", 24, -5, BLUE).car("c", 36, -5, GREEN)
    session: Session = street.grounder().session()
    return session


def people() -> Session:
    street = Street().car("van", 30, -5, WHITE)
    street.car("red", 14, -7, RED, **PERSON).car("green", 22, -7, GREEN, **PERSON)  # type: ignore[arg-type]
    session: Session = street.grounder().session()
    return session


@pytest.mark.parametrize(
    "text",
    [
        "stop beside the woman with the green coat",
        "stop next to the man in a green jacket please",
        "She's in the green coat. Stop right by her, please.",
        "my mate's out there in a green hoodie can u stop by him",
    ],
)
def test_people_are_told_apart_by_their_clothes(text: str) -> None:
    answer = people().say(text)
    assert (answer.status, referent(answer)) == ("ok", "green"), answer.text()


def test_who_is_asked_about_is_him() -> None:
    session = people()
    assert referent(session.say("stop behind the white car")) == "van"
    assert session.say("who's that in the red?").status == "ok"
    answer = session.say("stop by him then")
    assert (answer.status, referent(answer)) == ("ok", "red"), answer.text()


@pytest.mark.parametrize("text", ["carry on", "Do carry on.", "keep it like that", "leave it as it is"])
def test_who_carries_on_keeps_the_goal(text: str) -> None:
    session = row()
    before = session.say("park behind the blue car")
    session.say(text)
    goal = session.goal
    assert goal is not None
    assert referent(goal) == "b"
    assert goal.target is not None
    assert before.target is not None
    assert goal.target.cell == before.target.cell


@pytest.mark.parametrize("text", ["just keep driving", "No no, I've changed my mind, just carry on driving"])
def test_who_drives_on_gives_the_goal_up(text: str) -> None:
    session = row()
    session.say("park behind the blue car")
    session.say(text)
    assert session.goal is None or referent(session.goal) is None


@pytest.mark.parametrize(
    "text", ["can we stay there about ten minutes?", "wait there for me", "don't splash the red car"]
)
def test_what_names_no_other_place_keeps_the_goal(text: str) -> None:
    session = row()
    session.say("stop behind the blue car")
    assert session.say(text).status == "ok"
    assert session.goal is not None
    assert referent(session.goal) == "b"


@pytest.mark.parametrize(
    "text", ["so you're not going to the red car, right?", "So we'd be standing behind the green one, correct?"]
)
def test_who_asks_about_the_plan_changes_nothing(text: str) -> None:
    session = row()
    session.say("park behind the blue car")
    answer = session.say(text)
    assert (answer.status, referent(answer)) == ("ok", "b"), answer.text()
    assert session.goal is not None
    assert referent(session.goal) == "b"


def test_the_first_choice_is_the_oldest_plan() -> None:
    session = row()
    for text in ("park behind the red car", "behind the blue one", "behind the green one"):
        assert session.say(text).status == "ok"
    answer = session.say("no, go to my very first choice")
    assert (answer.status, referent(answer)) == ("ok", "a"), answer.text()


def test_a_place_after_never_mind_is_another_place_of_the_goal() -> None:
    session = row()
    session.say("park behind the green car")
    answer = session.say("okay never mind. a little before the car, so I don't block it")
    assert (answer.status, referent(answer), answer.query.relation) == ("ok", "c", "before"), answer.text()


def test_a_distance_describes_a_vehicle() -> None:
    session = row()
    session.say("park behind the green car")
    answer = session.say("Correction, the one about twenty-three metres ahead.")
    assert (answer.status, referent(answer)) == ("ok", "b"), answer.text()


def test_a_further_step_instead_replaces_the_plan() -> None:
    session = row()
    session.say("stop in front of the blue car")
    answer = session.say("Then put me behind the blue car instead, please.")
    assert (answer.status, referent(answer), answer.query.relation) == ("ok", "b", "behind"), answer.text()
    assert len(answer.steps) < 2


@pytest.mark.parametrize("text", ["half up on the pavement if you can", "put two wheels on the pavement"])
def test_the_pavement_is_refused_and_the_goal_stays(text: str) -> None:
    session = row()
    session.say("park behind the blue car")
    assert session.say(text).plan.refused
    assert session.goal is not None
    assert referent(session.goal) == "b"
    assert not session.question
    answer = session.say("in front of it then")
    assert (answer.status, referent(answer), answer.query.relation) == ("ok", "b", "in_front_of"), answer.text()


@pytest.mark.parametrize(
    "text",
    [
        "park on the pavement next to the red car",
        "could you swing into the oncoming lane for a sec",
        "just drive on the wrong side for a sec nobodys coming",
    ],
)
def test_what_is_forbidden_is_refused_however_it_may_be_read(text: str) -> None:
    answer = row().say(text)
    assert answer.plan.refused, answer.text()
    assert answer.target is None


@pytest.mark.parametrize(
    "text", ["stop by the man on the pavement", "park behind the red car, door on the pavement side"]
)
def test_who_stands_on_the_pavement_is_reached(text: str) -> None:
    street = Street().car("car", 24, -5, RED)
    street.car("man", 14, -7, GREEN, **PERSON)  # type: ignore[arg-type]
    session: Session = street.grounder().session()
    assert session.say(text).status == "ok"


def test_the_nearer_to_a_neighbour_is_meant() -> None:
    street = Street().car("a", 8, -5, WHITE).car("b", 21, -5, WHITE).car("black", 34, -5, BLACK)
    session: Session = street.grounder().session()
    assert session.say("park behind the white car").status == "ambiguous"
    answer = session.say("the one nearer the black car")
    assert (answer.status, referent(answer)) == ("ok", "b"), answer.text()


def test_an_answer_in_shorthand_is_a_number() -> None:
    session: Session = Street().car("a", 12, -5, WHITE).car("b", 24, -5, WHITE).grounder().session()
    assert session.say("park behind the white car").status == "ambiguous"
    assert referent(session.say("2nd")) == "b"


def test_a_remark_at_the_beginning_says_who_she_is() -> None:
    session = people()
    assert (
        session.say("If this was my shift I'd have that lady in red in the back already.").status == "not_a_command"
    )
    answer = session.say("Go on, pull up beside her.")
    assert (answer.status, referent(answer)) == ("ok", "red"), answer.text()


def test_any_cab_of_the_past_is_not_spoken_of() -> None:
    session = row()
    session.say("stop behind the blue car")
    session.say("Twenty-two years I've driven a cab.")
    assert referent(session.say("in front of it, please")) == "b"


def test_a_step_names_any_vehicle_of_its_colour() -> None:
    street = Street().car("slow", 18, -1.75, WHITE, speed_mps=3.0, category="vehicle.truck")
    street.car("red", 34, 1.75, RED, yaw_rad=3.14159, speed_mps=10.0)
    session: Session = street.grounder().session()
    session.say("overtake the truck")
    answer = session.say("wait for the red one, then overtake the truck")
    assert [step.query.action for step in answer.steps] == ["wait", "overtake"], answer.text()
    assert referent(answer.steps[0]) == "red"


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("park behind the second car, not the first", "b"),
        ("park behind the third car, not the second", "c"),
        ("park behind a car but not the first one", "b"),
    ],
)
def test_places_in_a_row_count_all(text: str, meant: str) -> None:
    answer = row().say(text)
    assert (answer.status, referent(answer)) == ("ok", meant), answer.text()


def test_traffic_ahead_does_not_block_the_way_to_the_kerb() -> None:
    street = Street().car("a", 14, -6.5, RED).car("b", 31, -6.5, BLUE)
    street.car("bus", 20, -3.2, WHITE, speed_mps=6.0, size_wlh_m=(2.5, 11.0, 3.2), category="vehicle.bus.rigid")
    for y_m in (0.6, 3.6, 6.6):  # nothing passes on the left
        street.car(f"queue {y_m}", 18, y_m, GREEN, speed_mps=0.0, size_wlh_m=(2.8, 14.0, 3.0))
    answer = street.grounder().ground("stop in front of the red car")
    assert answer.status == "ok", answer.text()
    assert any("have driven on" in reason for reason in answer.reasons)
