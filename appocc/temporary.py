"""Work under way: locked, and under a fixed hidden name, so that what a killed process left is taken over."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from appocc.errors import DataError

# What file systems answer that have no locks.
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


@contextmanager
def locked(lock: Path, of: Path, wait: Callable[[str], None] | None = None) -> Iterator[None]:
    """Hold a lock: a file that is there, and empty at first, for that long. If this process dies, nobody holds it.

    The file may be renamed meanwhile; else it is removed in the end.

    Args:
        lock: the file.
        of: what it protects, for people.
        wait: called with a line before another process is waited for; where None, that is an error.

    Raises:
        DataError: if another process holds it.
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
    """A handle of a locked file."""
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
        try:
            _lock(handle, of, wait)
            if _is_named(handle, lock):  # else whoever held it has renamed or removed it
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _lock(handle: int, of: Path, wait: Callable[[str], None] | None) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        if wait is None:
            raise DataError(f"{of}: another run is at work on it just now") from error
        wait(f"{of}: waiting for another run that is at work on it")
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
    """An empty file beside `path`, to be renamed to it or else removed; another process at it is waited for.

    Raises:
        OSError: if it cannot be made.
    """
    temporary = path.with_name(f".{path.stem}.partial{path.suffix}")
    with locked(temporary, path, lambda line: None):
        yield temporary


@contextmanager
def partial_folder(path: Path, name: str | None = None) -> Iterator[Path]:
    """An empty folder beside `path` (of another `name`, where given), to be renamed to it or else removed.

    Raises:
        DataError: if another process is at it.
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
    """Make a folder and its parents; of those that were not there, the ones that are empty in the end are removed.

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
