"""Times in the names of files and in tables: seconds, or whole numbers in a unit that their size tells."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from pathlib import Path

from appocc.errors import DataError

# Times since 1970, from 1973 to 5138, in each unit.
_UNITS = ((10**17, 10**20, Decimal("0.001")), (10**14, 10**17, Decimal(1)), (10**11, 10**14, Decimal(1000)))
_WRITTEN = "in seconds or of ISO 8601, such as 1700000000.25 or 2023-11-14T22:13:20.25Z"
_SECONDS = (10**8, 10**11)
_NUMBER = re.compile(r"(?<!\d)(\d{1,19}(?:\.\d{1,12})?)$")


def microseconds(number: str) -> int | None:
    """Return a time in microseconds; None for a small whole number, which counts frames.

    A number with a decimal point is seconds. A whole number is a time since 1970 in nanoseconds, microseconds,
    milliseconds or seconds, by its size.

    Raises:
        ValueError: if the text is no number.
    """
    if not re.fullmatch(r"[-+]?\d{1,20}(\.\d*)?([eE][-+]?\d{1,2})?", number):
        raise ValueError(f"expected a time {_WRITTEN}, got '{number}'")
    value = Decimal(number)
    whole = "." not in number and "e" not in number.lower()
    for least, end, factor in _UNITS:
        if least <= abs(value) < end:
            return round(value * factor)
    if whole and not _SECONDS[0] <= abs(value) < _SECONDS[1]:
        return None
    return round(value * 1_000_000)


def seconds_to_us(number: str) -> int:
    """Return a time of a table in microseconds; small whole numbers are seconds. Dates without a zone are UTC.

    Raises:
        ValueError: if the text is neither a number nor a date and time of ISO 8601.
    """
    if ":" in number:
        return _date_to_us(number)
    time_us = microseconds(number)
    return int(number) * 1_000_000 if time_us is None else time_us


def _date_to_us(text: str) -> int:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(f"expected a time {_WRITTEN}, got '{text}'") from error
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return (moment - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1)


def time_in_name(path: Path, fps: float | None, start_us: int = 0) -> int:
    """Return the time in microseconds that a name ends with.

    Args:
        path: the name, without ending: `1700000000.25`, `CAM_FRONT_1700000000250000` or `000123`.
        fps: rate of pictures whose names count frames.
        start_us: time of frame 0, if names count frames.

    Raises:
        DataError: if there is no number, or it counts frames and no rate is given.
    """
    found = _NUMBER.search(path.name)
    if found is None:
        raise DataError(f"{path}: expected a time or a frame number at the end of the name, got none")
    time_us = microseconds(found[1])
    if time_us is not None:
        return time_us
    if fps is None:
        raise DataError(f"{path}: expected a time in the name, got a frame number; name the rate of frames (--fps)")
    return start_us + round(int(found[1]) * 1e6 / fps)


def seconds_text(time_us: int) -> str:
    """Return a time for people, in seconds."""
    return f"{time_us / 1e6:.2f} s"
