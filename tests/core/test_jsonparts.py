"""Refusals of values that pydantic checks: key, what is expected, what came, in this project's words."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import pytest
from pydantic import Field, ValidationError

from appocc.jsonparts import JsonPart, first_problem


class _Inner(JsonPart, extra="forbid"):
    count: Annotated[int, Field(ge=1, lt=9)] = 1
    share: Annotated[float, Field(gt=0, le=2.5)] = 1.0
    on: bool = True


class _Outer(JsonPart, extra="forbid"):
    name: Annotated[str, Field(min_length=2, max_length=4)] = "abc"
    kind: Literal["car", "bus"] = "car"
    inner: _Inner = _Inner()
    pair: Annotated[list[float], Field(min_length=2, max_length=2)] = [0.0, 0.0]  # noqa: RUF012 - copied
    table: dict[str, int] = {}  # noqa: RUF012 - copied


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([1], "expected keys and values, got [1]"),
        ({"inner": None}, "inner: expected keys and values, got nothing"),
        ({"inner": {"count": "two"}}, "inner.count: expected a whole number, got 'two'"),
        ({"inner": {"count": 1.5}}, "inner.count: expected a whole number, got 1.5"),
        ({"inner": {"count": 0}}, "inner.count: expected 1 or more, got 0"),
        ({"inner": {"count": 9}}, "inner.count: expected a number below 9, got 9"),
        ({"inner": {"share": "x"}}, "inner.share: expected a number, got 'x'"),
        ({"inner": {"share": 0.0}}, "inner.share: expected a number above 0, got 0.0"),
        ({"inner": {"share": 3}}, "inner.share: expected 2.5 or less, got 3"),
        ({"inner": {"share": float("nan")}}, "inner.share: expected a finite number, got nan"),
        ({"inner": {"on": "maybe"}}, "inner.on: expected true or false, got 'maybe'"),
        ({"inner": {"cuont": 1}}, "inner.cuont: no such key (did you mean inner.count?); expected one of count, "),
        ({"name": 7}, "name: expected a text, got 7"),
        ({"name": "a"}, "name: expected at least 2 characters, got 'a'"),
        ({"name": "a" * 500}, f"name: expected at most 4 characters, got '{'a' * 79}..."),
        ({"kind": "tram"}, "kind: expected 'car' or 'bus', got 'tram'"),
        ({"pair": 1}, "pair: expected a list, got 1"),
        ({"pair": [1]}, "pair: expected at least 2 items, got [1]"),
        ({"table": []}, "table: expected keys and values, got []"),
    ],
)
def test_the_first_problem_tells_key_expected_and_got(value: Any, said: str) -> None:
    with pytest.raises(ValidationError) as caught:
        _Outer.model_validate(value)
    assert first_problem(caught.value, _Outer).startswith(said)
