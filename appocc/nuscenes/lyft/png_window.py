"""A part of a PNG picture that is too large for the memory, such as a map of a town: decoded row by row.

See the PNG Specification (W3C, third edition): chunks (5), filters (9), pixels (7.2).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numba
import numpy as np

from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.files import open_plain

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEADER, _CHUNK = struct.Struct(">IIBBBBB"), struct.Struct(">I4s")
_RGB, _PALETTE, _RGBA = 2, 3, 6
_PAETH = 4
_CHANNELS = {_RGB: 3, _PALETTE: 1, _RGBA: 4}
# Data are unpacked in pieces of this size; a row is no longer than the widest map.
_PIECE, _MOST_WIDTH = 1 << 20, 1 << 18


def png_window(path: Path, area: tuple[int, int, int, int]) -> ByteArray:
    """Return the pixels (H, W, 3) of a colour PNG between columns and rows (left, top, right, bottom).

    Raises:
        DataError: if the file is missing or damaged, or is not 8-bit RGB, RGBA or palette without interlacing.
    """
    left, top, right, bottom = area
    with open_plain(path) as file:
        try:
            return _read(file, left, top, right, bottom)
        except (ValueError, zlib.error, struct.error) as error:
            raise DataError(f"{path}: not a readable map ({error})") from error


def _read(file: BinaryIO, left: int, top: int, right: int, bottom: int) -> ByteArray:
    if file.read(len(_SIGNATURE)) != _SIGNATURE:
        raise ValueError("expected a PNG picture")
    chunks = _chunks(file)
    kind, header = next(chunks, (b"", b""))
    if kind != b"IHDR":
        raise ValueError("expected a header, got none")
    width, height, depth, colour, _, _, interlaced = _HEADER.unpack(header)
    if depth != 8 or colour not in _CHANNELS or interlaced or not 0 < width <= _MOST_WIDTH:
        raise ValueError(f"expected 8 bits of RGB or a palette, row by row; got {depth} bits of kind {colour}")
    if not (0 <= left < right <= width and 0 <= top < bottom <= height):
        raise ValueError(f"expected an area within {width}x{height} pixels")
    channels, palette = _CHANNELS[colour], np.zeros((256, 3), np.uint8)
    rows = _rows(chunks, palette, width * channels)
    above = np.zeros(width * channels, np.uint8)
    found = np.empty((bottom - top, right - left, channels), np.uint8)
    for number in range(bottom):
        row = next(rows, None)
        if row is None:
            raise ValueError(f"expected {height} rows, got {number}: cut off")
        if row[0] > _PAETH:
            raise ValueError(f"row {number}: expected a filter from 0 to {_PAETH}, got {row[0]}")
        above = _unfiltered(row[0], row[1:], above, channels)
        if number >= top:
            found[number - top] = above.reshape(width, channels)[left:right]
    return palette[found[..., 0]] if colour == _PALETTE else np.ascontiguousarray(found[..., :3])


def _chunks(file: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Yield the type and data of chunks; those of pixels in pieces, without their checksums."""
    while head := file.read(_CHUNK.size):
        size, kind = _CHUNK.unpack(head)
        while size > 0 or kind != b"IDAT":
            data = file.read(min(size, _PIECE))
            size -= len(data)
            yield kind, data
            if not data or kind != b"IDAT":
                break
        file.seek(max(size, 0) + 4, 1)


def _rows(chunks: Iterator[tuple[bytes, bytes]], palette: ByteArray, row_bytes: int) -> Iterator[ByteArray]:
    """Yield rows (1 + row_bytes,), the kind of filter first; fill the palette."""
    unpacker, kept = zlib.decompressobj(), bytearray()
    for kind, data in chunks:
        if kind == b"PLTE":
            entries = np.frombuffer(data[: len(data) // 3 * 3], np.uint8).reshape(-1, 3)[:256]
            palette[: len(entries)] = entries
        if kind != b"IDAT":
            continue
        while data:
            kept += unpacker.decompress(data, _PIECE)
            data = unpacker.unconsumed_tail
            whole = len(kept) // (1 + row_bytes)
            yield from np.frombuffer(bytes(kept[: whole * (1 + row_bytes)]), np.uint8).reshape(whole, 1 + row_bytes)
            del kept[: whole * (1 + row_bytes)]


def _unfiltered_row(kind: int, row: Any, above: Any, channels: int) -> Any:
    """Return the bytes of a row, given those of the row above."""
    found = np.empty_like(row)
    for i in range(len(row)):
        left = np.int32(found[i - channels]) if i >= channels else np.int32(0)
        up = np.int32(above[i])
        if kind == 0:
            guess = np.int32(0)
        elif kind == 1:
            guess = left
        elif kind == 2:
            guess = up
        elif kind == 3:
            guess = (left + up) // 2
        else:
            corner = np.int32(above[i - channels]) if i >= channels else np.int32(0)
            to_left, to_up, to_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
            guess = left if to_left <= to_up and to_left <= to_corner else up if to_up <= to_corner else corner
        found[i] = np.uint8((np.int32(row[i]) + guess) & 0xFF)
    return found


_unfiltered: Any = numba.njit(cache=True, nogil=True)(_unfiltered_row)
