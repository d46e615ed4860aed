from __future__ import annotations

import pytest

from grounding.language.replies import _replies, read_reply, with_superlatives


@pytest.mark.parametrize(
    ("text", "kinds", "rest"),
    [
        ("yes", ("yes",), ""),
        ("Never mind.", ("cancel",), ""),
        ("no, the other one", ("no", "other"), ""),
        ("No, the red one please", ("no",), "the red one"),
        ("and then turn right", ("then",), "turn right"),
        ("i said behind it instead", ("meant",), "behind it"),
        ("where are you heading?", ("heading",), ""),
        ("why that one?", ("why",), ""),
        ("could you leave a bit more space", ("away",), ""),
        ("drop back a little", ("back",), ""),
        ("closer please", ("near",), ""),
        ("next to it", (), "next to it"),
        ("wait, the bus", ("aside",), "the bus"),
        ("wait behind the bus", (), "wait behind the bus"),
        ("no, not here, a bit further on", ("no", "elsewhere", "ahead"), ""),
        ("no need to stop", ("without",), "stop"),
        ("thanks, that's great", ("thanks", "thanks"), ""),
        ("actually never mind the overtaking", ("cancel",), "the overtaking"),
        ("no, further on, in front of it", ("no", "ahead"), "in front of it"),
        ("a bit closer to the black one", ("near",), "to the black one"),
        ("idk the far one", ("any",), "the far one"),
        ("park behind the red car", (), "park behind the red car"),
        ("what's the weather doing?", (), "what's the weather doing"),
        ("", (), ""),
    ],
)
def test_kinds_and_rest(text: str, kinds: tuple[str, ...], rest: str) -> None:
    reply = read_reply(text)
    assert (reply.kinds, reply.rest) == (kinds, rest)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("2", 2),
        ("number two", 2),
        ("the second one", 2),
        ("first", 1),
        ("the last one", None),
        ("2 metres", None),
        ("no, 4", 4),
    ],
)
def test_numbers(text: str, number: int | None) -> None:
    assert read_reply(text).number == number


@pytest.mark.parametrize(
    ("text", "shift", "distance_m"),
    [
        ("two metres further back", "back", 2.0),
        ("a bit further on", "ahead", None),
        ("a little to the left", "leftwards", None),
        ("on the left", None, None),
        ("five metres behind it", None, None),
    ],
)
def test_shifts(text: str, shift: str | None, distance_m: float | None) -> None:
    reply = read_reply(text)
    assert (reply.shift, reply.distance_m) == (shift, distance_m)


def test_comparatives_become_superlatives() -> None:
    assert with_superlatives("the closer one") == "the nearest one"
    assert with_superlatives("the far one") == "the farthest one"


def test_every_pattern_is_valid() -> None:
    for only in ("", "skip", "tail", "nearest", "farthest", "largest", "smallest"):
        patterns = _replies(only).patterns
        assert patterns
        assert all(pattern.parts() for pattern in patterns)


def test_any_with_a_question_mark_asks_what_is_there() -> None:
    assert read_reply("any trucks about?").kinds[-1] == "seek"
    assert read_reply("any of them").kinds[-1] == "any"


def test_a_shift_by_a_distance_names_the_vehicle_that_it_is_measured_from() -> None:
    reply = read_reply("a metre closer to the bus")
    assert (reply.leading_shift, reply.rest, reply.distance_m) == ("near", "to the bus", 1.0)
