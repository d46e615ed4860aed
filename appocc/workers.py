"""Worker processes, one thread each. They ignore Ctrl-C, end with the pool or the parent; a killed one is an error.

Not `concurrent.futures`: its workers share one pipe for results, and a worker that is killed while it writes blocks
that pipe for all others, and the parent with them.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count, islice
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import FrameType
from typing import Any, Protocol, TypeVar

import cv2

from appocc.errors import AppoccError

T = TypeVar("T")
R = TypeVar("R")

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
# Grace period in which a worker can remove its half-written files before it is killed.
_GRACE_S = 1.0
# Interrupts the job of a worker; Windows has none, there the grace period passes.
_INTERRUPT = getattr(signal, "SIGUSR1", None)


class Engine(Protocol):
    """Runs jobs elsewhere: processes of this machine, or a cluster."""

    def in_order(self, job: Callable[[T], R], items: Iterable[T], chunksize: int = 1) -> Iterator[R]:
        """Yield the results of a job in the order of its items."""


class Pool:
    """Spawned processes, started on demand.

    Each has its own connection, and no other process holds either end: if one end dies, even while it writes a
    message, the other gets an end of file.
    """

    def __init__(self, size: int) -> None:
        """Start with no process; `size` is the maximum."""
        self.size = size
        self._workers: dict[Connection, BaseProcess] = {}

    def in_order(self, job: Callable[[T], R], items: Iterable[T], chunksize: int = 1) -> Iterator[R]:
        """Yield the results of a job in the order of its items; at most two chunks per process are computed ahead.

        Raises:
            AppoccError: if a worker is killed.
            Exception: as the job does, for the first item that fails.
        """
        left = iter(items)
        chunks = iter(lambda: tuple(islice(left, chunksize)), ())
        handed = 0
        busy: dict[Connection, int] = {}
        done: dict[int, Sequence[R] | Exception] = {}
        try:
            for number in count():
                while number not in done:
                    while len(busy) < self.size and handed < number + 2 * self.size and (chunk := next(chunks, None)):
                        busy[self._give((job, chunk), busy)] = handed
                        handed += 1
                    if not busy:
                        return
                    for worker in wait(list(busy)):
                        assert isinstance(worker, Connection)
                        done[busy.pop(worker)] = outcome = self._taken(worker)
                        if isinstance(outcome, Exception):
                            chunks = iter(())
                outcome = done.pop(number)
                if isinstance(outcome, Exception):
                    raise outcome
                yield from outcome
        finally:
            if busy:
                self.stop()

    def stop(self) -> None:
        """End all processes, the busy ones too, within a second or so."""
        # A second signal must not interrupt this: it would leave processes behind.
        with no_interrupts():
            for connection in self._workers:
                connection.close()
            deadline = time.monotonic() + _GRACE_S
            for process in self._workers.values():
                process.join(max(0.0, deadline - time.monotonic()))
                process.kill()
                process.join()
            self._workers.clear()

    def _give(self, work: tuple[Callable[[T], R], Sequence[T]], busy: Collection[Connection]) -> Connection:
        """Send work to an idle worker, or to a new one."""
        worker = next((each for each in self._workers if each not in busy), None) or self._started()
        with self._missing_the_killed():
            worker.send(work)
        return worker

    def _started(self) -> Connection:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,), daemon=True)
        with no_interrupts():  # workers inherit that
            process.start()
            self._workers[ours] = process
        theirs.close()
        return ours

    def _taken(self, worker: Connection) -> Any:
        with self._missing_the_killed():
            return worker.recv()

    @contextmanager
    def _missing_the_killed(self) -> Iterator[None]:
        try:
            yield
        except (EOFError, OSError) as error:
            message = f"a worker process was killed (out of memory?): {self.size} at once may be too many"
            raise AppoccError(message) from error


@contextmanager
def worker_pool(size: int) -> Iterator[Pool | None]:
    """A pool of processes, one thread each; None for a single worker, which needs no pool."""
    if size <= 1:
        yield None
        return
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    pool = Pool(size)
    try:
        yield pool
    finally:
        pool.stop()
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def in_order(pool: Engine | None, job: Callable[[T], R], items: Iterable[T], chunksize: int = 1) -> Iterator[R]:
    """Yield the results of a job in the order of its items, in chunks of `chunksize` items.

    Without a pool, compute them in this process on demand.
    """
    return map(job, items) if pool is None else pool.in_order(job, items, chunksize)


@contextmanager
def no_interrupts() -> Iterator[None]:
    """Ignore Ctrl-C and SIGTERM in this block, and in processes that are started in it: the parent stops those.

    Does nothing outside of the main thread: only that one handles signals.
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


# In a worker --------------------------------------------------------------------------------------------------------


def _serve(connection: Connection) -> None:
    """Run the jobs that arrive, until the parent closes the connection or dies."""
    cv2.setNumThreads(1)
    if _INTERRUPT is not None:
        signal.signal(_INTERRUPT, _end)
    received: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(connection, received), daemon=True).start()
    with suppress(SystemExit, OSError):
        while True:
            outcome = _outcome(received.get())
            try:
                connection.send(outcome)
            except (pickle.PicklingError, TypeError, AttributeError) as error:
                connection.send(RuntimeError(f"{type(error).__name__}: {error}"))
    os._exit(0)


def _receive(connection: Connection, received: queue.SimpleQueue[bytes]) -> None:
    """Receive jobs; at the end of the connection interrupt the job that runs, and exit after the grace period."""
    with suppress(EOFError, OSError):
        while True:
            received.put(connection.recv_bytes())
    main = threading.main_thread().ident
    assert main is not None
    if _INTERRUPT is not None:
        signal.pthread_kill(main, _INTERRUPT)
    time.sleep(_GRACE_S)
    os._exit(1)


def _end(number: int, frame: FrameType | None) -> None:
    """Exit by an exception, so that half-written files are removed."""
    sys.exit(1)


def _outcome(work: bytes) -> list[Any] | Exception:
    try:
        job, items = pickle.loads(work)
        return [job(item) for item in items]
    except Exception as error:
        if not isinstance(error, AppoccError):
            error.add_note(f"In a worker process:\n{traceback.format_exc()}")
        return error
