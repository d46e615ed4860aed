"""Checks of configurations: dataclasses of numbers, with a default for each field."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from numbers import Real
from typing import Any

from appocc.errors import ShapeError


def check_config(config: Any) -> None:
    """Check the fields of a configuration, also of those inside it, by their defaults and names.

    A number may be infinite and not NaN. Only log-odds and thresholds of them may be negative; chances and rates are
    0..1.

    Raises:
        ShapeError: if the type or the value of a field is wrong.
    """
    for each in fields(config):
        _check_value(f"{type(config).__name__}.{each.name}", getattr(config, each.name), _default(each))


def _default(each: Field[Any]) -> Any:
    return each.default if each.default_factory is MISSING else each.default_factory()


def _check_value(name: str, value: Any, default: Any) -> None:
    if is_dataclass(default):
        _check_type(name, value, type(default))
        check_config(value)
    elif isinstance(default, Mapping):
        _check_type(name, value, Mapping)
        for key, one in value.items():
            _check_value(f"{name}[{key!r}]", one, next(iter(default.values())))
    elif isinstance(default, tuple):
        _check_type(name, value, tuple)
        for one in value:
            _check_number(name, one)
    elif isinstance(default, bool):
        _check_type(name, value, bool)
    elif isinstance(default, int):
        _check_type(name, value, int)
        _check_number(name, value)
    else:
        _check_number(name, value)


def _check_type(name: str, value: Any, wanted: type) -> None:
    if not isinstance(value, wanted):
        raise ShapeError(f"{name}: expected {wanted.__name__}, got {value!r}")


def _check_number(name: str, value: Any) -> None:
    low = -math.inf if "log_odds" in name or "threshold" in name else 0.0
    high = 1.0 if name.endswith(("_chance", "_rate")) else math.inf
    if not isinstance(value, Real) or isinstance(value, bool) or not low <= float(value) <= high:
        raise ShapeError(f"{name}: expected a number from {low:g} to {high:g}, got {value!r}")
