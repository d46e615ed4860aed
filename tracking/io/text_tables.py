"""Text files of rows: their lines, columns and numbers; every error names the file and the line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from appocc.checks import FARTHEST_M
from appocc.errors import DataError
from appocc.files import MOST_TEXT_BYTES, read_file

_MOST_TOLD = 40


def lines(path: Path, separator: str | None = None, least: int = 1) -> Iterator[tuple[str, list[str]]]:
    """The lines of a file that are not empty: what to call them in an error, and their columns.

    Args:
        path: the file.
        separator: what stands between columns; None for blanks.
        least: number of columns that each line must have; it may have more.

    Raises:
        DataError: if the file cannot be read or a line has fewer columns.
    """
    text = read_file(path, MOST_TEXT_BYTES).decode(errors="replace")
    for number, line in enumerate(text.split("\n"), start=1):
        if not line.strip():
            continue
        place, columns = f"{path}: line {number}", line.split(separator)
        if len(columns) < least:
            raise DataError(f"{place}: expected at least {least} columns, got {len(columns)}")
        yield place, columns


def numbers(place: str, columns: Sequence[str]) -> list[float]:
    """The numbers of columns; no measure of a street or a picture is above FARTHEST_M.

    Raises:
        DataError: if one is no number, not finite, or larger.
    """
    result = []
    for column in columns:
        try:
            number = float(column)
        except ValueError as error:
            raise DataError(f"{place}: expected numbers, got {column.strip()[:_MOST_TOLD]!r}") from error
        if not abs(number) <= FARTHEST_M:
            raise DataError(f"{place}: expected finite numbers up to {FARTHEST_M:.0e}, got {number:g}")
        result.append(number)
    return result


def whole(place: str, name: str, number: float, least: int | None = None) -> int:
    """A whole number, not below the least.

    Raises:
        DataError: if it has a fraction or is less.
    """
    if number != int(number) or (least is not None and number < least):
        wanted = "" if least is None else f" from {least}"
        raise DataError(f"{place}: expected a whole number{wanted} for {name}, got {number:g}")
    return int(number)
