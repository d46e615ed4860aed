"""Values of a rig file or a calibration file: every refusal names the key, what is expected, and an example."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError, shown
from appocc.typing import PathLike

# Powers of larger numbers overflow; no calibration has any.
_LARGEST = 1e12


class Fields:
    """The values of a YAML mapping, by key.

    Attributes:
        where: file and keys that lead to the mapping, for messages.
        keys: its keys, in the order of the file.
    """

    def __init__(
        self, values: Any, file: PathLike, at: str = "", known: Collection[str] = (), example: str = ""
    ) -> None:
        """Check that a value is a mapping, and has none but the known keys, if there are any.

        Args:
            values: the parsed value.
            file: the file, for messages.
            at: keys that lead to the value, joined by points.
            known: all keys that there may be; none if any key may be.
            example: for the message if the value is no mapping.

        Raises:
            DataError: if it is none, or has another key.
        """
        self._file, self._at = file, at
        self.where = f"{file}: {at or 'the file'}"
        if not isinstance(values, dict) or not values:
            raise DataError(f"{self.where}: expected keys and values{_such_as(example)}, got {shown(values)}")
        self._values: dict[Any, Any] = values
        self.keys = list(values)
        unknown = [key for key in values if known and key not in known]
        if unknown:
            raise DataError(f"{self.where}: expected the keys {', '.join(known)}, got {shown(unknown[0])}")

    def name(self, key: object) -> str:
        """Return the file and the path of a key, for messages."""
        return f"{self._file}: {self._at}.{key}" if self._at else f"{self._file}: {key}"

    def inside(self, key: str | int, known: Collection[str] = (), example: str = "") -> Fields:
        """Return the mapping of a key.

        Raises:
            DataError: if it is none.
        """
        return Fields(self[key], self._file, f"{self._at}.{key}" if self._at else str(key), known, example)

    def having(self, **more: Any) -> Fields:
        """Return the same mapping with some values added or replaced."""
        return Fields({**self._values, **more}, self._file, self._at)

    def __contains__(self, key: object) -> bool:
        """Whether there is a value of this key; an empty one is none."""
        return self._values.get(key) is not None

    def __getitem__(self, key: Any) -> Any:
        """Return a value as it is, None if there is none."""
        return self._values.get(key)

    def refusal(self, key: str, expected: str, example: str = "") -> DataError:
        """Return the error that refuses the value of a key."""
        got = shown(self._values[key]) if key in self._values else "nothing"
        return DataError(f"{self.name(key)}: expected {expected}{_such_as(example)}, got {got}")

    def one_of(self, *keys: str, example: str) -> str:
        """Return the one key of several that has a value.

        Raises:
            DataError: if none or several have one.
        """
        found = [key for key in keys if key in self]
        if len(found) != 1:
            wanted = f"{', '.join(keys[:-1])} or {keys[-1]}" if len(keys) > 1 else keys[0]
            got = " and ".join(found) or "none"
            raise DataError(f"{self.where}: expected either {wanted}{_such_as(example)}, got {got}")
        return found[0]

    def text(self, key: str, options: Sequence[str] = (), default: str | None = None) -> str:
        """Return a text, one of some options if there are any.

        Raises:
            DataError: if it is none.
        """
        value = self._values.get(key, default)
        if not isinstance(value, str) or not value.isprintable() or (options and value not in options):
            raise self.refusal(key, " or ".join(options) or "a text")
        return value

    def number(
        self, key: str, expected: str, low: float, high: float, example: float, default: float | None = None
    ) -> float:
        """Return a number within bounds.

        Raises:
            DataError: if it is none.
        """
        if key not in self and default is not None:
            return default
        value = _number(self._values.get(key))
        if value is None or not low <= value <= high:
            raise self.refusal(key, f"{expected} from {low:g} to {high:g}", f"{example:g}")
        return value

    def numbers(self, key: str, counts: Collection[int], expected: str, example: str) -> FloatArray:
        """Return a list of finite numbers (N,), where N is one of the counts; any number of them, if there are none.

        Raises:
            DataError: if it is none.
        """
        found = self.array(key)
        if found is None or found.ndim != 1 or (counts and len(found) not in counts) or not len(found):
            raise self.refusal(key, expected, example)
        return found

    def matrix(self, key: str, shapes: Collection[tuple[int, int]], expected: str, example: str) -> FloatArray:
        """Return a matrix of finite numbers, given as rows, of one of some shapes.

        Raises:
            DataError: if it is none.
        """
        found = self.array(key)
        if found is None or found.shape not in shapes:
            raise self.refusal(key, expected, example)
        return found

    def array(self, key: str) -> FloatArray | None:
        """Return a list, or a list of rows, of finite numbers; None if it is none."""
        value = self._values.get(key)
        rows = value if isinstance(value, list) else []
        nested = bool(rows) and all(isinstance(row, list) for row in rows)
        flat = [_number(each) for row in (rows if nested else [rows]) for each in row]
        if any(each is None for each in flat) or (nested and len({len(row) for row in rows}) != 1):
            return None
        return np.array(flat, np.float64).reshape((len(rows), -1) if nested and flat else (-1,))


def _number(value: Any) -> float | None:
    """Return a finite number of usual size; YAML reads 1e-3, which has no point, as a text."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if abs(number) <= _LARGEST else None


def _such_as(example: str) -> str:
    return f", such as {example}" if example else ""
