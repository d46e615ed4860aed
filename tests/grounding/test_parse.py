from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grounding.parse import caret, read
from grounding.tokens import MAX_CHARACTERS

# Sentence: action, relation, noun, colour, qualifiers.
COMMANDS = {
    "park behind the silver car": ("park", "behind", "car", "silver", ()),
    "Stop next to that gray VAN!": ("stop", "next_to", "van", "grey", ()),
    "go to the second car on the right": ("approach", "toward", "car", None, ("second", "right_side")),
    "pull over in front of the nearest dark blue pickup truck": (
        "pull_over",
        "in_front_of",
        "truck",
        "dark blue",
        ("nearest",),
    ),
    "could you please park close to a parked motorbike": ("park", "near", "motorcycle", None, ("parked",)),
    "stop on the right of the bus that is parked ahead": ("stop", "right_of", "bus", None, ("parked", "ahead")),
    "get behind the suv in front of us": ("approach", "behind", "car", None, ("ahead",)),
    "pull up and stop beside the last white lorry": ("stop", "next_to", "truck", "white", ("last",)),
    "park behind the second car from the left": ("park", "behind", "car", None, ("second", "leftmost")),
    "stop next to the last bus from our right hand side": ("stop", "next_to", "bus", None, ("last", "rightmost")),
    "stop behind the car from the left": ("stop", "behind", "car", None, ("left_side",)),
    "park behind the car on the left of the road": ("park", "behind", "car", None, ("left_side",)),
    "park behind the car on the left side of the road": ("park", "behind", "car", None, ("left_side",)),
    "stop by the van at the right hand side of our street": ("stop", "near", "van", None, ("right_side",)),
    "park in the spot behind the second closest vehicle": ("park", "behind", "vehicle", None, ("second", "nearest")),
}


@pytest.mark.parametrize("text", COMMANDS)
def test_commands(text: str) -> None:
    reading = read(text)
    assert reading.problem is None
    query = reading.query
    assert query.referent is not None
    found = (query.action, query.relation, query.referent.noun, query.referent.colour, query.referent.qualifiers)
    assert found == COMMANDS[text]


def test_said_of_the_place_and_not_of_the_vehicle() -> None:
    query = read("You can park up ahead on the right behind the silver car, next to the lamp post").query
    assert query.goal_side == "right"
    assert query.referent is not None
    assert query.referent.qualifiers == ()
    assert query.referent.qualifiers_optional == ("ahead",)
    assert [(mark.noun, mark.relation) for mark in query.secondary] == [("lamp_post", "next_to")]


def test_distance_and_article() -> None:
    query = read("park 10 feet behind a bus").query
    assert query.distance_m == pytest.approx(3.048)
    assert query.referent is not None
    assert not query.referent.definite
    assert query.to_dict()["distance_of"] == "referent"


def test_mended_and_unknown_words_are_told() -> None:
    reading = read("stop behind the shiny sliver trcuk")
    assert reading.query.referent is not None
    assert (reading.query.referent.colour, reading.query.referent.head) == ("silver", "truck")
    notes = " ".join(reading.notes)
    assert "'sliver' was read as 'silver'" in notes
    assert "left out: 'shiny'" in notes


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no words"),
        ("   \t ", "holds no words"),
        ("\U0001f697\U0001f697", "holds no words"),
        ("停在白色汽车后面", "no word of it is understood"),
        ("остановись за белой машиной", "no word of it is understood"),
        ("tell me a joke", "no driving action"),
        ("wash the silver car", "no driving action"),
        ("what colour is the bus?", "a question"),
        ("when do we stop?", "a question"),
        ("I love you", "no word of it is understood"),
        ("turn the music down", "no driving action"),
        ("turn on the lights", "no word of it is understood"),
        ("pass me the salt", "no driving action"),
        ("get me a coffee", "no driving action"),
        ("let me tell you a story", "no driving action"),
        ("watch a movie", "no driving action"),
        ("park behind the car " * 600, f"expected at most {MAX_CHARACTERS} characters, got 12000"),
    ],
)
def test_what_is_no_command_gets_one_clear_line(text: str, message: str) -> None:
    reading = read(text)
    assert reading.problem is not None
    assert message in reading.problem.message
    assert "\n" not in reading.problem.message
    assert reading.query.action is None
    assert reading.query.to_dict()["status"] == "reject"
    assert len(reading.query.command) <= MAX_CHARACTERS


# Driving commands that have no place yet: action, and what the one line says.
UNPLACED = {
    "turn right": ("turn", "'turn right': cannot be placed yet"),
    "turn at the bakery": ("turn", "'turn at': cannot be placed yet"),
    "stop in 20 metres": ("stop", "'20 metres': cannot be placed yet"),
    "follow the closest bus": ("follow", "'follow': cannot be placed yet"),
    "wait": ("wait", "'wait': cannot be placed yet"),
    "let the red car pass": ("give_way", "'let': cannot be placed yet"),
    "keep going": ("other", "'keep going': cannot be placed yet"),
    "change to the left lane": ("change_lane", "'change to the left lane': cannot be placed yet"),
    "drive around the blue van": ("overtake", "'drive around': cannot be placed yet"),
    "when the bus leaves, turn left": ("turn", "'when': cannot be placed yet"),
    "don't park behind the bus": ("park", "'don't': cannot be placed yet"),
    "park between the cars": ("park", "'between': cannot be placed yet"),
    "stop 5 metres before the red truck": ("stop", "'before': cannot be placed yet"),
    "park behind the bus after the light": ("park", "'after': cannot be placed yet"),
    "stop behind the car that is turning left": ("stop", "'turning left': cannot be placed yet"),
    "park behind the van 15 metres ahead of us": ("park", "'15 metres': cannot be placed yet"),
    "there is a van. park behind it": ("park", "'it': cannot be placed yet"),
    "stop the red truck": ("stop", "expected a relation"),
    "park behind the": ("park", "missing after 'behind': expected a vehicle"),
    "park behind the zebra": ("park", "'zebra' is not understood: expected a vehicle"),
    "park behind the bus near a van": ("park", "'van' is not understood here"),
    "park behind the red and blue car": ("park", "one colour at a time"),
    "stop. park behind the car": ("park", "one command at a time"),
    "park behind the vann": ("park", "did you mean 'van'"),
}


@pytest.mark.parametrize("text", UNPLACED)
def test_driving_commands_that_cannot_be_placed_keep_their_action(text: str) -> None:
    action, message = UNPLACED[text]
    reading = read(text)
    assert reading.query.to_dict()["status"] == "ok"
    assert reading.query.action == action
    assert reading.problem is not None
    assert message in reading.problem.message
    assert "\n" not in reading.problem.message


def test_what_is_read_of_a_command_that_cannot_be_placed() -> None:
    query = read("turn left after the second white van").query.to_dict()
    assert (query["direction"], query["relation"]) == ("left", "past")
    assert query["referent"]["colour"] == "white"
    assert query["referent"]["qualifiers"] == ["second"]
    ego, descriptor = read("stop in 20 feet").query, read("park behind the van 15 metres ahead of us").query
    assert ego.distance_m == pytest.approx(6.096)
    assert ego.distance_of == "ego"
    assert (descriptor.distance_m, descriptor.distance_of) == (15, "descriptor")
    assert descriptor.referent is not None
    assert descriptor.referent.qualifiers == ("ahead",)


def test_small_talk_around_a_command_does_not_hide_it() -> None:
    query = read("is that a bus? get me a coffee. stop behind the white car").query
    assert (query.action, query.relation) == ("stop", "behind")


def test_caret_points_at_the_word() -> None:
    text = "Park  behind the zebra"
    problem = read(text).problem
    assert problem is not None
    sentence, marks = caret(text, problem).splitlines()
    start = marks.index("^")
    assert sentence[start : start + marks.count("^")] == "zebra"


def test_no_caret_for_the_whole_sentence() -> None:
    problem = read("tell me a joke").problem
    assert problem is not None
    assert caret("tell me a joke", problem) == ""


WORDS = (
    "park stop behind near the a red dark second left on right car truck in front of 5 metres tree zebra . next to"
)


@settings(max_examples=300, deadline=None)
@given(st.one_of(st.text(max_size=120), st.lists(st.sampled_from(WORDS.split()), max_size=14).map(" ".join)))
def test_any_text_is_a_query_or_a_problem(text: str) -> None:
    reading = read(text)
    assert reading.query.action is not None or reading.problem is not None
    json.dumps(reading.query.to_dict())


def gold(data_root: Path, *categories: str) -> list[dict[str, Any]]:
    path = data_root.parent / "grounding" / "core_dev.jsonl"
    if not path.is_file():
        pytest.skip(f"no labelled commands at {path}")
    records = [json.loads(line) for line in path.read_text().splitlines()]
    return [record for record in records if not categories or record["category"] in categories]


@pytest.mark.realdata
def test_keys_are_those_of_the_labelled_files(data_root: Path) -> None:
    record = gold(data_root, "simple")[0]
    own = read("park behind the silver car").query.to_dict()
    assert set(record) - set(own) == {"id", "token", "source", "category", "obj_name"}
    assert set(own) <= set(record)
    assert set(own["referent"]) == set(record["referent"])
    assert own == {key: record[key] for key in own}


@pytest.mark.realdata
def test_labelled_driving_commands_are_told_from_others_and_keep_their_action(data_root: Path) -> None:
    for record in gold(data_root):
        query = read(record["command"]).query.to_dict()
        assert query["status"] == record["status"], record["command"]
        assert query["action"] in (record["action"], *record["action_alt"]), record["command"]


@pytest.mark.realdata
def test_simple_labelled_commands_are_read_as_labelled(data_root: Path) -> None:
    for record in gold(data_root, "simple", "ordinal", "distance", "no_referent", "manoeuvre", "reject"):
        query = read(record["command"]).query.to_dict()
        assert query["status"] == record["status"], record["command"]
        assert query["action"] in (record["action"], *record["action_alt"]), record["command"]
        assert query["relation"] in (record["relation"], *record["relation_alt"]), record["command"]
        assert query["direction"] == record["direction"], record["command"]
        for key in ("noun", "colour", "qualifiers"):
            assert (query["referent"] or {}).get(key) == (record["referent"] or {}).get(key), record["command"]
        for key in ("distance_m", "distance_of"):
            assert query[key] == pytest.approx(record[key]), record["command"]
