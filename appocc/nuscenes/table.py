"""Table in memory: numpy columns with an index by token, and a streaming JSON reader."""

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
from appocc.nuscenes.columns import Column, build_column, concatenated
from appocc.nuscenes.schema import FieldSpec

# Characters per read: larger pieces exceed the processor cache and parse more slowly.
_PIECE = 1 << 16
# Maximum characters per record: a file without an end of record would fill the memory.
_MAX_RECORD_CHARS = 1 << 24
_BETWEEN = re.compile(r"\}\s*,\s*(?=\{)")


class Table:
    """A table with one column per field; rows are counted from 0 and found by token in O(log n).

    `cut` names the time fields whose fractions of a microsecond were truncated.
    """

    def __init__(self, name: str, columns: dict[str, Column], cut: tuple[str, ...] = ()) -> None:
        """Build a table from columns of equal length, with the column `token`."""
        self.name = name
        self.columns = columns
        self.cut = cut

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.columns["token"])

    def __getitem__(self, field: str) -> Column:
        """Return a column."""
        return self.columns[field]

    def array(self, field: str) -> NDArray[Any]:
        """Return a column of tokens, texts, numbers or vectors as numpy array."""
        return np.asarray(self.columns[field])

    def text(self, field: str, row: int) -> str:
        """Return a token or text of one row as str."""
        value = self.columns[field][row]
        return value.decode() if isinstance(value, bytes) else str(value)

    @cached_property
    def _by_token(self) -> tuple[IntArray, NDArray[np.bytes_]]:
        tokens = self.array("token")
        order = np.argsort(tokens, kind="stable")
        return order, tokens[order]

    def rows_of(self, tokens: NDArray[np.bytes_]) -> IntArray:
        """Return the row of each token, -1 for unknown tokens."""
        order, ranked = self._by_token
        if not len(order):
            return np.full(len(tokens), -1)
        position = np.minimum(np.searchsorted(ranked, tokens), len(order) - 1)
        return np.where(ranked[position] == tokens, order[position], -1)

    def row(self, token: str) -> int:
        """Return the row of a token.

        Raises:
            NotFoundError: if the table has no such token.
        """
        found = int(self.rows_of(np.array([token.encode(errors="replace")]))[0])
        if found < 0:
            raise NotFoundError(f"table {self.name} has no token '{token}'")
        return found

    def repeated(self) -> BoolArray:
        """Return (N,) whether an earlier row has the same token."""
        order, ranked = self._by_token
        again = np.zeros(len(order), dtype=np.bool_)
        again[order[1:]] = ranked[1:] == ranked[:-1]
        return again

    def groups(self, field: str) -> RowGroups:
        """Group the rows by the value of a reference field."""
        return RowGroups(self.array(field))


class RowGroups:
    """Rows grouped by value, found in O(log n); rows keep their order within a group."""

    def __init__(self, values: NDArray[Any]) -> None:
        """Sort the rows by value."""
        self._order = np.argsort(values, kind="stable")
        self._ranked = values[self._order]

    def rows(self, value: Any) -> IntArray:
        """Return the rows with a value; may be empty."""
        key = np.array([value.encode(errors="replace") if isinstance(value, str) else value])
        low, high = np.searchsorted(self._ranked, key, "left")[0], np.searchsorted(self._ranked, key, "right")[0]
        return self._order[low:high]


def take_rows(values: IntArray, rows: IntArray) -> IntArray:
    """Return the values at rows, -1 where the row is -1."""
    return np.where(rows >= 0, values[rows], -1) if len(values) else np.full(len(rows), -1)


def read_table(path: Path, fields: tuple[FieldSpec, ...]) -> Table:
    """Read a table file, a JSON list of objects, as a stream.

    Raises:
        DataError: if the file is missing or no such list, or a field of a record is missing or of a wrong type.
    """
    parts: dict[str, list[Column]] = {field.name: [] for field in fields}
    seen = 0
    with open_plain(path) as file, io.TextIOWrapper(file, "utf-8-sig", newline="") as handle:
        try:
            for records in _pieces(handle):
                for field in fields:
                    parts[field.name].append(build_column(field, records, seen))
                seen += len(records)
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror})") from error
        except DataError as error:
            raise DataError(f"{path}: {error}") from None
        except (ValueError, RecursionError) as error:
            reason = error.msg if isinstance(error, json.JSONDecodeError) else error
            raise DataError(f"{path}: no valid JSON list of records ({reason}, after record {seen})") from error
    columns = {field.name: concatenated(parts.pop(field.name)) for field in fields}
    times = {field.name: np.asarray(columns[field.name]) for field in fields if field.kind == "time"}
    cut = tuple(name for name, time in times.items() if time.dtype != np.int64)
    return Table(path.stem, columns | {name: times[name].astype(np.int64) for name in cut}, cut)


def _pieces(handle: TextIO) -> Iterator[list[Any]]:
    """Yield the records of a JSON list in batches."""
    buffer = handle.read(_PIECE).lstrip()
    if buffer[:1] != "[":
        raise ValueError("it does not begin with '['" if buffer else "the file is empty")
    buffer = buffer[1:]
    while piece := handle.read(_PIECE):
        records, end = _whole_records(buffer)
        yield records
        buffer = buffer[end:] + piece
        if len(buffer) > _MAX_RECORD_CHARS:
            raise ValueError(f"a record is longer than {_MAX_RECORD_CHARS} characters")
    yield json.loads(f"[{buffer}")


def _whole_records(buffer: str) -> tuple[list[Any], int]:
    """Return the complete records in the buffer and the position of the next record.

    An apparent end of a record may be inside a string or a list of objects: then the parser reaches the end of the
    text, and the previous candidate is tried. Any other parser error means a damaged file.
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


def empty_table(name: str, fields: tuple[FieldSpec, ...]) -> Table:
    """Return a table without rows."""
    return Table(name, {field.name: build_column(field, [], 0) for field in fields})
