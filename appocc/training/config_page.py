"""The page of all keys of a training configuration, docs/configuration.md.

`python -m appocc.training.config_page > docs/configuration.md` writes it.
"""

from __future__ import annotations

import re
import typing
from inspect import cleandoc
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from appocc.training.config import Config

_INTRODUCTION = """\
# Configuration of a training

Every key of `appocc train CONFIG [KEY=VALUE ...]`. CONFIG is a YAML file, or the name of a shipped one: `small`,
`release`, `recording`. A KEY=VALUE on the command line replaces a value of the file, such as `train.lr=1e-3` or
`data.train='[A, B]'`; `null` is no value. An unknown key or a value out of its range is an error before any data is
read. Lists of three numbers are for road, vehicle, lane. This page is written by
`python -m appocc.training.config_page`.
"""
_NAMES = {int: "integer", float: "number", str: "text", bool: "true or false", NoneType: "null"}
# Words for the bounds of pydantic's constraints.
_BOUNDS = {"ge": "from", "gt": "above", "le": "to", "lt": "below"}


def configuration_page() -> str:
    """Return the page as Markdown, a table for each section of the configuration."""
    sections: list[tuple[str, type[BaseModel]]] = [("", Config), *_parts(Config)]
    return "\n".join([_INTRODUCTION, *(_section(name, part) for name, part in sections)])


def _parts(model: type[BaseModel]) -> list[tuple[str, type[BaseModel]]]:
    """Return the fields of a model that are sections themselves."""
    kinds = ((name, field.annotation) for name, field in model.model_fields.items())
    return [(name, kind) for name, kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)]


def _section(name: str, model: type[BaseModel]) -> str:
    meanings = attribute_docs(model)
    inner = dict(_parts(model))
    rows = [
        f"| `{name + '.' if name else ''}{key}` | {_values(field)} | {_default(field)} | {meanings[key]} |"
        for key, field in model.model_fields.items()
        if key not in inner
    ]
    title = cleandoc(model.__doc__ or "").splitlines()[0].rstrip(".").partition(";")[0] if name else "The network"
    heading = f"## {title}\n\n| key | values | default | meaning |\n|---|---|---|---|\n"
    return heading + "\n".join(rows) + "\n"


def attribute_docs(model: type[BaseModel]) -> dict[str, str]:
    """Return the description of each attribute in the docstring of a class."""
    text = cleandoc(model.__doc__ or "").split("Attributes:\n", 1)[1]
    entries = re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", text, flags=re.MULTILINE)
    return {name: " ".join(words.split()).replace("None:", "null:") for name, words in entries}


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "needed"
    value = field.default
    if isinstance(value, tuple):
        return f"`[{', '.join(map(str, value))}]`"
    return f"`{'null' if value is None else str(value).lower() if isinstance(value, bool) else value}`"


def _values(field: FieldInfo) -> str:
    """Return the values of a field in words, with its range."""
    text = _kind(field.annotation)
    limits = [_limit(each) for each in field.metadata]
    return " ".join([text, *filter(None, limits)])


def _kind(annotation: Any) -> str:
    """Return a type in words."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is typing.Annotated:
        return " ".join([_kind(arguments[0]), *filter(None, map(_limit, arguments[1:]))])
    if origin is Literal:
        return ", ".join(f"`{value}`" for value in arguments)
    if origin is tuple:
        return f"list of {_kind(arguments[0])}" if Ellipsis in arguments else f"{len(arguments)} numbers"
    if origin in (UnionType, typing.Union):
        return " or ".join(map(_kind, arguments))
    return _NAMES[annotation]


def _limit(constraint: Any) -> str:
    """Return the bounds of a constraint in words."""
    if isinstance(constraint, FieldInfo):
        return " ".join(filter(None, map(_limit, constraint.metadata)))
    for name, word in _BOUNDS.items():
        value = getattr(constraint, name, None)
        if value is not None:
            return f"{word} {value:,}" if value != 2**31 else f"{word} 2^31"
    return ""


if __name__ == "__main__":
    print(configuration_page(), end="")
