"""Writes that are whole or not at all, to plain files and remote ones."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from appocc.errors import DataError
from appocc.files.object_store import check_writable, upload
from appocc.files.remote_path import RemotePath, path_of
from appocc.temporary import made_folder, partial_file
from appocc.typing import PathLike


@contextmanager
def whole_file(path: PathLike) -> Iterator[Path]:
    """Write a file atomically: a temporary path, renamed to `path` if the block succeeds, otherwise removed.

    New parent folders are removed too if the block fails. A remote file is written on this machine and sent as a
    whole.

    Raises:
        DataError: if the folder cannot be written.
        StoreError: if the store of a remote file does not answer or refuses.
    """
    path = path_of(path)
    if isinstance(path, RemotePath):
        with _sent(path) as temporary:
            yield temporary
        return
    try:
        # Do not replace a device or a pipe.
        if path.exists() and not path.is_file():
            raise DataError(f"{path}: cannot be written (not a plain file)")
        with made_folder(path.parent), partial_file(path) as temporary:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error


@contextmanager
def _sent(path: RemotePath) -> Iterator[Path]:
    check_writable(str(path))
    try:
        with tempfile.TemporaryDirectory(prefix="appocc-") as folder:
            temporary = Path(folder) / path.name
            temporary.touch()
            yield temporary
            upload(temporary, str(path))
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_bytes(path: PathLike, data: bytes) -> None:
    """Write a file atomically.

    Raises:
        DataError: if it cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: PathLike, value: Any, indent: int | None = 1) -> None:
    """Write JSON atomically.

    Raises:
        DataError: if it cannot be written.
    """
    write_bytes(path, (json.dumps(value, indent=indent) + "\n").encode())
