from __future__ import annotations

from typing import Any

import pytest

from appocc.errors import DataError
from grounding.query import Exclusion, Landmark, Query, Referent
from grounding.query_schema import query_from_json

WHOLE = Query(
    command="x",
    action="park",
    actions=("turn", "park"),
    relation="between",
    landmark="referent",
    referent=Referent(
        noun="car",
        head="sedan",
        colour="dark blue",
        qualifiers=("second", "leftmost"),
        qualifiers_optional=("ahead",),
        number=2,
        anaphora=True,
        extra=("open door",),
    ),
    secondary=(Landmark("truck", "between", "goal", "red", ("parked",)), Landmark("parking_lot", "into")),
    direction="left",
    goal_side="right",
    trigger="pass",
    distance_m=3.048,
    distance_of="referent",
    excluded=(Exclusion(None, "van", "red"), Exclusion("next_to", "car", "blue", ("first",))),
)


@pytest.mark.parametrize("query", [WHOLE, Query("x", "stop", ("stop",)), Query("x")])
def test_queries_survive_a_round_trip(query: Query) -> None:
    assert query_from_json("x", query.to_dict()) == query


def test_empty_values_may_be_omitted() -> None:
    assert query_from_json("go", {"status": "ok", "action": "stop"}) == Query("go", "stop", ("stop",))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"action": "fly"}, "action"),
        ({"action": None}, "expected an action unless rejected, got None and status 'ok'"),
        ({"status": "reject"}, "got park and status 'reject'"),
        ({"relation": "over"}, "relation"),
        ({"distance_m": float("nan")}, "distance_m"),
        ({"distance_m": 1e9}, "distance_m"),
        ({"referent": {"noun": "ship", "head": "ship"}}, "referent.noun"),
        ({"referent": {"noun": "car", "head": "car", "colour": "dark"}}, None),
        ({"referent": {"noun": "car", "head": "car", "colour": "loud"}}, "referent.colour"),
        ({"referent": {"noun": "car", "head": "car", "qualifiers": ["fast"]}}, "referent.qualifiers.0"),
        ({"secondary": [{"noun": "tree", "relation": "under"}]}, "secondary.0.relation"),
        ({"excluded": "all"}, "excluded"),
        ({"secondary": [{"noun": "tree", "relation": "near"}] * 17}, "secondary"),
    ],
)
def test_invalid_values(changes: dict[str, Any], reason: str | None) -> None:
    given = WHOLE.to_dict() | changes
    if reason is None:
        assert query_from_json("x", given).referent
        return
    with pytest.raises(DataError, match=reason):
        query_from_json("x", given)


@pytest.mark.parametrize("value", [None, [], "park", 3])
def test_values_that_are_not_objects(value: Any) -> None:
    with pytest.raises(DataError, match="query: "):
        query_from_json("x", value)
