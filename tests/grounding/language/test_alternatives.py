"""Alternatives of a command: a wish, and what counts where the scene has no place for it."""

from __future__ import annotations

import pytest

from grounding.language import parse
from grounding.language.alternatives import lone_fallback
from grounding.query import Query


def _place(query: Query) -> tuple[str | None, str, str | None]:
    """Return action, relation and the colour of the vehicle of a query."""
    return query.action, query.relation, query.referent.colour if query.referent else None


@pytest.mark.parametrize(
    ("text", "wish", "fallback"),
    [
        (
            "park behind the red car, otherwise in front of it",
            ("park", "behind", "red"),
            ("park", "in_front_of", "red"),
        ),
        ("park at the kerb if there's no space behind the van", ("park", "behind", None), ("park", "none", None)),
        (
            "stop next to the blue car or, if that doesn't work, behind it",
            ("stop", "next_to", "blue"),
            ("stop", "behind", "blue"),
        ),
        ("if you can't get past the truck, wait behind it", ("overtake", "none", None), ("wait", "behind", None)),
        ("overtake the bus if there's space, otherwise stay behind it", ("overtake", "none", None), None),
        (
            "park either behind the red car or behind the blue one",
            ("park", "behind", "red"),
            ("park", "behind", "blue"),
        ),
        ("stop in front of or behind the van", ("stop", "in_front_of", None), ("stop", "behind", None)),
        (
            "if the spot behind the grey car is taken, park in front of it",
            ("park", "behind", "grey"),
            ("park", "in_front_of", "grey"),
        ),
    ],
)
def test_a_wish_and_its_fallback_are_read_apart(
    text: str, wish: tuple[str, str, str | None], fallback: tuple[str, str, str | None] | None
) -> None:
    reading = parse(text)
    assert reading.is_plain
    assert reading.otherwise is not None
    assert _place(reading.query) == wish
    assert fallback is None or _place(reading.otherwise.query) == fallback


def test_whichever_is_closer_prefers_the_nearer_place() -> None:
    assert parse("stop behind the van or the bus, whichever is closer").prefers_nearer
    assert not parse("stop behind the van or the bus").prefers_nearer


@pytest.mark.parametrize(
    "text",
    [
        "if there's a gap behind the van pull in there",
        "don't stop behind the bus or the truck",
        "if the road is blocked, turn left",
        "park left or right of the bus",
    ],
)
def test_other_conditions_have_no_fallback(text: str) -> None:
    assert parse(text).otherwise is None


def test_a_fallback_without_its_wish() -> None:
    assert lone_fallback("if there's no room, park on the other side") == "park on the other side"
    assert lone_fallback("if not, stop here") == "stop here"
    assert lone_fallback("park behind the van if there's room") == ""


def test_a_text_with_many_alternatives_is_not_split() -> None:
    assert parse("stop at the kerb" + ", otherwise behind the van" * 2).otherwise is not None
    assert parse("stop at the kerb" + ", otherwise behind the van" * 20).otherwise is None


@pytest.mark.parametrize(
    ("text", "then", "other"),
    [
        ("if the truck moves, follow it, otherwise pass it", "follow", "overtake"),
        ("if the van is parked go round it, otherwise wait behind it", "overtake", "wait"),
        ("unless the bus is moving, overtake it, otherwise follow it", "follow", "overtake"),
        ("if the car leaves, follow it, else overtake it", "follow", "overtake"),
    ],
)
def test_a_state_has_a_command_for_either_case(text: str, then: str, other: str) -> None:
    reading = parse(text)
    assert reading.condition
    assert reading.otherwise is not None
    assert (reading.query.action, reading.otherwise.query.action) == (then, other)
    assert reading.is_plain


@pytest.mark.parametrize(
    ("text", "steps"),
    [
        ("follow the truck, but if it stops overtake it", [("follow", "stop"), ("overtake", None)]),
        ("follow the van unless it turns off, in which case go straight on", [("follow", "turn"), ("other", None)]),
        ("if the van turns off, go straight on, otherwise follow it", [("follow", "turn"), ("other", None)]),
        ("stop behind the bus, if it leaves, follow it", [("stop", None), ("wait", "leave"), ("follow", None)]),
    ],
)
def test_what_holds_until_an_event_is_a_plan(text: str, steps: list[tuple[str, str | None]]) -> None:
    reading = parse(text)
    assert [(step.action, step.trigger) for step in reading.steps] == steps
    assert not reading.dropped


def test_no_place_is_no_state() -> None:
    assert not parse("if there's a gap behind the van, park there, otherwise at the kerb").condition
