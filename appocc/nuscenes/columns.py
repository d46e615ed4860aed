"""From JSON values to columns: one numpy array or list for each field of a table."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.errors import DataError
from appocc.nuscenes.schema import Field

Column = NDArray[Any] | list[Any]
# One longer text would widen all rows of its column.
_LONGEST = 1024
_MISFITS = (KeyError, TypeError, ValueError, OverflowError, AttributeError)


def column(field: Field, records: list[Any], first_row: int) -> Column:
    """One field of some records, the first of which is number `first_row` of its table.

    Raises:
        DataError: if a record lacks the field or has a wrong one; it names the record.
    """
    try:
        if field.required:
            return _packed(field, [record[field.name] for record in records])
        return _packed(field, [record.get(field.name) for record in records])
    except _MISFITS:
        found = ((row, _complaint(field, record)) for row, record in enumerate(records, start=first_row))
        row, complaint = next((row, complaint) for row, complaint in found if complaint)
        raise DataError(f"record {row}{complaint}") from None


def _packed(field: Field, values: list[Any]) -> Column:
    """Values of one field as a column of the field's kind."""
    return _PACK[field.kind](field, values)


def _pack_text(field: Field, values: list[Any]) -> Column:
    texts = np.array([("" if value is None else value).encode() for value in values], dtype=np.bytes_)
    if texts.itemsize > _LONGEST:
        raise ValueError
    return texts


def _pack_vector(field: Field, values: list[Any]) -> Column:
    vectors = np.array(values, dtype=np.float64)
    if values and vectors.shape != (len(values), field.width):
        raise ValueError
    return vectors.reshape(-1, field.width)


def _pack_int(field: Field, values: list[Any]) -> Column:
    numbers = np.array([field.unknown if value is None else value for value in values], dtype=np.int64)
    if numbers.ndim != 1:
        raise ValueError
    return numbers


def _pack_bool(field: Field, values: list[Any]) -> Column:
    if not all(isinstance(value, bool) for value in values):
        raise TypeError
    return np.array(values, dtype=np.bool_)


def _pack_names(field: Field, values: list[Any]) -> Column:
    return [sys.intern("" if value is None else value) for value in values]


def _pack_tokens(field: Field, values: list[Any]) -> Column:
    if not all(isinstance(value, list) for value in values if value is not None):
        raise TypeError
    return [tuple(map(sys.intern, value or ())) for value in values]


_PACK: dict[str, Callable[[Field, list[Any]], Column]] = {
    "token": _pack_text,
    "text": _pack_text,
    "vector": _pack_vector,
    "int": _pack_int,
    "bool": _pack_bool,
    "name": _pack_names,
    "tokens": _pack_tokens,
    "any": lambda field, values: values,
}
_WANTED = {
    "token": "a short text",
    "text": "a short text",
    "name": "a text",
    "tokens": "a list of tokens",
    "int": "a whole number",
    "bool": "true or false",
}


def _complaint(field: Field, record: Any) -> str:
    """What is wrong with one record's field, '' if nothing is."""
    if not isinstance(record, dict):
        return f": expected an object, got {type(record).__name__}"
    name = f" ({record.get('token', '?')})"
    if field.required and field.name not in record:
        return f"{name} has no field '{field.name}'"
    try:
        _packed(field, [record.get(field.name)])
    except _MISFITS:
        wanted = f"{field.width} numbers" if field.kind == "vector" else _WANTED[field.kind]
        return f"{name}: {field.name}: expected {wanted}, got {json.dumps(record[field.name])[:60]}"
    return ""


def joined(parts: list[Column]) -> Column:
    """The pieces of a column as one."""
    if isinstance(parts[0], list):
        return [value for part in parts for value in part]
    return np.concatenate([np.asarray(part) for part in parts])
