"""The long work that pages have started, and its progress."""

from __future__ import annotations

import multiprocessing
import time
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Any

from appocc.errors import AppoccError, NotFoundError
from cli.server.job_process import run_job

# Jobs that are listed, and the time in which a stopped one can remove its half-written files.
_MOST_JOBS, _GRACE_S = 20, 3.0


class BusyError(AppoccError):
    """Another job is running."""


@dataclass(eq=False)
class Job:
    """A piece of long work.

    Attributes:
        number: of the job, from 1.
        kind: simulate or predict.
        title: for people.
        root: of the dataset that it makes or extends.
        source: of the maps that it predicts.
        process: that does it.
        started_s: time of its start.
        state: running, done, failed or stopped.
        done: finished steps.
        total: all steps; 0 while unknown.
        note: what it does at the moment, or why it failed.
        ended_s: time of its end; None while it runs.
        ended: set when its process has ended.
    """

    number: int
    kind: str
    title: str
    root: Path
    source: str
    process: BaseProcess
    started_s: float
    state: str = "running"
    done: float = 0.0
    total: float = 0.0
    note: str = "starting"
    ended_s: float | None = None
    ended: Event = field(default_factory=Event)

    def as_json(self) -> dict[str, Any]:
        """Return what the page shows."""
        seconds = (self.ended_s or time.monotonic()) - self.started_s
        shown = ("number", "kind", "title", "state", "done", "total", "note", "source")
        return {**{name: getattr(self, name) for name in shown}, "seconds": round(seconds, 1)}


class Jobs:
    """One job at a time, each in its own process."""

    def __init__(self) -> None:
        """Begin without jobs."""
        self._jobs: list[Job] = []
        self._lock = Lock()

    def start(self, kind: str, title: str, root: Path, settings: dict[str, Any]) -> Job:
        """Start a job; see `run_job`.

        Raises:
            BusyError: if another one is running.
        """
        with self._lock:
            if any(job.state == "running" for job in self._jobs):
                raise BusyError("another job is running: wait for it, or stop it")
            context = multiprocessing.get_context("spawn")
            ours, theirs = context.Pipe(duplex=False)
            process = context.Process(target=run_job, args=(theirs, kind, root, settings), daemon=True)
            number = self._jobs[-1].number + 1 if self._jobs else 1
            job = Job(number, kind, title, root, settings["source"], process, time.monotonic())
            process.start()
            theirs.close()
            self._jobs = [*self._jobs, job][-_MOST_JOBS:]
        Thread(target=_listen, args=(job, ours), daemon=True, name="job").start()
        return job

    def listed(self) -> list[Job]:
        """Return the jobs in the order of their start."""
        with self._lock:
            return list(self._jobs)

    def stop(self, number: int) -> Job:
        """Stop a job.

        Raises:
            NotFoundError: if there is no such job.
        """
        job = next((job for job in self.listed() if job.number == number), None)
        if job is None:
            raise NotFoundError("there is no such job")
        if job.state == "running":
            job.state, job.note = "stopped", "stopped; start it again to go on"
            job.process.terminate()
        return job

    def close(self) -> None:
        """Stop all jobs and wait for their processes."""
        for job in self.listed():
            self.stop(job.number)
        for job in self.listed():
            if not job.ended.wait(_GRACE_S):
                job.process.kill()
                job.ended.wait()


def _listen(job: Job, connection: Connection) -> None:
    """Receive the reports of a job until it ends."""
    with connection, suppress(EOFError, OSError):
        while True:
            what, value = connection.recv()
            if what == "total":
                job.total = value
            elif what == "advance":
                job.done += value
            elif job.state != "running":
                continue  # it was stopped; what it still reports is of no interest
            elif what == "note":
                job.note = value
            else:
                job.state, job.note = ("done", "") if what == "done" else ("failed", str(value))
    # Only here: of two threads that join one process, the second may take it for alive.
    job.process.join()
    if job.state == "running":
        job.state, job.note = "failed", "the process was killed (out of memory?)"
    job.ended_s = time.monotonic()
    job.ended.set()
