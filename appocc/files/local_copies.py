"""Local copies of remote files: tables and JSON are fetched once, and again when they change."""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

from appocc.errors import DataError
from appocc.files.object_store import download, state_of_object
from appocc.files.remote_path import RemotePath
from appocc.temporary import made_folder, partial_file

_VARIABLE = "APPOCC_CACHE"


def cache_folder() -> Path:
    """Return the folder of the local copies: `$APPOCC_CACHE`, or `appocc` in the user's cache folder."""
    named = os.environ.get(_VARIABLE)
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "appocc"


def local_copy(path: Path, most_bytes: int | None = None) -> Path:
    """Return a local path as it is, and a remote file as its cached local copy.

    A copy is named by the URL, and by the size and the tag or time of the content. Of concurrent processes
    one downloads, the others wait.

    Raises:
        DataError: if it is missing or larger than `most_bytes`, or the cache cannot be written.
        StoreError: if the store does not answer or refuses.
    """
    if not isinstance(path, RemotePath):
        return path
    state = state_of_object(str(path))
    if state is None or state.is_folder:
        raise DataError(f"{path}: cannot be read (no such file)")
    if most_bytes is not None and (state.size or 0) > most_bytes:
        raise DataError(f"{path}: expected at most {most_bytes} bytes, got {state.size}")
    folder = cache_folder() / "remote" / name_for(path)
    copy = folder / f"{_hash(f'{state.size} {state.mark}')}{path.suffix}"
    if copy.is_file():
        return copy
    try:
        with made_folder(folder), partial_file(copy) as partial:
            if not copy.is_file():  # else another process has fetched it meanwhile
                download(str(path), state, partial)
                _remove_others(folder, partial)
                partial.replace(copy)
    except FileNotFoundError as error:
        raise DataError(f"{path}: cannot be read (no such file)") from error
    except OSError as error:
        reason = f"{error.strerror or error}; ${_VARIABLE} names another folder"
        raise DataError(f"{folder}: cannot be written ({reason})") from error
    return copy


def name_for(path: RemotePath) -> str:
    """Return a name for local files that belong to a URL."""
    return _hash(str(path))


def _remove_others(folder: Path, partial: Path) -> None:
    """Remove copies of what the file was before; who reads one can go on."""
    for other in folder.iterdir():
        if other != partial:
            with suppress(OSError):
                other.unlink()


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:24]
