"""Questions about local and remote files: their state, their ends, and which of a folder are there."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from appocc.errors import DataError
from appocc.files.object_store import listing, state_of_object
from appocc.files.reading import read_file
from appocc.files.remote_path import RemotePath
from appocc.files.store_requests import can_write

# How many questions a store is asked at once: each takes tens of milliseconds, most of them on the way.
_ASKED_AT_ONCE = 16
State = tuple[int | None, int | str] | None


def state_of(path: Path) -> State:
    """Size and time of a file, None where there is none; for a remote one the tag of its content, if it has one.

    Raises:
        StoreError: if the store of a remote file does not answer or refuses.
    """
    if isinstance(path, RemotePath):
        found = state_of_object(str(path))
        return None if found is None or found.is_folder else (found.size, found.mark)
    try:
        state = path.stat()
    except (OSError, ValueError):
        return None
    return state.st_size, state.st_mtime_ns


def states_of(paths: Sequence[Path]) -> list[State]:
    """Return the `state_of` each path; a store is asked for several at once."""
    if not any(isinstance(path, RemotePath) for path in paths):
        return [state_of(path) for path in paths]
    with ThreadPoolExecutor(_ASKED_AT_ONCE) as pool:
        return list(pool.map(state_of, paths))


def is_file(place: Path | os.DirEntry[str]) -> bool:
    """Whether a file exists; False for names that are too long and for link loops.

    Raises:
        StoreError: if the store of a remote file does not answer or refuses.
    """
    try:
        return place.is_file()
    except OSError:
        return False


def check_folder(folder: Path) -> None:
    """Check that a folder exists.

    Raises:
        DataError: if it does not, or is a file.
        StoreError: if the store of a remote folder does not answer or refuses.
    """
    if not folder.is_dir():
        raise DataError(f"{folder}: " + ("expected a folder, got a file" if is_file(folder) else "no such folder"))


def files_there(folder: Path, names: Collection[str]) -> set[str]:
    """Return the names of the files in a folder, empty if it is missing.

    One listing is much faster than many single queries. A folder that cannot be listed is asked for `names` alone.

    Raises:
        StoreError: if the store of a remote folder does not answer or refuses.
    """
    if isinstance(folder, RemotePath):
        if can_write(str(folder)):
            return {each.url.rpartition("/")[2] for each in listing(str(folder)) if not each.is_folder}
        found = states_of([folder / name for name in names])
        return {name for name, state in zip(names, found, strict=True) if state is not None}
    try:
        with os.scandir(folder) as entries:  # entries know their type without another disk access
            return {entry.name for entry in entries if is_file(entry)}
    except OSError:
        return set()


def can_list(path: Path) -> bool:
    """Return whether folders can be listed: those of web servers cannot."""
    return not isinstance(path, RemotePath) or can_write(str(path))


def folders_in(folder: Path) -> list[Path]:
    """Return the folders in a folder, in order, without hidden ones and links; empty if it is missing.

    Raises:
        StoreError: if the store of a remote folder does not answer, refuses, or has no lists.
    """
    if isinstance(folder, RemotePath):
        names = [each.url.rpartition("/")[2] for each in listing(str(folder)) if each.is_folder]
    else:
        try:
            with os.scandir(folder) as entries:
                names = [entry.name for entry in entries if entry.is_dir(follow_symlinks=False)]
        except OSError:
            return []
    return sorted(folder / name for name in names if not name.startswith("."))


def ends_of(path: Path, first: int, last: int) -> tuple[bytes, bytes]:
    """Return the first and the last bytes of a file, as many as it has.

    Raises:
        DataError: if a remote file is missing.
        StoreError: if the store of a remote file does not answer or refuses.
        OSError: if it cannot be read.
    """
    if isinstance(path, RemotePath):
        data = read_file(path)
        return data[:first], data[max(len(data) - last, 0) :]
    with path.open("rb") as handle:
        beginning = handle.read(first)
        handle.seek(max(os.fstat(handle.fileno()).st_size - last, 0))
        return beginning, handle.read()
