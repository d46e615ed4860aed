"""A query from JSON of anybody's making, checked value by value: the layout of labelled command files."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, ValidationError

from appocc.errors import DataError
from appocc.jsonparts import JsonPart, first_problem
from grounding.query import Exclusion, Landmark, Query, Referent
from grounding.vocabulary import COLOURS, Action, Relation, State

# What a further thing may stand in besides.
Placing = Literal["in", "into", "on", "until", "around"]
Noun = Literal[
    "car",
    "van",
    "truck",
    "bus",
    "trailer",
    "motorcycle",
    "bicycle",
    "construction_vehicle",
    "vehicle",
    "person",
]
Qualifier = Literal[
    "first",
    "second",
    "third",
    "fourth",
    "next",
    "last",
    "nearest",
    "farthest",
    "leftmost",
    "rightmost",
    "largest",
    "smallest",
    "left_side",
    "right_side",
    "opposite_side",
    "own_lane",
    "left_lane",
    "right_lane",
    "other_lane",
    "middle_lane",
    "ahead",
    "behind_ego",
    State,
    "large",
    "small",
]
_MOST = 16


def choices(kind: Any) -> str:
    """The values of one of the kinds above, for people."""
    return ", ".join(get_args(kind))


_Word = Annotated[str, Field(min_length=1, max_length=60)]
_Qualifiers = Annotated[list[Qualifier], Field(default_factory=list, max_length=_MOST)]
_Colour = Annotated[str, Field(pattern=rf"^(((dark|light) )?({'|'.join(COLOURS)})|dark|light)$")]


class _Referent(JsonPart):
    noun: Noun
    head: _Word
    colour: _Colour | None = None
    qualifiers: _Qualifiers
    qualifiers_optional: _Qualifiers
    number: Annotated[int, Field(ge=1, le=2)] = 1
    anaphora: bool = False
    extra: Annotated[list[_Word], Field(default_factory=list, max_length=_MOST)]


class _Landmark(JsonPart):
    noun: _Word
    relation: Relation | Placing
    of: Literal["goal", "referent", "inverse"] = "goal"
    colour: _Colour | None = None
    qualifiers: _Qualifiers


class _Exclusion(JsonPart):
    relation: Relation | Placing | None = None
    noun: _Word
    colour: _Colour | None = None
    qualifiers: _Qualifiers


class _Query(JsonPart):
    status: Literal["ok", "reject"]
    action: Action | None = None
    actions: Annotated[list[Action], Field(default_factory=list, max_length=_MOST)]
    direction: Literal["left", "right", "around", "straight"] | None = None
    goal_side: Literal["left", "right"] | None = None
    relation: Relation = "none"
    landmark: Literal["referent", "secondary"] | None = None
    referent: _Referent | None = None
    secondary: Annotated[list[_Landmark], Field(default_factory=list, max_length=_MOST)]
    trigger: Literal["pass", "leave", "turn", "stop", "merge", "clear", "other"] | None = None
    distance_m: Annotated[float, Field(ge=0, le=1000)] | None = None
    distance_of: Literal["referent", "ego", "descriptor"] | None = None
    excluded: Annotated[list[_Exclusion], Field(default_factory=list, max_length=_MOST)]


def query_of(command: str, value: Any) -> Query:
    """The query of a command as somebody else read it.

    Args:
        command: the sentence.
        value: decoded JSON with the keys of `Query.to_dict`; what is empty may be left out.

    Raises:
        DataError: if a value is none of those that the labelled files know.
    """
    try:
        read = _Query.model_validate(value)
    except ValidationError as error:
        raise DataError(f"query: {first_problem(error)}") from error
    if (read.action is None) != (read.status == "reject"):
        raise DataError(f"query: expected an action unless rejected, got {read.action} and status '{read.status}'")
    named = read.referent
    return Query(
        command,
        read.action,
        tuple(read.actions) or ((read.action,) if read.action else ()),
        read.relation,
        read.landmark,
        Referent(**_frozen(named)) if named else None,
        tuple(Landmark(**_frozen(one)) for one in read.secondary),
        read.direction,
        read.goal_side,
        read.trigger,
        read.distance_m,
        read.distance_of if read.distance_m is not None else None,
        tuple(Exclusion(**_frozen(one)) for one in read.excluded),
    )


def _frozen(part: JsonPart) -> dict[str, Any]:
    """The values of a part, lists as tuples."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in part.model_dump().items()}
