"""Validation of JSON from other tools: fields that are read are checked, other fields are ignored."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, ValidationError


class JsonPart(BaseModel):
    """Base model with strict types and finite numbers; other fields are ignored."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)


def first_problem(error: ValidationError) -> str:
    """Return the first problem of a validation error and its location, in one line."""
    first = error.errors()[0]
    place = ".".join(map(str, first["loc"]))
    if first["type"] == "missing":
        return f"there is no {place}"
    wanted = first["msg"].replace("Input should be", "expected").partition(" or instance of ")[0]
    return f"{place}: {wanted}, got {str(first['input'])[:40]!r}".removeprefix(": ")
