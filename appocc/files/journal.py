"""A file of lines that grows while several processes work.

Object stores cannot append to a file: there each line is an object of its own, in a folder named after the file,
until `write_lines` puts them together.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from appocc.errors import DataError
from appocc.files.names import plain_name
from appocc.files.reading import MOST_TEXT_BYTES, read_file
from appocc.files.remote_path import RemotePath
from appocc.files.writing import write_bytes

_READ_AT_ONCE = 16


def append_line(path: Path, key: str, line: str) -> None:
    """Append a line; several processes may do so concurrently.

    Args:
        path: the file.
        key: what the line is about; in a store, it replaces an earlier line of the same key.
        line: text without its end.

    Raises:
        DataError: if it cannot be written.
        StoreError: if the store of a remote file does not answer or refuses.
    """
    if isinstance(path, RemotePath):
        write_bytes(_pieces(path) / plain_name(path, key), f"{line}\n".encode())
        return
    try:
        with path.open("ab") as file:
            # The line before may have been cut off.
            file.write(f"\n{line}\n".encode())
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror})") from error


def read_lines(path: Path) -> list[bytes]:
    """Return the lines, later ones last; empty if there is no file.

    Raises:
        DataError: if it cannot be read.
        StoreError: if the store of a remote file does not answer or refuses.
    """
    own = read_file(path, MOST_TEXT_BYTES) if path.is_file() else b""
    pieces: list[bytes] = []
    if isinstance(path, RemotePath):
        with ThreadPoolExecutor(_READ_AT_ONCE) as pool:
            pieces = list(pool.map(read_file, _pieces(path).iterdir()))
    return b"\n".join([own, *pieces]).splitlines()


def write_lines(path: Path, lines: bytes) -> None:
    """Write the whole file anew; of a remote one, lines of their own are removed.

    Raises:
        DataError: if it cannot be written.
        StoreError: if the store of a remote file does not answer or refuses.
    """
    if not path.is_file() or read_file(path, MOST_TEXT_BYTES) != lines:
        write_bytes(path, lines)
    if isinstance(path, RemotePath):
        with ThreadPoolExecutor(_READ_AT_ONCE) as pool:
            list(pool.map(RemotePath.unlink, _pieces(path).iterdir()))


def _pieces(path: RemotePath) -> RemotePath:
    return path.with_name(f".{path.name}")
