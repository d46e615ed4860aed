"""Side clauses, amounts and nouns of single commands: what is said beside the place is neither lost nor a place."""

from __future__ import annotations

import pytest
from street import BLUE, RED, WHITE, WORLD_FROM_EGO, Street

from grounding import Answer, Grounder
from grounding.language import parse
from grounding.query import Query

PERSON = "human.pedestrian.adult"
SMALL = (0.7, 0.7, 1.7)
STREET = (
    Street()
    .car("w", 24, -5, WHITE)
    .car("b", 34, -5, BLUE)
    .car("r", -9, -5, RED)
    .car("m", 14, 4, None, speed_mps=1.2, yaw_rad=-1.57, size_wlh_m=SMALL, category=PERSON)
)


def ask(text: str, street: Street = STREET) -> Answer:
    grounder = Grounder()
    grounder.set_scene(street.bev(), street.boxes(), WORLD_FROM_EGO)
    return grounder.ground(text)


def ahead_m(answer: Answer) -> float:
    assert answer.target is not None, answer.text()
    return float(answer.target.ego_m[0])


def query(text: str) -> Query:
    return parse(text).query


@pytest.mark.parametrize(
    "text",
    [
        "mind the man and go forward three metres",
        "careful with the kid on the right, roll forward three metres",
        "go forward three metres, watch out for the cyclist",
    ],
)
def test_a_warning_leaves_the_distance_of_the_command(text: str) -> None:
    answer = ask(text)
    assert ahead_m(answer) == pytest.approx(ahead_m(ask("go forward three metres")), abs=0.5)
    assert "is heeded on the way" in answer.text()


@pytest.mark.parametrize(
    "text", ["mind the biker behind when you pull in to the right", "pull over but mind the van"]
)
def test_nothing_is_measured_from_what_is_minded(text: str) -> None:
    found = query(text)
    assert (found.action, found.referent) == ("pull_over", None)


@pytest.mark.parametrize(
    ("text", "action"),
    [
        ("mind the van", "avoid"),
        ("slow down and mind the van", "avoid"),
        ("mind the red car and stop behind it", "stop"),
    ],
)
def test_a_warning_that_is_all_or_is_referred_to_stays(text: str, action: str) -> None:
    found = query(text)
    assert found.action == action
    assert found.referent is not None


@pytest.mark.parametrize(
    "text",
    [
        "no stopping next to the blue car please I owe the owner money",
        "no parking behind the white car please, the owner hates me",
    ],
)
def test_a_reason_does_not_turn_a_prohibition_into_a_command(text: str) -> None:
    found = query(text)
    assert found.referent is None
    assert found.relation == "none"
    assert found.excluded[0].relation in ("next_to", "behind")


def test_a_reason_leaves_the_place() -> None:
    reading = parse("keep going till the orange car and then stop, there's a queue so don't rush")
    assert (reading.query.relation, reading.doubt) == ("at", "")
    assert reading.dropped == ("there's a queue",)


def test_an_unknown_command_is_no_reason() -> None:
    assert parse("park behind the red car and flibber").dropped == ("flibber",)


@pytest.mark.parametrize(
    "text",
    [
        "my mate's in the blue one over on the left so stop alongside him a sec, don't park",
        "stop alongside him a sec, don't park, my mate's in the blue one over on the left",
    ],
)
def test_a_word_that_the_network_uses_is_not_doubted(text: str) -> None:
    reading = parse(text)
    assert (reading.query.relation, reading.doubt, reading.dropped) == ("next_to", "", ())


def test_the_one_is_the_vehicle_that_is_corrected() -> None:
    found = query("park behind the white car, i mean the one next to the red car")
    assert found.referent is not None
    assert (found.relation, found.referent.colour) == ("behind", "white")
    assert [(one.relation, one.colour) for one in found.secondary] == [("next_to", "red")]


@pytest.mark.parametrize(
    "text",
    ["stop not by the bus, by the car in front of it", "don't stop by the bus, stop by the car in front of it"],
)
def test_a_neighbour_is_named_by_a_pronoun(text: str) -> None:
    found = query(text)
    assert found.referent is not None
    assert found.referent.noun == "car"
    assert [(one.relation, one.noun) for one in found.secondary] == [("in_front_of", "bus")]
    assert [(one.relation, one.noun) for one in found.excluded] == [("near", "bus")]


@pytest.mark.parametrize(
    "text", ["my friend is waiting by the blue car, grab her", "my friend is next to the blue car, let her in"]
)
def test_a_passenger_who_is_not_seen_is_at_the_vehicle(text: str) -> None:
    answer = ask(text)
    assert answer.query.action == "stop"
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "b"


def test_who_drives_is_a_vehicle() -> None:
    street = Street().car("v", -14, 0, WHITE, speed_mps=5)
    answer = ask("let the guy behind us overtake", street)
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "v"


def test_who_walks_is_none() -> None:
    found = query("let the man cross")
    assert found.referent is not None
    assert found.referent.noun == "person"


def test_we_stop_before_who_walks() -> None:
    answer = ask("stop for the man crossing ahead")
    assert answer.status == "ok"
    assert 0 < ahead_m(answer) < 10


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("pull over in 3 seconds", "'3 seconds'"),
        ("stop next to the white car two minutes", "'two minutes'"),
        ("drive at 30", "'30'"),
        ("park gently", "'gently'"),
        ("go slowly past the white car", "'slowly'"),
        ("park somewhere in the next fifty metres", "'next fifty metres'"),
    ],
)
def test_what_is_not_planned_is_told(text: str, told: str) -> None:
    answer = ask(text)
    assert answer.query.distance_m is None
    assert any("is not planned" in reason and told in reason for reason in answer.reasons)


@pytest.mark.parametrize("text", ["slow down", "go slowly", "stop in 20 metres", "take the second left", "park"])
def test_what_is_used_is_not_told(text: str) -> None:
    assert not any("is not planned" in note for note in parse(text).notes)


@pytest.mark.parametrize("text", ["do 30", "do 30 mph"])
def test_a_speed_alone_is_no_command(text: str) -> None:
    answer = ask(text)
    assert answer.status == "not_a_command"
    assert "cannot be set" in answer.text()


def test_a_named_gap_is_left() -> None:
    street = Street().car("w", 20, 0, WHITE)
    wide, narrow = (ask(f"leave {gap} metres between us and the car in front", street) for gap in ("eight", "two"))
    assert ahead_m(narrow) - ahead_m(wide) == pytest.approx(6, abs=1)


@pytest.mark.parametrize("text", ["reverse the vehicle by five metres", "back the car up five metres"])
def test_the_car_that_is_reversed_is_ours(text: str) -> None:
    found = query(text)
    assert (found.manoeuvre, found.distance_m, found.referent) == ("back", 5.0, None)


def test_a_pair_is_offered_once() -> None:
    street = Street().car("1", 14, -5, WHITE).car("2", 22, -5, WHITE).car("3", 30, -5, WHITE).car("4", 14, 5, WHITE)
    question = ask("park between the two white ones", street).question
    options = question.removesuffix("?").replace("or ", "").split("; ")
    assert len(options) == len(set(options))


def test_a_pickup_is_a_lorry_where_it_is_called_a_truck() -> None:
    street = Street().car("t", -12, 0, (110, 60, 30), size_wlh_m=(1.9, 5.3, 1.8), category="vehicle.truck")
    answer = ask("let the brown lorry by", street)
    assert answer.status == "ok"
    assert answer.referent is not None
    assert answer.referent.item.id == "t"


def test_who_waits_is_in_our_lane() -> None:
    street = Street().car("parked", 9, -6, WHITE).car("waiting", 16, 0, WHITE)
    answer = ask("stop behind the white car that is waiting", street)
    assert answer.referent is not None, answer.text()
    assert answer.referent.item.id == "waiting"
