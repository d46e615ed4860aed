"""Temporary files and folders of unfinished results: locked, under a fixed hidden name.

A later run reuses the name, so that it removes what a killed process has left.
"""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from appocc.errors import AppoccError, DataError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

# Errors of file systems without locks.
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


def check_locks() -> None:
    """Check that this system has the file locks of Unix.

    Raises:
        AppoccError: if it has none.
    """
    if fcntl is None:
        raise AppoccError(f"expected a Unix system with file locks (fcntl), got {sys.platform} without them")


@contextmanager
def locked(lock: Path, of: Path, wait: Callable[[str], None] | None = None) -> Iterator[None]:
    """Hold an exclusive lock on a new, empty file; the system releases it if this process dies.

    The file may be renamed in the block; otherwise it is removed at the end.

    Args:
        lock: the file.
        of: the path that it protects, for the error message.
        wait: called with a line before this process waits for another one; None: do not wait.

    Raises:
        DataError: if another process holds it and `wait` is None.
        OSError: if the file cannot be made.
    """
    handle = _held(lock, of, wait)
    try:
        os.ftruncate(handle, 0)
        yield
    finally:
        with suppress(OSError):
            if _is_named(handle, lock):
                lock.unlink()
        os.close(handle)


def _held(lock: Path, of: Path, wait: Callable[[str], None] | None) -> int:
    """Descriptor of the locked file."""
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
        try:
            _lock(handle, of, wait)
            if _is_named(handle, lock):  # otherwise the last holder has renamed or removed it
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _lock(handle: int, of: Path, wait: Callable[[str], None] | None) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        if wait is None:
            raise DataError(f"{of}: in use by another run") from error
        wait(f"{of}: waiting for another run that uses it")
        fcntl.flock(handle, fcntl.LOCK_EX)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise


def _is_named(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.lstat())
    except FileNotFoundError:
        return False


@contextmanager
def partial_file(path: Path) -> Iterator[Path]:
    """An empty file in the folder of `path`, to be renamed to it, otherwise removed; waits for other processes.

    Raises:
        OSError: if it cannot be made.
    """
    temporary = path.with_name(f".{path.stem}.partial{path.suffix}")
    with locked(temporary, path, lambda line: None):
        yield temporary


@contextmanager
def partial_folder(path: Path, name: str | None = None) -> Iterator[Path]:
    """An empty folder in the folder of `path`, to be renamed to it, otherwise removed.

    Args:
        path: the final folder.
        name: of the temporary folder; by default it follows from `path`.

    Raises:
        DataError: if another process uses it.
        OSError: if it cannot be made.
    """
    temporary = path.with_name(name or f".{path.name}.partial")
    with locked(temporary.with_name(f"{temporary.name}.lock"), path):
        shutil.rmtree(temporary, ignore_errors=True)
        try:
            temporary.mkdir()
            yield temporary
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder and its parents; new ones that are empty at the end are removed.

    Raises:
        OSError: if it cannot be made.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for each in missing:
            with suppress(OSError):
                each.rmdir()
