"""Paths that are URLs: `s3://`, `gs://`, `https://`. They have the methods of `pathlib.Path`."""

from __future__ import annotations

import fnmatch
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path, PosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

from appocc.errors import DataError
from appocc.files.object_store import files_below, listing, remove, state_of_object
from appocc.files.store_requests import SCHEMES, StoreError, can_write
from appocc.typing import PathLike

# A URL, also as pathlib shortens it.
_URL = re.compile(rf"({'|'.join(SCHEMES)}):/+(?=[^/])")
_FILE = "file://"


class RemotePath(PosixPath):
    """A file or folder of an object store or web server.

    Names are joined and taken apart as in any path; questions about files ask the store. Reading and writing is done
    by the functions of `appocc.files`. It is pickled as text: each process makes its own connections.
    """

    __slots__ = ()

    def __str__(self) -> str:
        """Return the URL."""
        return _URL.sub(r"\1://", super().__str__(), count=1)

    def __fspath__(self) -> str:
        """Return the URL."""
        return str(self)

    # Questions --------------------------------------------------------------------------------------------------

    def stat(self, *, follow_symlinks: bool = True) -> os.stat_result:
        """Return size and time.

        Raises:
            FileNotFoundError: if there is nothing of this name.
            StoreError: if the store does not answer or refuses.
        """
        found = state_of_object(str(self))
        if found is None:
            raise FileNotFoundError(f"{self}: no such file or folder")
        mode = stat.S_IFDIR if found.is_folder else stat.S_IFREG
        seconds = found.mtime_ns // 10**9
        numbers = (mode, 0, 0, 1, 0, 0, found.size or 0, seconds, seconds, seconds)
        return os.stat_result(numbers, {"st_mtime_ns": found.mtime_ns})

    def exists(self) -> bool:
        """Return whether there is a file or folder of this name."""
        return state_of_object(str(self)) is not None

    def is_file(self) -> bool:
        """Return whether it is a file."""
        found = state_of_object(str(self))
        return found is not None and not found.is_folder

    def is_dir(self) -> bool:
        """Return whether it is a folder. A web server has no folders: any address may be the beginning of others."""
        if not can_write(str(self)):
            return True
        found = state_of_object(str(self))
        return found is not None and found.is_folder

    def is_symlink(self) -> bool:
        """Return False: stores have no links."""
        return False

    def is_mount(self) -> bool:
        """Return False."""
        return False

    def is_absolute(self) -> bool:
        """Return True: a URL does not depend on the working folder."""
        return True

    def absolute(self) -> RemotePath:
        """Return itself."""
        return self

    def resolve(self, strict: bool = False) -> RemotePath:
        """Return itself."""
        return self

    # Lists ------------------------------------------------------------------------------------------------------

    def iterdir(self) -> Iterator[RemotePath]:  # type: ignore[override]
        """Yield the files and folders in a folder, in order.

        Raises:
            StoreError: if the store does not answer, refuses, or has no lists.
        """
        return (self / name for name in sorted(each.url.rpartition("/")[2] for each in listing(str(self))))

    def glob(self, pattern: str) -> Iterator[RemotePath]:  # type: ignore[override]
        """Yield the files and folders that fit a pattern, in order; `**` is not known, a final slash means folders.

        Raises:
            StoreError: as `iterdir`.
        """
        only_folders = pattern.endswith("/")
        first, _, rest = pattern.strip("/").partition("/")
        found = sorted(listing(str(self)), key=lambda each: each.url) if _has_wildcard(first) else None
        if found is None:
            place = self / first
            yield from place.glob(rest + "/" * only_folders) if rest else ([place] if place.exists() else [])
            return
        for each in found:
            place = self / each.url.rpartition("/")[2]
            if not fnmatch.fnmatchcase(place.name, first):
                continue
            if rest and each.is_folder:
                yield from place.glob(rest + "/" * only_folders)
            elif not rest and (each.is_folder or not only_folders):
                yield place

    def rglob(self, pattern: str) -> Iterator[RemotePath]:  # type: ignore[override]
        """Yield the files at any depth whose names fit a pattern, in order.

        Raises:
            StoreError: as `iterdir`.
        """
        found = (RemotePath(url) for url in files_below(str(self)))
        return (path for path in found if fnmatch.fnmatchcase(path.name, pattern))

    # Changes ----------------------------------------------------------------------------------------------------

    def mkdir(self, mode: int = 0o777, parents: bool = False, exist_ok: bool = False) -> None:
        """Do nothing: a folder is there as soon as it has a file."""

    def rmdir(self) -> None:
        """Do nothing: a folder is gone as soon as it has no file."""

    def unlink(self, missing_ok: bool = True) -> None:
        """Remove a file.

        Raises:
            StoreError: if the store does not answer or refuses.
        """
        remove(str(self))

    def open(self, *arguments: Any, **options: Any) -> Any:
        """Refuse: `appocc.files` reads and writes.

        Raises:
            StoreError: always.
        """
        raise StoreError(f"{self}: expected a path on this machine, got a URL")


def _has_wildcard(name: str) -> bool:
    return any(character in name for character in "*?[")


def path_of(text: PathLike) -> Path:
    """Return a path, which may be a URL: `s3://`, `gs://`, `https://`, `http://` or `file://`.

    Raises:
        DataError: if the URL has credentials or a query, or its scheme is not known.
    """
    if isinstance(text, RemotePath):
        return text
    name = os.fspath(text)
    if name.startswith(_FILE):
        host, path = name.removeprefix(_FILE).partition("/")[::2]
        if host not in ("", "localhost"):
            raise DataError(f"{name}: expected file:///PATH on this machine, got a host")
        return Path("/" + unquote(path))
    if not _URL.match(name):
        scheme, separator, _ = name.partition("://")
        if separator and scheme.isalnum():
            known = ", ".join(f"{each}://" for each in (*SCHEMES, "file"))
            raise DataError(f"{scheme}://...: expected a path or a URL of {known}")
        return text if isinstance(text, Path) else Path(name)
    return RemotePath(_checked(_URL.sub(r"\1://", name, count=1)))


def _checked(url: str) -> str:
    """Check a URL and return it without quoting.

    Raises:
        DataError: if it has credentials, which every message would show, or a query.
    """
    parts = urlsplit(url)
    if "@" in parts.netloc:
        raise DataError(f"{parts.scheme}://...: expected an address without user name and password, got some")
    if not can_write(url):
        if parts.query or parts.fragment:
            raise DataError(f"{parts.scheme}://{parts.netloc}{parts.path}: expected no query in the address, got one")
        return f"{parts.scheme}://{parts.netloc}{unquote(parts.path)}"
    return url
