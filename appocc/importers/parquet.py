"""Parquet files: small ones as numpy columns, large ones row by row, by pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from appocc.errors import DataError
from appocc.extras import import_extra
from appocc.importers.tables import Columns, numpy_columns

# Rows are decoded so many at a time; compressed pages are read through buffers of this size.
_BATCH_ROWS, _BUFFER_BYTES = 4, 1 << 20


def read_parquet(path: Path, columns: Sequence[str], optional: Sequence[str] = ()) -> Columns:
    """Return columns of a parquet file, and those of some optional ones that it has, NaN where unknown.

    Raises:
        AppoccError: if pyarrow is not installed.
        DataError: if the file is missing or damaged, a column is missing, or a number in one is not finite.
    """
    with Rows(path, columns) as rows:
        return numpy_columns(path, rows.table(optional), optional)


class Rows:
    """The rows of a parquet file by number, a few of which are in memory; rising numbers are cheapest."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Open a file.

        Raises:
            AppoccError: if pyarrow is not installed.
            DataError: if it is missing or no such file, or lacks a column.
        """
        parquet, arrow = (import_extra(f"pyarrow{name}", "arrow", "reading parquet") for name in (".parquet", ""))
        self._path, self._columns = path, list(columns)
        self._errors = (arrow.ArrowException, OSError, ValueError)
        if not path.is_file():
            raise DataError(f"{path}: expected a plain file, got none")
        try:
            self._file = parquet.ParquetFile(path, buffer_size=_BUFFER_BYTES, pre_buffer=False)
        except self._errors as error:
            raise self._damaged(error) from error
        known = {self._file.schema.column(i).path.split(".list.")[0] for i in range(len(self._file.schema))}
        if missing := [name for name in columns if name not in known]:
            self._file.close()
            raise DataError(f"{path}: expected a parquet file with {', '.join(columns)}; it lacks {missing[0]}")
        self._known = known
        sizes = [self._file.metadata.row_group(i).num_rows for i in range(self._file.num_row_groups)]
        self._starts = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        self._group, self._first, self._batch, self._batches = -1, 0, None, iter(())

    def __enter__(self) -> Self:
        """Return the open file."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self._file.close()

    def table(self, optional: Sequence[str]) -> Any:
        """Return the columns and those of some optional ones that the file has, as an arrow table.

        Raises:
            DataError: if the file is damaged.
        """
        columns = [*self._columns, *(name for name in optional if name in self._known)]
        try:
            return self._file.read(columns, use_threads=False)
        except self._errors as error:
            raise self._damaged(error) from error

    def bytes(self, row: int, column: str) -> bytes:
        """Return a value of bytes; empty if it is null.

        Raises:
            DataError: if the file is damaged.
        """
        return self._value(row, column).as_py() or b""

    def array(self, row: int, column: str) -> NDArray[np.float32] | None:
        """Return the array in the list columns `values` and `shape` of a column; None if they are null.

        Raises:
            DataError: if the file is damaged, or the values do not fit the shape.
        """
        values, shape = (self._value(row, f"{column}.{part}").values for part in ("values", "shape"))
        if values is None or shape is None:
            return None
        try:
            array = values.to_numpy(zero_copy_only=False).reshape(shape.to_pylist())
        except (ValueError, TypeError) as error:
            raise DataError(f"{self._path}: row {row}: {column}: {error}") from error
        return np.asarray(array, np.float32)

    def _value(self, row: int, column: str) -> Any:
        try:
            while self._batch is None or not self._first <= row < self._first + len(self._batch):
                self._advance(row)
            return self._batch.column(column)[row - self._first]
        except StopIteration:
            raise DataError(f"{self._path}: expected a row {row}, got the end of the file") from None
        except self._errors as error:
            self._group, self._batch = -1, None
            raise self._damaged(error) from error

    def _advance(self, row: int) -> None:
        """Decode the next few rows, or the first ones of another row group."""
        group = int(np.searchsorted(self._starts, row, "right")) - 1
        if group != self._group or row < self._first:
            self._batches = self._file.iter_batches(_BATCH_ROWS, [group], self._columns, use_threads=False)
            self._group, self._first, self._batch = group, int(self._starts[group]), None
        elif self._batch is not None:
            self._first += len(self._batch)
        self._batch = next(self._batches)

    def _damaged(self, error: BaseException) -> DataError:
        reason = (str(error).splitlines() or [repr(error)])[0][:200]
        return DataError(f"{self._path}: expected a parquet file with {', '.join(self._columns)} ({reason})")
