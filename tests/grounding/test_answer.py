from __future__ import annotations

import json

import pytest
from street import BLACK, BLUE, RED, WHITE, Street

from grounding.answer import ground

SCENE = Street().car("w1", 12, -3, WHITE).car("w2", 20, 3, WHITE).car("b", 26, -3, BLUE).car("k", 8, 3, None).scene()
KEYS = {"status", "query", "target", "referent", "candidates", "reasons"}


@pytest.mark.parametrize(
    ("text", "status", "code"),
    [
        ("stop behind the blue car", "ok", 0),
        ("stop behind the white car", "ambiguous", 3),
        ("stop behind the pink bus", "not_found", 3),
        ("stop on the left", "not_found", 3),
        ("stop near the tree", "not_found", 3),
        ("turn right", "not_found", 3),
        ("stop in 20 metres", "not_found", 3),
        ("follow the closest bus", "not_found", 3),
        ("park behind the zebra", "not_found", 3),
        ("tell me a joke", "not_a_command", 2),
        ("", "not_a_command", 2),
        ("park " * 4000, "not_a_command", 2),
    ],
)
def test_every_text_has_an_answer(text: str, status: str, code: int) -> None:
    answer = ground(text, SCENE)
    assert (answer.status, answer.exit_code) == (status, code)
    value = json.loads(json.dumps(answer.to_dict()))
    assert set(value) == KEYS
    assert (value["target"] is not None) == (status == "ok")
    assert value["reasons"]
    assert value["query"]["status"] == ("reject" if status == "not_a_command" else "ok")
    assert answer.status.replace("_", " ") in answer.text()


def test_the_answer_for_machines() -> None:
    value = ground("stop behind the blue car", SCENE).to_dict()
    assert set(value["target"]) == {"cell", "ego_m", "world_m", "heading_rad", "heading_ego_rad", "score"}
    assert value["target"]["heading_ego_rad"] == 0
    assert value["target"]["heading_rad"] == pytest.approx(1.5708)
    assert value["referent"]["id"] == "b"
    assert value["referent"]["colour"] == "blue"
    assert value["referent"]["world_m"] == pytest.approx([103, 76])
    assert value["candidates"][0] == value["referent"]


def test_what_tells_ambiguous_candidates_apart() -> None:
    value = ground("stop behind the white car", SCENE).to_dict()
    assert value["referent"] is None
    first, second = value["candidates"]
    assert {first["side"], second["side"]} == {"ahead right", "ahead left"}
    assert first["distance_m"] != second["distance_m"]
    assert set(first["fits"]) == {"car", "white"}
    text = ground("stop behind the white car", SCENE).text()
    assert "white car 11 m away, ahead right, standing" in text


def test_an_unknown_colour_is_said_and_not_guessed() -> None:
    value = ground("stop behind the nearest car on the left", SCENE).to_dict()
    assert value["candidates"][0]["colour"] is None
    assert value["candidates"][0]["rgb"] is None
    assert "car of unknown colour" in value["reasons"][0]


def test_things_the_map_does_not_hold_are_told() -> None:
    answer = ground("park behind the blue car next to the lamp post", SCENE)
    assert answer.status == "ok"
    assert "the map holds no lamp post" in answer.reasons


def test_a_caret_under_the_word_that_is_not_understood() -> None:
    lines = ground("park behind the zebra", SCENE).text().splitlines()
    assert lines[2].strip() == "^" * len("zebra")
    assert lines[1].index("zebra") == lines[2].index("^")


def test_a_command_that_cannot_be_placed_names_the_word() -> None:
    answer = ground("follow the shiny blue car", SCENE)
    assert answer.reasons[0].startswith("'follow': cannot be placed yet")
    assert "not understood and left out: 'shiny'" in answer.reasons
    assert answer.to_dict()["query"]["action"] == "follow"
    assert answer.text().splitlines()[2].strip() == "^" * len("follow")


def test_numbers_of_the_list_are_those_of_the_candidates() -> None:
    scene = Street().car("a", 12, -3, RED).car("b", 20, -3, BLACK).scene()
    text = ground("stop behind the first car", scene).text()
    assert "  2. black car" in text


def test_where_any_vehicle_will_do_one_with_a_free_place_is_taken() -> None:
    street = Street().car("nearest", 12, -5, RED).car("in its place", 6.5, -5, BLACK).car("free", 24, -5, RED)
    answer = ground("park behind a red car", street.scene())
    assert answer.status == "ok"
    assert answer.referent is not None
    assert answer.referent.item.id == "free"
    assert ground("park behind the nearest red car", street.scene()).status == "not_found"


def test_control_characters_do_not_reach_the_terminal() -> None:
    text = ground("\x1b[31mstop behind\x07 the blue car", SCENE).text()
    assert "\x1b" not in text
    assert "\x07" not in text
