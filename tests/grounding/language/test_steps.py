from __future__ import annotations

import pytest

from grounding.language import parse
from grounding.query import Referent


@pytest.mark.parametrize(
    ("text", "steps"),
    [
        ("park behind the van", [("park", "behind", "van")]),
        ("turn left and stop behind the second van", [("turn", "none", None), ("stop", "behind", "van")]),
        ("drive up to the van and stop behind it", [("stop", "behind", "van")]),
        ("after the bus leaves, park in its spot", [("wait", "none", "bus"), ("park", "at", "bus")]),
        (
            "overtake the truck and then follow the red car",
            [("overtake", "none", "truck"), ("follow", "none", "car")],
        ),
    ],
)
def test_steps_are_in_order(text: str, steps: list[tuple[str, str, str | None]]) -> None:
    reading = parse(text)
    found = [(one.action, one.relation, one.referent.noun if one.referent else None) for one in reading.steps]
    assert found == steps


def test_an_awaited_event_is_a_step_that_holds() -> None:
    wait, turn = parse("turn left after the bus has passed").steps
    assert (wait.action, wait.trigger, turn.action, turn.trigger) == ("wait", "pass", "turn", None)


@pytest.mark.parametrize(
    ("text", "action", "relation"),
    [
        ("pull over so the bus can get past", "pull_over", "none"),
        ("stop here so that the bikes can get past", "stop", "none"),
        ("stop next to the van so that my wife can get in", "stop", "next_to"),
        ("park behind the van so the motorbike can get by", "park", "behind"),
    ],
)
def test_a_purpose_is_not_awaited(text: str, action: str, relation: str) -> None:
    (step,) = parse(text).steps
    assert (step.action, step.relation, step.trigger) == (action, relation, None)


@pytest.mark.parametrize("text", ["stay in this lane until the junction", "keep going till the next crossing"])
def test_who_drives_on_until_a_landmark_drives_to_it(text: str) -> None:
    query = parse(text).query
    assert (query.action, query.relation, query.landmark) == ("other", "at", "secondary")


@pytest.mark.parametrize("text", ["take the next free space on the left", "park in the nearest spot behind the bus"])
def test_the_first_space_is_taken_anyway(text: str) -> None:
    assert not parse(text).dropped
    assert parse("take the third space on the left").query.count == 3


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("take the third left", 3),
        ("turn right at the second junction", 2),
        ("second left please", 2),
        ("turn left", None),
    ],
)
def test_branches_are_counted(text: str, count: int | None) -> None:
    assert parse(text).query.count == count


def test_words_without_use_are_told() -> None:
    assert parse("stop by the tall hedge").dropped == ("tall",)
    assert parse("park behind the red car").dropped == ()


def test_a_dropped_word_that_changes_the_place_is_in_doubt() -> None:
    assert parse("park behind the green car, green truck").doubt


def test_where_something_is_not_is_away_from_it() -> None:
    (excluded,) = parse("park wherever there is no bus").query.excluded
    assert (excluded.relation, excluded.noun) == ("near", "bus")


def test_a_manner_is_no_doubt() -> None:
    assert parse("stop next to the van without blocking the driveway").doubt == ""


def test_a_pronoun_needs_an_antecedent() -> None:
    assert parse("stop next to it").query.unresolved == "it"
    meant = parse("stop next to it", antecedent=Referent("van", "van", "red")).query
    assert meant.unresolved == ""
    assert meant.referent is not None
    assert (meant.referent.noun, meant.referent.colour) == ("van", "red")
    assert parse("park it").query.unresolved == ""


def test_a_negated_turn_is_no_turn_after_an_event() -> None:
    assert parse("don't turn left after the bus passes").query.action != "turn"
    until = "don't turn left until the bus has passed"
    assert parse(until, revised=False).query.action == "turn"
    assert parse(until).doubt or parse(until).query.action == "turn"


@pytest.mark.parametrize(
    ("text", "first", "then"),
    [
        ("past the blue van and stop before the truck", "van", ("stop", "before", "truck")),
        ("past the bus, then park behind the red car", "bus", ("park", "behind", "car")),
        ("beyond the truck and park in front of the red car", "truck", ("park", "in_front_of", "car")),
        ("pass the white van and stop before the bus", "van", ("stop", "before", "bus")),
    ],
)
def test_past_one_vehicle_and_then_at_another_are_two_steps(
    text: str, first: str, then: tuple[str, str, str]
) -> None:
    reading = parse(text)
    passing, placed = reading.steps
    assert passing.action in ("drive_past", "overtake")
    assert passing.referent is not None
    assert passing.referent.noun == first
    assert placed.referent is not None
    assert (placed.action, placed.relation, placed.referent.noun) == then


@pytest.mark.parametrize("text", ["past the bus and turn left", "past the van, park on the left"])
def test_past_a_vehicle_without_another_place_is_one_step(text: str) -> None:
    assert [(step.relation, len(parse(text).steps)) for step in parse(text).steps] == [("past", 1)]


def test_a_stop_until_an_event_comes_before_the_wait() -> None:
    steps = parse("pull over until the fire engine has passed").steps
    assert [(step.action, step.trigger) for step in steps] == [("pull_over", None), ("wait", "pass")]


@pytest.mark.parametrize(
    ("text", "turns"),
    [
        ("take the second left and the first right", [("left", 2), ("right", 1)]),
        ("make a right and then the third left", [("right", None), ("left", 3)]),
    ],
)
def test_each_turn_keeps_its_side_and_number(text: str, turns: list[tuple[str, int | None]]) -> None:
    assert [(step.direction, step.count) for step in parse(text).steps] == turns


@pytest.mark.parametrize("text", ["go up to the blue van and stop", "head to the bus and then stop"])
def test_a_bare_stop_ends_where_the_step_before_leads(text: str) -> None:
    steps = parse(text).steps
    assert len(steps) == 1
    assert steps[0].referent is not None


def test_the_end_of_the_road_is_a_landmark() -> None:
    reading = parse("pull up at the end of our street")
    assert [part.noun for part in reading.query.secondary] == ["end_of_our_street"]
    assert not reading.dropped


def test_crossing_to_the_other_side_has_a_side() -> None:
    reading = parse("cross over to the far side of the road and pull over")
    assert reading.query.road_side == "opposite"
    assert not reading.dropped
