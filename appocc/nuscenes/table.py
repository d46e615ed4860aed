"""One table in memory: numpy columns, an index by token, and a reader that never holds the whole JSON text."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, IntArray
from appocc.errors import DataError, NotFoundError
from appocc.files import open_plain
from appocc.nuscenes.columns import Column, column, joined
from appocc.nuscenes.schema import Field

# Characters read at a time: larger pieces leave the processor's cache and are slower to parse.
_PIECE = 1 << 16
# Characters of a record, at most: a file without an end of one would fill the memory.
_LONGEST = 1 << 24
_BETWEEN = re.compile(r"\}\s*,\s*(?=\{)")


class Table:
    """A table: `name`, one column per field, rows counted from 0, found by token in O(log n).

    `cut` names the fields of times that had fractions of a microsecond, which are cut off.
    """

    def __init__(self, name: str, columns: dict[str, Column], cut: tuple[str, ...] = ()) -> None:
        """Take columns of equal length; `token` must be among them."""
        self.name = name
        self.columns = columns
        self.cut = cut

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.columns["token"])

    def __getitem__(self, field: str) -> Column:
        """A column."""
        return self.columns[field]

    def array(self, field: str) -> NDArray[Any]:
        """A column that is a numpy array (tokens, texts, numbers, vectors)."""
        return np.asarray(self.columns[field])

    def text(self, field: str, row: int) -> str:
        """A token or text of one row as str."""
        value = self.columns[field][row]
        return value.decode() if isinstance(value, bytes) else str(value)

    @cached_property
    def _by_token(self) -> tuple[IntArray, NDArray[np.bytes_]]:
        tokens = self.array("token")
        order = np.argsort(tokens, kind="stable")
        return order, tokens[order]

    def rows_of(self, tokens: NDArray[np.bytes_]) -> IntArray:
        """Row of each token, -1 where the table has none such."""
        order, ranked = self._by_token
        if not len(order):
            return np.full(len(tokens), -1)
        place = np.minimum(np.searchsorted(ranked, tokens), len(order) - 1)
        return np.where(ranked[place] == tokens, order[place], -1)

    def row(self, token: str) -> int:
        """Row of a token.

        Raises:
            NotFoundError: if the table has none such.
        """
        found = int(self.rows_of(np.array([token.encode(errors="replace")]))[0])
        if found < 0:
            raise NotFoundError(f"table {self.name} has no token '{token}'")
        return found

    def repeated(self) -> BoolArray:
        """(N,) whether an earlier row has the same token."""
        order, ranked = self._by_token
        again = np.zeros(len(order), dtype=np.bool_)
        again[order[1:]] = ranked[1:] == ranked[:-1]
        return again

    def groups(self, field: str) -> Groups:
        """Rows grouped by the value of a reference field."""
        return Groups(self.array(field))


class Groups:
    """Rows that share a value, found in O(log n); rows keep their order within a group."""

    def __init__(self, values: NDArray[Any]) -> None:
        """Sort once."""
        self._order = np.argsort(values, kind="stable")
        self._ranked = values[self._order]

    def rows(self, value: Any) -> IntArray:
        """The rows that hold `value` (maybe none)."""
        key = np.array([value.encode(errors="replace") if isinstance(value, str) else value])
        low, high = np.searchsorted(self._ranked, key, "left")[0], np.searchsorted(self._ranked, key, "right")[0]
        return self._order[low:high]


def at_rows(values: IntArray, rows: IntArray) -> IntArray:
    """Values at rows, -1 where the row is -1."""
    return np.where(rows >= 0, values[rows], -1) if len(values) else np.full(len(rows), -1)


def read_table(path: Path, fields: tuple[Field, ...]) -> Table:
    """Read a table file, a list of JSON objects, piece by piece: its text is never in memory as a whole.

    Raises:
        DataError: if the file is missing, no such list, or a record lacks a field or has one of a wrong type.
    """
    parts: dict[str, list[Column]] = {field.name: [] for field in fields}
    seen = 0
    with open_plain(path) as file, io.TextIOWrapper(file, "utf-8-sig", newline="") as handle:
        try:
            for records in _pieces(handle):
                for field in fields:
                    parts[field.name].append(column(field, records, seen))
                seen += len(records)
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror})") from error
        except DataError as error:
            raise DataError(f"{path}: {error}") from None
        except (ValueError, RecursionError) as error:
            reason = error.msg if isinstance(error, json.JSONDecodeError) else error
            raise DataError(f"{path}: no valid JSON list of records ({reason}, after record {seen})") from error
    columns = {field.name: joined(parts.pop(field.name)) for field in fields}
    times = {field.name: np.asarray(columns[field.name]) for field in fields if field.kind == "time"}
    cut = tuple(name for name, time in times.items() if time.dtype != np.int64)
    return Table(path.stem, columns | {name: times[name].astype(np.int64) for name in cut}, cut)


def _pieces(handle: TextIO) -> Iterator[list[Any]]:
    """The records of a JSON list, some at a time."""
    buffer = handle.read(_PIECE).lstrip()
    if buffer[:1] != "[":
        raise ValueError("it does not begin with '['" if buffer else "the file is empty")
    buffer = buffer[1:]
    while piece := handle.read(_PIECE):
        records, end = _whole_records(buffer)
        yield records
        buffer = buffer[end:] + piece
        if len(buffer) > _LONGEST:
            raise ValueError(f"a record is longer than {_LONGEST} characters")
    yield json.loads(f"[{buffer}")


def _whole_records(buffer: str) -> tuple[list[Any], int]:
    """The records that lie whole in the buffer, and where the next one begins.

    What looks like the end of a record may lie in a string or in a list of objects: then the parser runs out of text,
    and the place before it is tried. Any other complaint of the parser means a damaged file.
    """
    end = len(buffer)
    while (end := buffer.rfind("}", 0, end)) >= 0:
        between = _BETWEEN.match(buffer, end)
        if not between:
            continue
        text = f"[{buffer[: end + 1]}]"
        try:
            return json.loads(text), between.end()
        except json.JSONDecodeError as error:
            if error.pos < len(text) and not error.msg.startswith("Unterminated string"):
                raise
            end = min(end, error.pos)
    return [], 0


def empty_table(name: str, fields: tuple[Field, ...]) -> Table:
    """A table without rows."""
    return Table(name, {field.name: column(field, [], 0) for field in fields})
