"""Progress of downloads: who runs a command sets how it is shown."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from appocc.extras import import_extra

# Opens a progress bar of a title and a number of megabytes; the block gets a function that advances it.
Bar = Callable[[str, float], AbstractContextManager[Callable[[float], None]]]

_LEAST_BYTES = 1_000_000
_bars: list[Bar] = []


def show_downloads(bar: Bar | None) -> None:
    """Show downloads of a megabyte or more in the main thread by progress bars; None: no longer."""
    _bars[:] = [] if bar is None else [bar]


@contextmanager
def counted(url: str, size: int | None) -> Iterator[dict[str, Any]]:
    """Yield the arguments with which fsspec reports the progress of a download."""
    if not _bars or size is None or size < _LEAST_BYTES or threading.current_thread() is not threading.main_thread():
        yield {}
        return
    callbacks = import_extra("fsspec.callbacks", "remote", url)
    with _bars[0](f"fetching {url.rpartition('/')[2]}, MB", size / 1e6) as advance:
        shown = 0.0

        def report(size: int | None, value: int, **_: Any) -> None:
            nonlocal shown
            advance(value / 1e6 - shown)
            shown = value / 1e6

        yield {"callback": callbacks.Callback(hooks={"bar": report})}
