"""Text tables: rows, columns and numbers; errors name the file and the line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from appocc.checks import FARTHEST_M
from appocc.errors import DataError
from appocc.files import MOST_TEXT_BYTES, read_file

_MAX_QUOTED = 40


def read_rows(path: Path, separator: str | None = None, least: int = 1) -> Iterator[tuple[str, list[str]]]:
    """Yield the non-empty lines of a file: their location for error messages, and their columns.

    Args:
        path: path of the file.
        separator: separator of columns; None for whitespace.
        least: minimum number of columns.

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


def parse_numbers(place: str, columns: Sequence[str]) -> list[float]:
    """Parse the numbers of columns, up to FARTHEST_M, the largest plausible measure.

    Raises:
        DataError: if one is not a number, not finite, or larger.
    """
    result = []
    for column in columns:
        try:
            number = float(column)
        except ValueError as error:
            raise DataError(f"{place}: expected numbers, got {column.strip()[:_MAX_QUOTED]!r}") from error
        if not abs(number) <= FARTHEST_M:
            raise DataError(f"{place}: expected finite numbers up to {FARTHEST_M:.0e}, got {number:g}")
        result.append(number)
    return result


def parse_integer(place: str, name: str, number: float, least: int | None = None) -> int:
    """Return a number as an integer, not below `least`.

    Raises:
        DataError: if it has a fraction or is less.
    """
    if number != int(number) or (least is not None and number < least):
        wanted = "" if least is None else f" from {least}"
        raise DataError(f"{place}: expected a whole number{wanted} for {name}, got {number:g}")
    return int(number)
