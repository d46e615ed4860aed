"""Later turns as partial queries that are merged into the last command."""

from __future__ import annotations

import numpy as np
import pytest
from street import BLUE, RED, WHITE, Street

from grounding.dialogue.merging import merge, names_gap_only
from grounding.dialogue.session import Session
from grounding.query import Exclusion, Landmark, Query, Referent

RED_CAR, VAN = Referent("car", "car", "red"), Referent("van", "van")
BASE = Query(
    *("park 3 metres behind the red car on the left", "park", ("park",), "behind"),
    landmark="referent",
    referent=RED_CAR,
    goal_side="left",
    distance_m=3.0,
    distance_of="referent",
    excluded=(Exclusion(None, "van"),),
)


def row() -> Session:
    street = Street().car("r1", 12, -5, RED).car("r2", 28, -5, RED)
    return street.car("b", -14, -5, BLUE).grounder().session()


def test_a_distance_alone_keeps_everything_else() -> None:
    merged = merge(BASE, Query("leave 5 metres", distance_m=5.0, distance_of="referent"))
    assert (merged.distance_m, merged.relation, merged.referent, merged.goal_side) == (5.0, "behind", RED_CAR, "left")
    assert merged.command == "leave 5 metres"


def test_a_place_takes_distance_and_sides_with_it() -> None:
    merged = merge(BASE, Query("next to it", relation="next_to", landmark="referent"))
    assert (merged.relation, merged.referent, merged.distance_m, merged.goal_side) == ("next_to", RED_CAR, None, None)
    assert (merged.action, merged.actions) == ("park", ("park",))


def test_a_vehicle_keeps_the_place() -> None:
    merged = merge(BASE, Query("the van", referent=VAN, excluded=(Exclusion(None, "car", "blue"),)))
    assert (merged.relation, merged.referent, merged.distance_m) == ("behind", VAN, 3.0)
    assert merged.excluded == (Exclusion(None, "van"), Exclusion(None, "car", "blue"))


def test_a_vehicle_of_an_excluded_colour_lifts_the_exclusion() -> None:
    base = Query("", "park", relation="behind", referent=VAN, excluded=(Exclusion(None, "car", "black"),))
    assert merge(base, Query("the black one", referent=Referent("car", "one", "black"))).excluded == ()


def test_a_place_at_a_landmark_has_no_vehicle() -> None:
    part = Landmark("crossing", "before")
    merged = merge(BASE, Query("before the crossing", relation="before", landmark="secondary", secondary=(part,)))
    assert (merged.relation, merged.referent, merged.secondary) == ("before", None, (part,))


def test_an_antecedent_is_resolved_by_a_vehicle() -> None:
    base = Query("park behind the red one", "park", relation="behind", unresolved="one", sought=RED_CAR)
    merged = merge(base, Query("the car", referent=RED_CAR))
    assert (merged.referent, merged.unresolved, merged.sought) == (RED_CAR, "", None)


@pytest.mark.parametrize(
    ("query", "gap"),
    [
        (Query("", distance_m=3.0, distance_of="referent"), True),
        (Query("", distance_m=3.0, distance_of="ego"), False),
        (Query("", distance_m=3.0, distance_of="referent", referent=VAN), False),
        (Query("", distance_m=3.0, distance_of="referent", relation="behind"), False),
    ],
)
def test_what_names_the_gap_only(query: Query, gap: bool) -> None:
    assert names_gap_only(query) == gap


@pytest.mark.parametrize(
    ("turn", "relation", "distance_m"),
    [
        ("leave a good three metres though", "behind", 3.0),
        ("Then in front of it, to be safe.", "in_front_of", None),
        ("no, further on, in front of it", "in_front_of", None),
        ("make that five metres in front", "in_front_of", 5.0),
        ("in front, easier to get out", "in_front_of", None),
    ],
)
def test_a_turn_changes_what_it_names(turn: str, relation: str, distance_m: float | None) -> None:
    session = row()
    session.say("stop behind the farthest red car")
    answer = session.say(turn)
    assert answer.status == "ok", answer.text()
    assert answer.referent is not None
    assert (answer.query.relation, answer.query.distance_m) == (relation, distance_m)
    assert answer.referent.item.id == "r2"


def test_closer_to_a_named_vehicle() -> None:
    session = Street().car("white", 8, -5, WHITE).car("blue", 36, -5, BLUE).grounder().session()
    before = session.say("stop in 20 metres").target
    after = session.say("a bit closer to the blue car").target
    assert before is not None
    assert after is not None
    assert after.ego_m[0] - before.ego_m[0] == pytest.approx(2.0, abs=0.9)


def test_back_to_the_one_that_was_spoken_of() -> None:
    session = row()
    session.say("stop behind the farthest red car")
    session.say("stop in 8 metres")
    answer = session.say("no, back to the red one I said")
    assert answer.referent is not None
    assert answer.referent.item.id == "r2"


def test_a_shift_before_words_that_are_no_place() -> None:
    session = row()
    before = session.say("stop behind the farthest red car").target
    after = session.say("a bit further back, the shops are closed").target
    assert before is not None
    assert after is not None
    assert float(np.hypot(*(after.ego_m - before.ego_m))) == pytest.approx(2.0, abs=0.9)
