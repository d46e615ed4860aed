"""Values from outside that pydantic checks: JSON, configurations, requests. Refusals are in this project's words."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict, ValidationError

from appocc.errors import shown

# What is expected, by the kind of pydantic's error; in braces, a value of its context.
_EXPECTED = {
    "missing": "a value",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "string_type": "a text",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "keys and values",
    "model_type": "keys and values",
    "model_attributes_type": "keys and values",
    "literal_error": "{expected}",
    "greater_than": "a number above {gt}",
    "greater_than_equal": "{ge} or more",
    "less_than": "a number below {lt}",
    "less_than_equal": "{le} or less",
    "string_too_long": "at most {max_length} characters",
    "string_too_short": "at least {min_length} characters",
    "too_long": "at most {max_length} items",
    "too_short": "at least {min_length} items",
}


class JsonPart(BaseModel):
    """Base model of JSON from other tools: strict types, finite numbers; fields that are not read are ignored."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)


def first_problem(error: ValidationError, model: type[BaseModel] | None = None) -> str:
    """Return the first problem of a validation error in one line: key, expected, got.

    Args:
        error: the error.
        model: what was validated, to name the keys that there are beside an unknown one.
    """
    first = error.errors()[0]
    keys = [str(part) for part in first["loc"]]
    context = {key: f"{v:g}" if isinstance(v, float) else v for key, v in first.get("ctx", {}).items()}
    if first["type"] == "extra_forbidden":
        problem = _unknown(keys, model)
    elif first["type"] == "value_error":  # of a validator of this project
        problem = str(context["error"])
    else:
        expected = _EXPECTED.get(first["type"], "another value").format_map(context)
        got = "nothing" if first["type"] == "missing" else shown(first["input"])
        problem = f"expected {expected}, got {got}"
    return ": ".join(filter(None, (".".join(keys), problem)))


def _unknown(keys: Sequence[str], model: type[BaseModel] | None) -> str:
    """Describe an unknown key, with the keys that there are beside it."""
    if model is None:
        return "no such key"
    for key in keys[:-1]:
        inner = model.model_fields[key].annotation
        assert isinstance(inner, type)
        model = inner
    near = difflib.get_close_matches(keys[-1], model.model_fields, n=1)
    guess = f" (did you mean {'.'.join([*keys[:-1], *near])}?)" if near else ""
    return f"no such key{guess}; expected one of {', '.join(model.model_fields)}"
