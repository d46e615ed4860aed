"""What a sentence says of a thing stays with it: its side where it is counted, its motion, its facing, its order."""

from __future__ import annotations

import pytest

from grounding.language.parser import parse


@pytest.mark.parametrize(
    ("text", "qualifiers"),
    [
        ("park behind the second van on the right", {"second", "right_side"}),
        ("stop next to the last truck on the left", {"last", "left_side"}),
        ("follow the silver car rolling along ahead of us", {"moving", "ahead"}),
        ("overtake the bus crawling slowly in front of us", {"moving", "ahead"}),
        ("stop opposite the van facing us", {"facing_us"}),
        ("park behind the truck that is pointing towards us", {"facing_us"}),
        ("stop behind the red car directly ahead", {"ahead"}),
    ],
)
def test_qualifiers_reach_the_vehicle(text: str, qualifiers: set[str]) -> None:
    reading = parse(text)
    assert reading.query.referent is not None
    assert set(reading.query.referent.qualifiers) == qualifiers, reading.query
    assert reading.dropped == ()


@pytest.mark.parametrize(
    ("text", "relation"),
    [
        ("park behind the red one after the truck", "past"),
        ("stop next to the grey one in front of the van", "in_front_of"),
        ("pull in behind the white one right before the bus", "before"),
    ],
)
def test_one_is_placed_by_the_vehicle_after_it(text: str, relation: str) -> None:
    reading = parse(text)
    assert reading.query.referent is not None
    assert reading.query.relation != "none"
    assert [(one.relation, one.of) for one in reading.query.secondary] == [(relation, "referent")]


@pytest.mark.parametrize(
    "text", ["stop beside the van and not at the red car", "park by the bus, not at the moving truck"]
)
def test_a_rival_is_excluded_wherever_it_stands(text: str) -> None:
    excluded = parse(text).query.excluded
    assert [one.relation for one in excluded] == [None]


@pytest.mark.parametrize(
    "text",
    ["pull up at the side of the road", "let me out on the side", "halt by the roadside", "stop off to the side"],
)
def test_the_side_is_our_kerb(text: str) -> None:
    query = parse(text).query
    assert query.road_side == "kerb" or query.action == "pull_over"
    assert query.secondary == ()


@pytest.mark.parametrize(
    ("text", "noun"),
    [
        ("pull over on the other side of the crossing", "crossing"),
        ("let me out on the far side of the junction", "junction"),
        ("park on the far side of the intersection", "intersection"),
    ],
)
def test_the_far_side_of_a_landmark_is_past_it(text: str, noun: str) -> None:
    query = parse(text).query
    assert [(one.noun, one.relation) for one in query.secondary] == [(noun, "past")]
    assert query.road_side is None


@pytest.mark.parametrize("text", ["park on the far side of the road", "stop on the other side of the street"])
def test_the_far_side_of_the_road_is_across_it(text: str) -> None:
    assert parse(text).query.road_side == "opposite"


@pytest.mark.parametrize(
    "text",
    [
        "wait at the crossing until the bus has passed",
        "wait at the stop line till the red car is gone",
        "hold on at the junction until the truck has turned",
    ],
)
def test_to_wait_at_a_landmark_is_to_stop_there_first(text: str) -> None:
    reading = parse(text)
    assert [one.action for one in reading.steps] == ["stop", "wait"]
    assert [one.relation for one in reading.steps[0].secondary] == ["at"]
    assert reading.query.trigger is not None
