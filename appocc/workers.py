"""Worker processes: one thread each, stopped by Ctrl-C, gone with the parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

import cv2

from appocc.errors import AppoccError

T = TypeVar("T")
R = TypeVar("R")

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


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
        with no_interrupts():
            pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def in_order(pool: Executor | None, job: Callable[[T], R], items: Iterable[T], chunksize: int = 1) -> Iterator[R]:
    """Results of a job in the order of its items, `chunksize` of which are handed over at once.

    Without a pool they are worked out here, each when it is asked for.
    """
    if pool is None:
        return map(job, items)
    with no_interrupts():  # here processes are started
        return pool.map(job, items, chunksize=chunksize)


@contextmanager
def no_interrupts() -> Iterator[None]:
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
