"""Columns of a table: conversion of JSON values to one numpy array or list per field."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import FloatArray, check_intrinsic
from appocc.errors import DataError
from appocc.nuscenes.schema import FieldSpec

Column = NDArray[Any] | list[Any]
# A longer text would widen all rows of its column.
_MAX_TEXT_BYTES = 1024
# float64 represents whole numbers up to here exactly: microseconds until the year 2255.
_LARGEST_EXACT = 2**53
_NUMBER: set[type] = {int, float}
_MISFITS = (KeyError, TypeError, ValueError, OverflowError, AttributeError)


def build_column(field: FieldSpec, records: list[Any], first_row: int) -> Column:
    """Convert one field of some records; the first record is row `first_row` of its table.

    Raises:
        DataError: if the field of a record is missing or invalid; the error names the record.
    """
    try:
        if field.required:
            return _packed(field, [record[field.name] for record in records])
        return _packed(field, [record.get(field.name) for record in records])
    except _MISFITS:
        found = ((row, _error_in(field, record)) for row, record in enumerate(records, start=first_row))
        row, complaint = next((row, complaint) for row, complaint in found if complaint)
        raise DataError(f"record {row}{complaint}") from None


def _packed(field: FieldSpec, values: list[Any]) -> Column:
    """Convert the values of one field to a column of its kind."""
    return _PACK[field.kind](field, values)


def _pack_text(field: FieldSpec, values: list[Any]) -> Column:
    if field.kind == "token" or not field.required:
        values = ["" if value is None else value for value in values]
    texts = np.array([value.encode() for value in values], dtype=np.bytes_)
    if texts.itemsize > _MAX_TEXT_BYTES:
        raise ValueError
    return texts


def _pack_vector(field: FieldSpec, values: list[Any]) -> Column:
    _check_types(chain.from_iterable(values), _NUMBER | {type(None)})
    vectors = np.array(values, dtype=np.float64)
    if values and vectors.shape != (len(values), field.width):
        raise ValueError
    return vectors.reshape(-1, field.width)


def _pack_int(field: FieldSpec, values: list[Any]) -> Column:
    numbers = _pack_time(field, values)
    whole = numbers.astype(np.int64)
    if (whole != numbers).any():
        raise ValueError
    return whole


def _pack_time(field: FieldSpec, values: list[Any]) -> NDArray[Any]:
    """Return int64, or float64 if a number has a fraction."""
    known = values if field.required else [field.unknown if value is None else value for value in values]
    _check_types(known, _NUMBER)
    numbers = np.array(known, dtype=np.float64)
    if numbers.ndim != 1 or not (np.abs(numbers) < _LARGEST_EXACT).all():
        raise ValueError
    whole = numbers.astype(np.int64)
    return numbers if (whole != numbers).any() else whole


def _check_types(values: Iterable[Any], allowed: set[type]) -> None:
    """Check the types of JSON values: numpy would convert true to 1 and "5" to 5."""
    if not set(map(type, values)) <= allowed:
        raise TypeError


def _pack_bool(field: FieldSpec, values: list[Any]) -> Column:
    if not all(isinstance(value, bool) for value in values):
        raise TypeError
    return np.array(values, dtype=np.bool_)


def _pack_names(field: FieldSpec, values: list[Any]) -> Column:
    if field.required and not all(values):
        raise ValueError
    names = [sys.intern("" if value is None else value) for value in values]
    if field.choices and not set(names) <= set(field.choices):
        raise ValueError
    return names


def _pack_tokens(field: FieldSpec, values: list[Any]) -> Column:
    if not all(isinstance(value, list) for value in values if value is not None):
        raise TypeError
    return [tuple(map(sys.intern, value or ())) for value in values]


_PACK: dict[str, Callable[[FieldSpec, list[Any]], Column]] = {
    "token": _pack_text,
    "text": _pack_text,
    "vector": _pack_vector,
    "int": _pack_int,
    "time": _pack_time,
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
    "time": "microseconds",
    "bool": "true or false",
}


def _error_in(field: FieldSpec, record: Any) -> str:
    """Return what is wrong with the field of one record, '' if it is valid."""
    if not isinstance(record, dict):
        return f": expected an object, got {type(record).__name__}"
    name = f" ({record.get('token', '?')})"
    if field.required and field.name not in record:
        return f"{name} has no field '{field.name}'"
    try:
        _packed(field, [record.get(field.name)])
    except _MISFITS:
        wanted = f"{field.width} numbers" if field.kind == "vector" else _WANTED[field.kind]
        wanted += " that is not empty" if field.kind == "name" and field.required else ""
        wanted = " or ".join(filter(None, field.choices)) or wanted
        return f"{name}: {field.name}: expected {wanted}, got {json.dumps(record[field.name])[:60]}"
    return ""


def concatenated(parts: list[Column]) -> Column:
    """Concatenate the parts of a column."""
    if isinstance(parts[0], list):
        return [value for part in parts for value in part]
    return np.concatenate([np.asarray(part) for part in parts])


def only_numbers(value: Any) -> bool:
    """Whether a JSON value is a number or a nested list of numbers; true and "5" are not numbers."""
    return all(map(only_numbers, value)) if isinstance(value, list) else type(value) in _NUMBER


def intrinsic_of(value: Any) -> FloatArray:
    """Return the (3, 3) matrix of the field `camera_intrinsic`.

    Raises:
        TypeError: if it holds other values than numbers.
        ValueError: if it is not the matrix of a pinhole camera.
    """
    if not only_numbers(value):
        raise TypeError(f"expected numbers, got {str(value)[:80]}")
    matrix = np.array(value, dtype=np.float64)
    check_intrinsic("camera_intrinsic", matrix)
    return matrix
