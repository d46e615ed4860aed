from __future__ import annotations

import json
from dataclasses import replace

import pytest
from street import BLACK, BLUE, EGO, RED, WHITE, Street

from appocc.errors import AppoccError
from grounding.answer import Answer
from grounding.grounder import Grounder
from grounding.language import parse

STREET = Street().car("w1", 12, -3, WHITE).car("w2", 20, 3, WHITE).car("b", 26, -3, BLUE).car("k", 8, 3, None)
GROUNDER = STREET.grounder()
KEYS = {
    *("status", "query", "target", "route", "runners_up", "nearest", "referent", "candidates", "question", "reasons"),
    *("steps", "dropped", "confidence", "pace", "refused"),
}


def ground(text: str, street: Street | None = None) -> Answer:
    return (GROUNDER if street is None else street.grounder()).ground(text)


@pytest.mark.parametrize(
    ("text", "status", "code"),
    [
        ("stop behind the blue car", "ok", 0),
        ("stop behind the white car", "ambiguous", 3),
        ("stop behind the pink bus", "not_found", 3),
        ("stop on the left", "ok", 0),
        ("stop near the tree", "not_found", 3),
        ("turn right", "not_found", 3),
        ("stop in 20 metres", "ok", 0),
        ("indicate left", "not_a_command", 2),
        ("follow the closest bus", "not_found", 3),
        ("park behind the zebra", "not_found", 3),
        ("tell me a joke", "not_a_command", 2),
        ("", "not_a_command", 2),
        ("park " * 4000, "not_a_command", 2),
    ],
)
def test_every_text_has_an_answer(text: str, status: str, code: int) -> None:
    answer = ground(text)
    assert (answer.status, answer.exit_code) == (status, code)
    value = json.loads(json.dumps(answer.to_dict()))
    assert set(value) == KEYS
    assert (value["target"] is not None) == (status == "ok")
    assert value["reasons"]
    assert value["query"]["status"] == ("reject" if status == "not_a_command" else "ok")
    assert answer.status.replace("_", " ") in answer.text()


@pytest.mark.parametrize("text", ["drive on the pavement", "mount the pavement and stop behind the blue car"])
def test_what_no_driver_should_do_is_refused_with_the_reason(text: str) -> None:
    answer = ground(text)
    assert (answer.status, answer.exit_code, answer.to_dict()["refused"]) == ("not_found", 3, True)
    assert answer.text().startswith(f"refused: {text}")
    assert "the pavement is for people on foot" in answer.text()
    assert not ground("stop behind the pink bus").to_dict()["refused"]


@pytest.mark.parametrize(
    ("text", "pace"),
    [
        ("slow down", "slower"),
        ("you're going too fast", "slower"),
        ("slow down, there is a blue car", "slower"),
        ("speed up", "faster"),
        ("a bit faster please", "faster"),
        ("step on it", "faster"),
        ("wait", "standing"),
        ("hang on a sec", "standing"),
        ("hold it", "standing"),
        ("wait until the blue car leaves", "standing"),
    ],
)
def test_a_speed_or_a_state_has_no_cell(text: str, pace: str) -> None:
    answer = ground(text)
    assert (answer.status, answer.pace, answer.target) == ("ok", pace, None), answer.text()
    value = answer.to_dict()
    assert (value["pace"], value["query"]["pace"], value["steps"][-1]["pace"]) == (pace, pace, pace)
    assert (value["target"], value["route"]) == (None, None)
    assert f"pace: {pace}" in answer.text()
    assert pace in repr(answer)


def test_a_step_without_a_place_leaves_the_next_one_where_it_starts() -> None:
    alone, after = ground("stop behind the blue car"), ground("slow down and then stop behind the blue car")
    assert alone.target is not None
    assert [(step.pace, step.target is None) for step in after.steps] == [("slower", True), (None, False)]
    assert after.target is not None
    assert after.target.cell == alone.target.cell


def test_the_answer_as_json() -> None:
    value = ground("stop behind the blue car").to_dict()
    assert set(value["target"]) == {"cell", "ego_m", "world_m", "heading_rad", "heading_ego_rad", "score"}
    assert value["target"]["heading_ego_rad"] == 0
    assert value["target"]["heading_rad"] == pytest.approx(1.5708)
    assert value["referent"]["id"] == "b"
    assert value["referent"]["colour"] == "blue"
    assert value["referent"]["world_m"] == pytest.approx([103, 76])
    assert value["candidates"][0] == value["referent"]


def test_ambiguous_candidates_have_distinctive_values() -> None:
    value = ground("stop behind the white car").to_dict()
    assert value["referent"] is None
    first, second = value["candidates"]  # the one of unknown colour fits less
    assert {first["side"], second["side"]} == {"ahead right", "ahead left"}
    assert first["distance_m"] != second["distance_m"]
    assert {"car", "white"} <= set(first["fits"])
    text = ground("stop behind the white car").text()
    assert "white car 11 m away, ahead right, standing" in text


def test_an_unknown_colour_of_a_candidate_is_stated() -> None:
    value = ground("stop behind the nearest car on the left").to_dict()
    assert value["candidates"][0]["colour"] is None
    assert value["candidates"][0]["rgb"] is None
    assert "car of unknown colour" in value["reasons"][0]


def test_things_that_the_map_does_not_hold_are_reported() -> None:
    answer = ground("park behind the blue car next to the lamp post")
    assert answer.status == "ok"
    assert any("lamp post" in reason for reason in answer.reasons)


def test_a_goal_next_to_an_unmapped_thing_is_not_guessed() -> None:
    answer = ground("park next to the lamp post")
    assert "'next to' is measured from a lamp post, which the map does not hold" in answer.reasons
    elephant = ground("park next to the elephant")
    assert "'next to' is measured from an elephant, which the map does not hold" in elephant.reasons
    assert answer.plan.nearest is not None
    assert "nearest place that would do: cell" in answer.text()


def test_a_caret_marks_the_words_that_are_not_understood() -> None:
    lines = ground("please make me a sandwich").text().splitlines()
    assert lines[2].strip() == "^" * len(lines[2].strip())
    assert lines[1].index("make") == lines[2].index("^")


def test_words_that_no_map_shows_are_reported() -> None:
    answer = ground("follow the shiny blue car")
    assert answer.status == "ok"
    assert any("'shiny'" in reason for reason in answer.reasons)


def test_an_ambiguous_command_has_a_question() -> None:
    value = ground("stop behind the white car").to_dict()
    assert value["status"] == "ambiguous"
    assert value["question"].endswith("?")
    assert "left" in value["question"]
    assert "right" in value["question"]
    assert value["question"] in ground("stop behind the white car").text()


def test_the_route_leads_from_the_ego_to_the_target() -> None:
    value = ground("stop behind the blue car").to_dict()
    assert value["route"][0] == pytest.approx([EGO.centre_m, 0.0], abs=0.5)
    assert value["route"][-1] == pytest.approx(value["target"]["ego_m"], abs=0.3)


def test_a_grounder_without_a_scene_raises() -> None:
    with pytest.raises(AppoccError, match="expected a scene to be set"):
        Grounder().ground("stop")


def test_a_reading_that_the_scene_refutes_ranks_lower(monkeypatch: pytest.MonkeyPatch) -> None:
    """The parser offers a bus, which is not in the scene, and a car."""
    bus, car = (parse(f"stop behind the blue {noun}") for noun in ("bus", "car"))
    monkeypatch.setattr("grounding.grounder.parse_all", lambda *_, **__: (bus, replace(car, score=-3.0)))
    grounder = Grounder()
    grounder.set_scene(STREET.bev(), STREET.boxes())
    assert grounder.ground("stop behind the blue one").query.referent == car.query.referent


def test_listed_numbers_are_those_of_the_candidates() -> None:
    street = Street().car("a", 12, -3, RED).car("b", 20, -3, BLACK)
    text = ground("stop behind the first car", street).text()
    assert "  2. black car" in text


def test_an_indefinite_referent_is_chosen_by_its_goal() -> None:
    street = Street().car("nearest", 12, -5, RED).car("in its place", 6.5, -5, BLACK).car("free", 24, -5, RED)
    answer = ground("park behind a red car", street)
    assert answer.status == "ok"
    assert answer.referent is not None
    assert answer.referent.item.id == "free"
    tight = ground("park behind the nearest red car", street)
    assert tight.status == "ambiguous"
    assert tight.question.startswith("there is no room there")


def test_control_characters_do_not_reach_the_terminal() -> None:
    text = ground("\x1b[31mstop behind\x07 the blue car").text()
    assert "\x1b" not in text
    assert "\x07" not in text


def test_a_case_that_is_not_seen_is_chosen_by_its_number() -> None:
    asked = ground("if the light is red stop behind the blue car, otherwise carry on")
    assert asked.status == "ambiguous"
    assert asked.question.endswith("or 'carry on'?")
    stopped, driven = asked.choose(1), asked.choose(2)
    assert (stopped.query.action, stopped.status) == ("stop", "ok")
    assert (driven.query.action, driven.status) == ("other", "ok")
    for number in (0, 3):
        with pytest.raises(AppoccError, match="1 to 2"):
            asked.choose(number)


def test_both_vehicles_of_a_pair_are_told() -> None:
    answer = ground("park between the white car on the right and the blue car")
    assert "the other one is the blue car" in answer.text()
