"""A Dask scheduler and workers as processes of this machine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def process(*arguments: str, allowed_failures: int = 3) -> Iterator[subprocess.Popen[bytes]]:
    """A process of Dask's command line, in a group of its own."""
    more = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(allowed_failures)}
    more |= {"PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "dask", *arguments]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    started = subprocess.Popen(command, env=os.environ | more, start_new_session=True, **quiet)  # type: ignore[call-overload]
    try:
        yield started
    finally:
        kill_group(started)


def kill_group(started: subprocess.Popen[bytes]) -> None:
    """Kill a process and its children."""
    if started.poll() is None:
        os.killpg(started.pid, signal.SIGKILL)
    started.wait()


class DaskProcesses:
    """A scheduler and its workers."""

    def __init__(self, folder: Path, start: Callable[..., subprocess.Popen[bytes]]) -> None:
        self._file, self._start = folder / "scheduler.json", start
        self.scheduler = start("scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(self._file))
        while not self._file.is_file():
            assert self.scheduler.poll() is None
            time.sleep(0.05)
        time.sleep(0.1)

    @property
    def address(self) -> str:
        return "dask:" + str(json.loads(self._file.read_text())["address"])

    def add_worker(self, *more: str) -> subprocess.Popen[bytes]:
        return self._start("worker", "--scheduler-file", str(self._file), "--nthreads", "1", "--no-dashboard", *more)
