"""Workers of a Dask cluster as separate processes on this machine; some are killed."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from dask_processes import DaskProcesses, kill_group, process
from made_pack_source import contents, made_source
from tiny_dataset import TinyDataset

import appocc.cluster
from appocc.cluster import Cluster, _name_of, _run, connected, own_versions
from appocc.errors import AppoccError, DataError
from appocc.packing.webdataset_shards import pack_webdataset

pytest.importorskip("distributed", reason="the extra cluster is not installed")


def double(item: int) -> int:
    return 2 * item


def fail_at_three(item: int) -> int:
    if item == 3:
        raise DataError("three: expected less")
    return item


def slow(item: int, folder: Path) -> int:
    (folder / str(item)).touch()
    time.sleep(0.3)
    return item


def deadly(item: int) -> int:
    if item == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def slowly(item: Any, job: Callable[[Any], Any]) -> Any:
    time.sleep(0.5)
    return job(item)


class Slowly:
    """A cluster whose jobs take half a second longer."""

    def __init__(self, cluster: Cluster) -> None:
        self._cluster = cluster

    def in_order(self, job: Callable[[Any], Any], items: Iterable[Any], chunksize: int = 1) -> Iterator[Any]:
        return self._cluster.in_order(partial(slowly, job=job), items, chunksize)


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[DaskProcesses]:
    from contextlib import ExitStack

    with ExitStack() as opened:
        yield DaskProcesses(tmp_path, lambda *each: opened.enter_context(process(*each, allowed_failures=1)))


@contextmanager
def connected_to(dask: DaskProcesses, folder: Path, workers: int) -> Iterator[Cluster]:
    with connected(dask.address, workers, folder) as cluster:
        deadline = time.monotonic() + 30
        while cluster.size < workers and time.monotonic() < deadline:
            time.sleep(0.05)
        yield cluster


def test_results_come_in_order_and_the_first_error_ends_the_work(dask: DaskProcesses, tmp_path: Path) -> None:
    for _ in range(2):
        dask.add_worker("--no-nanny")
    with connected_to(dask, tmp_path / "out", 2) as cluster:
        assert list(cluster.in_order(double, range(9), chunksize=2)) == [2 * i for i in range(9)]
        assert list(cluster.in_order(double, [])) == []
        found = cluster.in_order(fail_at_three, range(100))
        assert [next(found) for _ in range(3)] == [0, 1, 2]
        with pytest.raises(DataError, match="three: expected less"):
            next(found)
        assert not list(tmp_path.glob(".appocc-*"))  # the probe of the shared folder


def test_a_killed_worker_costs_nothing(dask: DaskProcesses, tmp_path: Path) -> None:
    workers = [dask.add_worker("--no-nanny"), dask.add_worker()]
    (tmp_path / "began").mkdir()
    with connected_to(dask, tmp_path, 2) as cluster:
        found = cluster.in_order(partial(slow, folder=tmp_path / "began"), range(12))
        first = [next(found), next(found)]
        kill_group(workers[0])
        assert first + list(found) == list(range(12))


def test_worker_and_node_are_lost_and_the_bytes_are_the_same(
    dask: DaskProcesses, tiny: TinyDataset, tmp_path: Path
) -> None:
    source, done = made_source(tiny), list[float]()
    worker, node = dask.add_worker("--no-nanny"), dask.add_worker()
    lost = [worker, node]

    def advance(count: float) -> None:
        done.append(count)
        if count and lost:
            kill_group(lost.pop(0))  # kill -9; of the node, the nanny that would start its worker again too
            dask.add_worker("--no-nanny")

    with connected_to(dask, tmp_path, 2) as cluster:
        pack_webdataset(source, source.key_frames(), tmp_path / "there", 1, Slowly(cluster), advance)
    pack_webdataset(source, source.key_frames(), tmp_path / "here", 1, None, lambda count: None)
    assert not lost
    assert sum(done) == 3  # the progress bar counts a frame once, whoever computed it
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_ctrl_c_leaves_finished_parts_and_the_same_call_resumes(
    dask: DaskProcesses, tiny: TinyDataset, tmp_path: Path
) -> None:
    source, done = made_source(tiny), list[float]()
    dask.add_worker("--no-nanny")

    def interrupt(count: float) -> None:
        if count:
            raise KeyboardInterrupt

    with connected_to(dask, tmp_path, 1) as cluster:
        with pytest.raises(KeyboardInterrupt):
            pack_webdataset(source, source.key_frames(), tmp_path / "there", 1, Slowly(cluster), interrupt)
        assert not (tmp_path / "there").exists()
        pack_webdataset(source, source.key_frames(), tmp_path / "there", 1, cluster, done.append)
    assert done[0] >= 1  # kept
    pack_webdataset(source, source.key_frames(), tmp_path / "here", 1, None, lambda count: None)
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_a_worker_that_joins_later_must_have_the_same_versions() -> None:
    assert _run(double, [1, 2], own_versions()) == [2, 4]
    with pytest.raises(AppoccError, match=r"worker on .*: expected torch 0\.1, got "):
        _run(double, [1], own_versions() | {"torch": "0.1"})


def test_tasks_are_named_after_their_job() -> None:
    assert [_name_of(job) for job in (double, partial(partial(slow), folder=Path()), Slowly)] == [
        "double",
        "slow",
        "Slowly",
    ]


def test_a_task_that_kills_its_workers_is_named_and_the_rest_is_done(dask: DaskProcesses, tmp_path: Path) -> None:
    dask.add_worker()  # with a nanny, which starts it again
    results: list[int] = []
    with connected_to(dask, tmp_path, 1) as cluster:
        found = cluster.in_order(deadly, range(5))
        results += [next(found) for _ in range(4)]
        with pytest.raises(AppoccError, match="1 tasks have killed every worker that tried them: 2") as failed:
            next(found)
    assert failed.value.exit_code == 1  # a check failed; what could be done is done
    assert results == [0, 1, 3, 4]


def test_a_lost_scheduler_is_one_clear_line(dask: DaskProcesses, tmp_path: Path) -> None:
    dask.add_worker("--no-nanny")
    (tmp_path / "began").mkdir()
    with connected_to(dask, tmp_path, 1) as cluster:
        found = cluster.in_order(partial(slow, folder=tmp_path / "began"), range(50))
        next(found)
        kill_group(dask.scheduler)
        with pytest.raises(AppoccError, match="the Dask scheduler is lost; what is finished is kept"):
            list(found)


def test_workers_of_other_versions_or_with_more_threads_are_refused(
    dask: DaskProcesses, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dask.add_worker("--no-nanny", "--nthreads", "3")
    with (
        pytest.raises(AppoccError, match=r"expected one thread \(dask worker --nthreads 1\), got 3"),
        connected(dask.address, 1, tmp_path),
    ):
        pass
    monkeypatch.setattr(appocc.cluster, "__version__", "9.9")
    with (
        pytest.raises(AppoccError, match=r"worker tcp://.*: expected appocc 9\.9, got "),
        connected(dask.address, 1, tmp_path),
    ):
        pass


@pytest.mark.parametrize("name", ["dask", "dask:", "ray:auto", "tcp://127.0.0.1:1"])
def test_a_cluster_of_no_known_kind_is_refused(name: str, tmp_path: Path) -> None:
    with (
        pytest.raises(DataError, match=r"--cluster: expected local, dask:tcp://HOST:PORT or dask:slurm"),
        connected(name, 1, tmp_path),
    ):
        pass


def test_no_scheduler_is_one_clear_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(appocc.cluster, "_CONNECT_S", 0.5)
    with (
        pytest.raises(AppoccError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"),
        connected("dask:tcp://127.0.0.1:9", 1, tmp_path),
    ):
        pass
