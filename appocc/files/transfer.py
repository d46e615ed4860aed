"""Whole folders from this machine to a store, resumable."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from appocc.files.local_copies import cache_folder, name_for
from appocc.files.object_store import check_writable, upload
from appocc.files.remote_path import RemotePath

_SENT_AT_ONCE = 8


def working_folder(path: RemotePath) -> Path:
    """Return the local folder for what is written to a remote folder, until it is sent."""
    check_writable(str(path))
    return cache_folder() / "unfinished" / f"{path.name}-{name_for(path)}"


def send_folder(source: Path, target: RemotePath, last: Callable[[Path], bool] = lambda path: False) -> None:
    """Move the files of a local folder into a remote one; those for which `last` is true after all others.

    A file that is sent is removed here: after an interruption, the same call sends the rest.

    Raises:
        StoreError: if the store does not answer or refuses.
        OSError: if a file cannot be read or removed.
    """
    files = sorted(path for path in source.rglob("*") if path.is_file())
    send = partial(_send, source=source, target=target)
    with ThreadPoolExecutor(_SENT_AT_ONCE) as pool:
        for group in (False, True):
            list(pool.map(send, [path for path in files if last(path) is group]))


def _send(path: Path, source: Path, target: RemotePath) -> None:
    upload(path, str(target / path.relative_to(source).as_posix()))
    path.unlink()
