"""TFRecord files: length, masked CRC32C of the length, data, masked CRC32C of the data; the numbers little-endian.

See "TFRecords format details" in TensorFlow's documentation, and RFC 3720, B.4 for CRC32C.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numba
import numpy as np
from numpy.typing import NDArray

from appocc.errors import DataError

_HEAD, _TAIL = struct.Struct("<QI"), struct.Struct("<I")
_POLYNOMIAL, _MASK = 0x82F63B78, 0xA282EAD8
# A frame has some five megabytes.
_MOST_BYTES = 1 << 28


@dataclass(frozen=True)
class Record:
    """Where the data of a record are in its file."""

    start: int
    size: int


def list_records(path: Path, file: BinaryIO) -> list[Record]:
    """Return the records of a file; their data are not read.

    Raises:
        DataError: if it is no TFRecord file, or cut off.
    """
    file.seek(0, 2)
    end = file.tell()
    found: list[Record] = []
    at = 0
    while at < end:
        file.seek(at)
        head = file.read(_HEAD.size)
        where = f"{path}: record {len(found)}"
        if len(head) < _HEAD.size:
            raise DataError(f"{where}: expected a length, got the end of the file: cut off")
        size, check = _HEAD.unpack(head)
        if masked_crc32c(head[:8]) != check or size > _MOST_BYTES:
            raise DataError(f"{where}: expected a TFRecord, got other bytes (the checksum of its length is wrong)")
        found.append(Record(at + _HEAD.size, size))
        at += _HEAD.size + size + _TAIL.size
        if at > end:
            raise DataError(f"{where}: expected {size} bytes, got the end of the file: cut off")
    return found


def read_record(path: Path, file: BinaryIO, record: Record, number: int) -> bytes:
    """Return the data of a record.

    Raises:
        DataError: if their checksum is wrong.
    """
    file.seek(record.start)
    data = file.read(record.size)
    (check,) = _TAIL.unpack(file.read(_TAIL.size).ljust(_TAIL.size, b"\0"))
    if masked_crc32c(data) != check:
        raise DataError(f"{path}: record {number}: damaged (the checksum of its data is wrong)")
    return data


def masked_crc32c(data: bytes) -> int:
    """Return the CRC32C of bytes, rotated and shifted as TFRecords store it."""
    crc = int(_crc32c(np.frombuffer(data, np.uint8), _table()))
    return ((crc >> 15 | crc << 17) + _MASK) & 0xFFFFFFFF


def _table() -> NDArray[np.uint32]:
    """Return the remainders of (8, 256): a byte, followed by 0..7 zeros."""
    table = np.zeros((8, 256), np.uint32)
    table[0] = np.arange(256)
    for _ in range(8):
        table[0] = table[0] >> 1 ^ np.where(table[0] & 1, _POLYNOMIAL, 0).astype(np.uint32)
    for zeros in range(1, 8):
        table[zeros] = table[zeros - 1] >> 8 ^ table[0][table[zeros - 1] & 0xFF]
    return table


def _crc32c_steps(data: Any, table: Any) -> Any:
    """Return the CRC32C; eight bytes a step ("slicing by 8", Kounavis and Berry, 2005)."""
    crc = np.uint32(0xFFFFFFFF)
    whole = len(data) // 8 * 8
    for i in range(0, whole, 8):
        low = crc ^ (
            np.uint32(data[i])
            | np.uint32(data[i + 1]) << np.uint32(8)
            | np.uint32(data[i + 2]) << np.uint32(16)
            | np.uint32(data[i + 3]) << np.uint32(24)
        )
        crc = (
            table[7, low & 0xFF]
            ^ table[6, low >> 8 & 0xFF]
            ^ table[5, low >> 16 & 0xFF]
            ^ table[4, low >> 24]
            ^ table[3, data[i + 4]]
            ^ table[2, data[i + 5]]
            ^ table[1, data[i + 6]]
            ^ table[0, data[i + 7]]
        )
    for i in range(whole, len(data)):
        crc = np.uint32(crc >> np.uint32(8) ^ table[0, (crc ^ data[i]) & 0xFF])
    return crc ^ np.uint32(0xFFFFFFFF)


_crc32c: Any = numba.njit(cache=True, nogil=True)(_crc32c_steps)
