"""Reader of the protocol buffers wire format: fields of a message by number.

See "Encoding" in the documentation of Protocol Buffers: every field begins with number * 8 + wire type.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from appocc.checks import FloatArray

_VARINT, _BYTES_8, _LENGTH, _BYTES_4 = 0, 1, 2, 5
_MOST_VARINT_BYTES = 10
Value = int | memoryview


class Message:
    """The fields of a message; unknown ones are kept and ignored."""

    def __init__(self, data: bytes | memoryview) -> None:
        """Split a message into its fields.

        Raises:
            ValueError: if it is no message, or cut off.
        """
        self._fields: dict[int, list[Value]] = {}
        for number, value in _fields(memoryview(data)):
            self._fields.setdefault(number, []).append(value)

    def has(self, number: int) -> bool:
        """Return whether a field is present."""
        return number in self._fields

    def integer(self, number: int, default: int = 0) -> int:
        """Return an integer, enum or bool; the last one counts."""
        value = self._fields.get(number, [default])[-1]
        if not isinstance(value, int):
            raise _other(number, "an integer", "bytes")
        return value - (1 << 64) if value >= 1 << 63 else value

    def integers(self, number: int) -> list[int]:
        """Return repeated integers, packed or not."""
        found: list[int] = []
        for value in self._fields.get(number, []):
            found += [value] if isinstance(value, int) else _packed(value)
        return found

    def real(self, number: int, default: float = 0.0) -> float:
        """Return a double or float."""
        data = self._bytes(number)
        if data is None:
            return default
        if len(data) not in (4, 8):
            raise ValueError(f"field {number}: expected a float or double, got {len(data)} bytes")
        return float(struct.unpack("<d" if len(data) == 8 else "<f", data)[0])

    def reals(self, number: int, kind: str = "<f8") -> FloatArray:
        """Return repeated doubles (or other numbers of a numpy `kind`), packed or not."""
        parts = self._fields.get(number, [])
        if any(isinstance(part, int) for part in parts):
            raise _other(number, "doubles or floats", "integers")
        return np.frombuffer(b"".join(part for part in parts if not isinstance(part, int)), kind)

    def data(self, number: int) -> bytes:
        """Return bytes; empty if there are none."""
        return bytes(self._bytes(number) or b"")

    def text(self, number: int) -> str:
        """Return a string; '' if there is none."""
        return self.data(number).decode()

    def message(self, number: int) -> Message:
        """Return a message; an empty one if there is none."""
        return Message(self._bytes(number) or b"")

    def messages(self, number: int) -> list[Message]:
        """Return repeated messages."""
        found = self._fields.get(number, [])
        if any(isinstance(value, int) for value in found):
            raise _other(number, "messages", "integers")
        return [Message(value) for value in found if not isinstance(value, int)]

    def _bytes(self, number: int) -> memoryview | None:
        value = self._fields.get(number, [memoryview(b"")])[-1]
        if isinstance(value, int):
            raise _other(number, "bytes", "an integer")
        return value if number in self._fields else None


def find_integer(file: BinaryIO, end: int, wanted: int) -> int:
    """Return the first integer field of a number in a message between the position of a file and `end`.

    Other fields are skipped, not read.

    Raises:
        ValueError: if there is none.
    """
    while file.tell() < end:
        key = _varint_of(file)
        number, kind = key >> 3, key & 7
        if kind == _VARINT:
            value = _varint_of(file)
            if number == wanted:
                return value
        else:
            file.seek(_varint_of(file) if kind == _LENGTH else _fixed(kind), 1)
    raise ValueError(f"expected field {wanted}, got none")


def _fields(data: memoryview) -> Iterator[tuple[int, Value]]:
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, kind = key >> 3, key & 7
        if kind == _VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        size = _fixed(kind)
        if kind == _LENGTH:
            size, at = _varint(data, at)
        if at + size > len(data):
            raise ValueError(f"field {number}: expected {size} bytes, got {len(data) - at}: cut off")
        yield number, data[at : at + size]
        at += size


def _other(number: int, expected: str, got: str) -> ValueError:
    return ValueError(f"field {number}: expected {expected}, got {got}")


def _fixed(kind: int) -> int:
    if kind not in (_BYTES_8, _BYTES_4, _LENGTH):
        raise ValueError(f"expected a protocol buffer, got wire type {kind}")
    return 4 if kind == _BYTES_4 else 8


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift, byte in enumerate(data[at : at + _MOST_VARINT_BYTES]):
        value |= (byte & 0x7F) << 7 * shift
        if byte < 0x80:
            return value & ((1 << 64) - 1), at + shift + 1
    raise ValueError("expected a whole number, got one that is cut off")


def _varint_of(file: BinaryIO) -> int:
    data = file.read(_MOST_VARINT_BYTES)
    value, used = _varint(memoryview(data), 0)
    file.seek(used - len(data), 1)
    return value


def _packed(data: memoryview) -> list[int]:
    found, at = [], 0
    while at < len(data):
        value, at = _varint(data, at)
        found.append(value)
    return found
