"""Schema of a query in JSON: validate values with the keys of labelled command files, from any source."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, ValidationError

from appocc.errors import DataError
from appocc.jsonparts import JsonPart, first_problem
from grounding.query import (
    Anchor,
    Direction,
    DistanceRole,
    Exclusion,
    Landmark,
    LandmarkRole,
    Placement,
    Query,
    Referent,
    Side,
)
from grounding.vocabulary import COLOURS, Action, Relation, State, Trigger

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
    "own_side",
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
_MAX_ITEMS = 16


def choices(literal: Any) -> str:
    """Return the values of a Literal type, separated by commas."""
    return ", ".join(get_args(literal))


_Word = Annotated[str, Field(min_length=1, max_length=60)]
_Qualifiers = Annotated[list[Qualifier], Field(default_factory=list, max_length=_MAX_ITEMS)]
_Colour = Annotated[str, Field(pattern=rf"^(((dark|light) )?({'|'.join(COLOURS)})|dark|light)$")]


class _Referent(JsonPart):
    noun: Noun
    head: _Word
    colour: _Colour | None = None
    qualifiers: _Qualifiers
    qualifiers_optional: _Qualifiers
    number: Annotated[int, Field(ge=1, le=2)] = 1
    anaphora: bool = False
    extra: Annotated[list[_Word], Field(default_factory=list, max_length=_MAX_ITEMS)]
    clothes: _Colour | None = None


class _Landmark(JsonPart):
    noun: _Word
    relation: Relation | Placement
    of: LandmarkRole = "goal"
    colour: _Colour | None = None
    qualifiers: _Qualifiers


class _Exclusion(JsonPart):
    relation: Relation | Placement | None = None
    noun: _Word
    colour: _Colour | None = None
    qualifiers: _Qualifiers


class _Query(JsonPart):
    status: Literal["ok", "reject"]
    action: Action | None = None
    actions: Annotated[list[Action], Field(default_factory=list, max_length=_MAX_ITEMS)]
    direction: Direction | None = None
    goal_side: Side | None = None
    relation: Relation = "none"
    landmark: Anchor | None = None
    referent: _Referent | None = None
    secondary: Annotated[list[_Landmark], Field(default_factory=list, max_length=_MAX_ITEMS)]
    trigger: Trigger | None = None
    distance_m: Annotated[float, Field(ge=0, le=1000)] | None = None
    distance_of: DistanceRole | None = None
    excluded: Annotated[list[_Exclusion], Field(default_factory=list, max_length=_MAX_ITEMS)]
    count: Annotated[int, Field(ge=1, le=9)] | None = None


def query_from_json(command: str, value: Any) -> Query:
    """Build a query from decoded JSON, such as the answer of a language model.

    Args:
        command: the sentence.
        value: decoded JSON with the keys of `Query.to_dict`; empty values may be omitted.

    Raises:
        DataError: if a value is not valid in a labelled command file.
    """
    try:
        model = _Query.model_validate(value)
    except ValidationError as error:
        raise DataError(f"query: {first_problem(error)}") from error
    if (model.action is None) != (model.status == "reject"):
        raise DataError(f"query: expected an action unless rejected, got {model.action} and status '{model.status}'")
    return Query(
        command=command,
        action=model.action,
        actions=tuple(model.actions) or ((model.action,) if model.action else ()),
        relation=model.relation,
        landmark=model.landmark,
        referent=Referent(**_fields(model.referent)) if model.referent else None,
        secondary=tuple(Landmark(**_fields(one)) for one in model.secondary),
        direction=model.direction,
        goal_side=model.goal_side,
        trigger=model.trigger,
        distance_m=model.distance_m,
        distance_of=model.distance_of if model.distance_m is not None else None,
        excluded=tuple(Exclusion(**_fields(one)) for one in model.excluded),
        count=model.count,
    )


def _fields(part: JsonPart) -> dict[str, Any]:
    """Return the fields of a model with tuples instead of lists."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in part.model_dump().items()}
