"""Parts of JSON values that others may have written: what is read of them is checked, the rest is let through."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, ValidationError


class JsonPart(BaseModel):
    """Numbers are numbers and finite, texts are texts; names that are not asked for may be there."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)


def first_problem(error: ValidationError) -> str:
    """The first thing that is wrong, and where, in a line."""
    first = error.errors()[0]
    place = ".".join(map(str, first["loc"]))
    if first["type"] == "missing":
        return f"there is no {place}"
    wanted = first["msg"].replace("Input should be", "expected").partition(" or instance of ")[0]
    return f"{place}: {wanted}, got {str(first['input'])[:40]!r}".removeprefix(": ")
