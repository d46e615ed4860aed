"""Bounded reads of plain files and remote ones: bytes, text, JSON, arrays."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import os
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np
from numpy.lib.npyio import NpzFile

from appocc.errors import DataError
from appocc.files.local_copies import local_copy
from appocc.files.object_store import fetch
from appocc.files.remote_path import RemotePath, path_of
from appocc.typing import PathLike

# Limits far above any real image, sweep, map or town; a file of results may hold a whole dataset.
MOST_BYTES, MOST_TEXT_BYTES = 1 << 28, 1 << 31
# Limit of the unpacked size of compressed files.
_MOST_UNPACKED = 1 << 30


@contextmanager
def open_plain(path: PathLike, most_bytes: int | None = None) -> Iterator[BinaryIO]:
    """Open a plain file for reading; pipes and devices are refused because reads may block.

    A remote file is opened as a local copy, which is kept.

    Raises:
        DataError: if it is missing, cannot be read, is not a plain file, or is larger than `most_bytes`.
        StoreError: if the store of a remote file does not answer or refuses.
    """
    try:
        opened = open(local_copy(path_of(path), most_bytes), "rb", opener=_without_waiting)  # noqa: SIM115 - closed below, outside of this try
    except DataError:
        raise
    except (OSError, ValueError) as error:  # a name with a null in it is a ValueError
        raise DataError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    with opened as file:
        state = os.fstat(file.fileno())
        if not stat.S_ISREG(state.st_mode):
            raise DataError(f"{path}: expected a plain file, got a pipe or a device")
        if most_bytes is not None and state.st_size > most_bytes:
            raise DataError(f"{path}: expected at most {most_bytes} bytes, got {state.st_size}")
        yield file


def _without_waiting(name: str, flags: int) -> int:
    """Open a file without blocking: opening a pipe otherwise waits for a writer."""
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))


def read_file(path: PathLike, most_bytes: int = MOST_BYTES) -> bytes:
    """Read the bytes of a plain file; those of a remote file are not kept.

    Raises:
        DataError: as `open_plain`.
        StoreError: as `open_plain`.
    """
    path = path_of(path)
    if isinstance(path, RemotePath):
        return _fetched(path, most_bytes)
    with open_plain(path, most_bytes) as file:
        try:
            # Only the size at opening: a file may grow as fast as it is read.
            return file.read(os.fstat(file.fileno()).st_size)
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def _fetched(path: RemotePath, most_bytes: int) -> bytes:
    try:
        return fetch(str(path), most_bytes)
    except FileNotFoundError as error:
        raise DataError(f"{path}: cannot be read (no such file)") from error


def read_text(path: PathLike, most_bytes: int = MOST_BYTES) -> str:
    """Read the UTF-8 text of a plain file.

    Raises:
        DataError: as `open_plain`, or if it is not text.
    """
    try:
        return read_file(path, most_bytes).decode()
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: cannot be read as text ({error})") from error


def digest_of(path: PathLike) -> str:
    """Compute the SHA-256 of a plain file.

    Raises:
        DataError: as `open_plain`.
    """
    with open_plain(path) as file:
        digest = hashlib.sha256()
        while piece := file.read(1 << 20):
            digest.update(piece)
        return digest.hexdigest()


def unzipped(path: PathLike) -> bytes:
    """Read the bytes of a file, unpacked if its name ends in .gz.

    Raises:
        DataError: as `open_plain`, or if it is damaged or too large when unpacked.
    """
    path = path_of(path)
    data = read_file(path)
    if path.suffix != ".gz":
        return data
    try:
        with gzip.open(io.BytesIO(data)) as file:
            text = file.read(_MOST_UNPACKED + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"{path}: cannot be unpacked ({error})") from error
    if len(text) > _MOST_UNPACKED:
        raise DataError(f"{path}: expected at most {_MOST_UNPACKED} bytes when unpacked, got more")
    return text


def read_json(path: PathLike) -> Any:
    """Read a JSON file; a remote one as a local copy, which is kept.

    Raises:
        DataError: if it is missing or not JSON.
    """
    data = read_file(local_copy(path_of(path), MOST_TEXT_BYTES), MOST_TEXT_BYTES)
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: no valid JSON ({error})") from error


def zip_arrays(data: bytes | BinaryIO) -> NpzFile:
    """Open the arrays of an .npz file by name, without unpickling.

    Of an open file only the directory is read, and then what is asked for.

    Raises:
        ValueError: if it is not an .npz file or too large when unpacked. Reading a damaged array raises nearly any
            error of zipfile, zlib and numpy.
    """
    handle = io.BytesIO(data) if isinstance(data, bytes) else data
    if not zipfile.is_zipfile(handle):
        raise ValueError("no .npz archive, or truncated")
    try:
        with zipfile.ZipFile(handle) as archive:
            unpacked = sum(part.file_size for part in archive.infolist())
    except zipfile.BadZipFile as error:
        raise ValueError(str(error)) from error
    if unpacked > _MOST_UNPACKED:
        raise ValueError(f"expected at most {_MOST_UNPACKED} bytes when unpacked, got {unpacked}")
    handle.seek(0)
    arrays: NpzFile = np.load(handle, allow_pickle=False)
    return arrays
