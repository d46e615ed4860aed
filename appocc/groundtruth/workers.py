"""Worker processes: jobs of a scene done in order, stopped by Ctrl-C, gone with the parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

import cv2

from appocc.errors import AppoccError

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
T = TypeVar("T")
R = TypeVar("R")


@contextmanager
def worker_pool(count: int) -> Iterator[Executor | None]:
    """A pool of fresh processes, one thread each; None for a single worker, which needs no pool.

    Raises:
        AppoccError: if a worker is killed.
    """
    if count <= 1:
        yield None
        return
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _start_worker)
    try:
        yield pool
    except BrokenProcessPool as error:
        raise AppoccError(f"a worker process was killed (out of memory?): {count} at once may be too many") from error
    finally:
        # A second signal must not cut this short: Python would then wait for its workers forever.
        with _no_interrupts():
            pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Ctrl-C and SIGTERM do nothing here, nor ever in processes that are started here: the parent stops those.

    Only the main thread can say so, and only it is interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _start_worker() -> None:
    """In a worker: one thread that works, and one that waits for the end of the parent, killed or not."""
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class Work:
    """Jobs of one scene, done in order by whoever is free, and how far they have come in samples."""

    def __init__(self, pool: Executor | None, advance: Callable[[float], None], samples: int) -> None:
        """Begin with a scene of so many samples to be made; `advance` is called with parts of them."""
        self._pool, self._advance, self._left = pool, advance, float(samples)

    def done(self, job: Callable[[T], R], items: Sequence[T], share: float) -> list[R]:
        """Results of a job in the order of the items; it moves the bar by a share of what is left."""
        part, results = self._left * share, []
        for result in self._results(job, items):
            results.append(result)
            self._advance(part / len(items))
        self._left -= part if items else 0.0
        return results

    def _results(self, job: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
        if self._pool is None:
            return map(job, items)
        with _no_interrupts():  # here processes are started
            return self._pool.map(job, items, chunksize=2)
