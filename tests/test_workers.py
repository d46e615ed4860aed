"""Workers give results in order, are missed when they are killed, and go with the pool or the parent."""

from __future__ import annotations

import fcntl
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path
from types import FrameType

import pytest

from appocc.errors import AppoccError, DataError
from appocc.workers import Pool, in_order, worker_pool

LARGE = 20_000_000  # far more than a pipe holds


@pytest.fixture(autouse=True)
def _no_hang() -> Iterator[None]:
    """What would wait forever fails instead."""

    def late(number: int, frame: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with worker_pool(2) as made:
        assert made is not None
        yield made


def squared(number: int) -> tuple[int, int]:
    if number == 7:
        raise DataError("seven")
    if number == 9:
        raise ValueError("nine")
    return number * number, os.getpid()


def large(number: int) -> bytes:
    return bytes(LARGE)


def killed_at_two(number: int) -> bytes:
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return bytes(LARGE)


def holds(path: Path) -> None:
    """Lock a file, and tell so, for as long as the process lives; `path`.end is written when it is let end."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        path.with_suffix(".begun").touch()
        try:
            time.sleep(600)
        finally:
            path.with_suffix(".end").touch()


def signalled(number: int) -> int:
    for each in (signal.SIGINT, signal.SIGTERM):
        os.kill(os.getpid(), each)
    return number


def comes(condition: Callable[[], bool]) -> bool:
    """Whether something is so within half a minute."""
    deadline = time.monotonic() + 30
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def gone() -> bool:
    """Whether only the processes of the pool of all tests are left."""
    return len(multiprocessing.active_children()) <= 2


def is_free(path: Path) -> bool:
    """Whether nobody holds the lock of a file."""
    with path.open("r+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


def test_without_a_pool_the_work_is_done_here() -> None:
    with worker_pool(1) as none:
        assert none is None
        assert [pid for _, pid in in_order(none, squared, [1])] == [os.getpid()]


@pytest.mark.parametrize("chunksize", [1, 2, 5])
def test_results_come_in_order_from_other_processes(pool: Pool, chunksize: int) -> None:
    results = list(in_order(pool, squared, iter([3, 1, 2, 0, 6]), chunksize))
    assert [value for value, _ in results] == [9, 1, 4, 0, 36]
    assert os.getpid() not in {pid for _, pid in results}
    assert list(in_order(pool, squared, [])) == []


def test_the_first_error_ends_the_work_and_no_more_is_asked_for(pool: Pool) -> None:
    endless = count()
    with pytest.raises(DataError, match="seven"):
        list(in_order(pool, squared, endless))
    assert next(endless) < 20
    with pytest.raises(ValueError, match="nine") as caught:
        list(in_order(pool, squared, [9]))
    assert "in squared" in caught.value.__notes__[0]
    assert next(in_order(pool, squared, [5]))[0] == 25


def test_what_cannot_travel_is_an_error(pool: Pool) -> None:
    with pytest.raises(RuntimeError, match="TextIOWrapper"):
        list(in_order(pool, open, [os.devnull]))


def test_a_worker_is_deaf_to_ctrl_c_and_sigterm(pool: Pool) -> None:
    assert list(in_order(pool, signalled, [1, 2])) == [1, 2]


def test_a_killed_worker_is_told_while_others_have_much_to_say() -> None:
    def work() -> None:
        with worker_pool(3) as pool:
            list(in_order(pool, killed_at_two, range(30)))

    with pytest.raises(AppoccError, match=r"a worker process was killed \(out of memory\?\): 3 at once"):
        work()
    assert gone()


def test_a_worker_killed_in_the_middle_of_a_result_is_told() -> None:
    def work() -> None:
        with worker_pool(2) as pool:
            for _ in in_order(pool, large, range(30)):
                time.sleep(0.2)  # meanwhile the others begin to write theirs
                for process in multiprocessing.active_children():
                    process.kill()

    with pytest.raises(AppoccError, match="a worker process was killed"):
        work()
    assert gone()


def fails_when_both_are_busy(number: int, place: Path) -> None:
    """The first fails when another works, and a third cannot even notice."""
    if number == 1:
        holds(place)
    if number == 2:
        place.with_suffix(".stopped").touch()
        os.kill(os.getpid(), signal.SIGSTOP)
    assert comes(lambda: all(place.with_suffix(ending).exists() for ending in (".begun", ".stopped")))
    raise DataError("in time")


def test_the_end_of_the_pool_ends_work_under_way(tmp_path: Path) -> None:
    def work() -> None:
        with worker_pool(3) as pool:
            list(in_order(pool, partial(fails_when_both_are_busy, place=tmp_path / "held"), range(3)))

    with pytest.raises(DataError, match="in time"):
        work()
    assert (tmp_path / "held.end").exists()
    assert gone()


PARENT = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from test_workers import holds
from appocc.workers import in_order, worker_pool
if __name__ == "__main__":
    with worker_pool(2) as pool:
        list(in_order(pool, holds, [Path(sys.argv[2])]))
"""


def test_no_worker_outlives_its_killed_parent(tmp_path: Path) -> None:
    script, place = tmp_path / "parent.py", tmp_path / "held"
    script.write_text(PARENT)
    command = [sys.executable, str(script), str(Path(__file__).parent), str(place)]
    with subprocess.Popen(command) as parent:
        assert comes(place.with_suffix(".begun").exists)
        assert not is_free(place)
        parent.kill()
    assert comes(partial(is_free, place))
