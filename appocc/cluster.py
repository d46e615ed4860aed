"""A Dask cluster in place of worker processes: the same jobs, results in the same order, the same bytes.

Workers have one thread each, as local ones do, and see the output folder at the same path (a shared file system, or a
URL of an object store).
"""

from __future__ import annotations

import platform
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count, islice
from pathlib import Path
from typing import Any, TypeVar
from uuid import uuid4

import cv2

from appocc.errors import AppoccError, DataError, ItemsFailedError
from appocc.extras import import_extra
from appocc.files import RemotePath, write_bytes
from appocc.version import __version__
from appocc.yaml_file import read_yaml

T = TypeVar("T")
R = TypeVar("R")

LOCAL = "local"
_SCHEME, _SLURM = "dask:", "slurm"
_PACKAGES = ("numpy", "torch", "opencv-python-headless")
_CONNECT_S = 10
# Chunks of items that are computed ahead, per worker.
_AHEAD = 2


class Cluster:
    """Workers of a Dask cluster; `in_order` as that of `appocc.workers.Pool`."""

    def __init__(self, client: Any) -> None:
        """Take a connected `distributed.Client`."""
        self._client = client

    @property
    def dashboard(self) -> str:
        """Address of the dashboard."""
        return str(self._client.dashboard_link)

    @property
    def size(self) -> int:
        """Number of workers."""
        return len(self._client.scheduler_info(n_workers=-1)["workers"])

    def in_order(self, job: Callable[[T], R], items: Iterable[T], chunksize: int = 1) -> Iterator[R]:
        """Yield the results of a job in the order of its items; a few chunks per worker are computed ahead.

        A task whose worker dies is repeated by another worker. One that has cost several workers is left out, the
        others are computed, and the error comes at the end.

        Raises:
            AppoccError: if the scheduler is lost or versions differ.
            ItemsFailedError: at the end, if items have cost several workers each; it names them.
            Exception: as the job does, for the first item that fails.
        """
        distributed = import_extra("distributed", "cluster", "--cluster")
        lost = (CancelledError, TimeoutError, distributed.comm.CommClosedError, distributed.client.ClosedClientError)
        left = iter(items)
        chunks = iter(lambda: tuple(islice(left, chunksize)), ())
        waiting: deque[tuple[Any, Sequence[T]]] = deque()
        deadly: list[Sequence[T]] = []
        killed, versions = distributed.scheduler.KilledWorker, own_versions()
        # Keys name the job and the number of its chunk in the dashboard; a run has keys of its own.
        keys = (f"{_name_of(job)}-{uuid4().hex}-{number}" for number in count())

        def submit(chunk: Sequence[T]) -> Any:
            return self._client.submit(_run, job, chunk, versions=versions, key=next(keys))

        try:
            while True:
                ahead = max(1, _AHEAD * self.size) - len(waiting)
                waiting.extend((submit(chunk), chunk) for chunk in islice(chunks, max(0, ahead)))
                if not waiting:
                    break
                future, chunk = waiting.popleft()
                try:
                    yield from future.result()
                except killed:
                    try:  # Dask blames every task of a lost worker: once more, now that the culprit is gone or last
                        yield from submit(chunk).result()
                    except killed:
                        deadly.append(chunk)
        except lost as error:
            kept = "what is finished is kept: the same command resumes"
            raise AppoccError(f"the Dask scheduler is lost; {kept} ({error})") from error
        finally:
            with suppress(Exception):
                self._client.cancel([future for future, _ in waiting])
        if deadly:
            named = "; ".join(str(item)[:200] for chunk in deadly[:3] for item in chunk)
            raise ItemsFailedError(f"{len(deadly)} tasks have killed every worker that tried them: {named}")

    def check(self, folder: Path, writes: bool = True) -> None:
        """Check that all workers have one thread and these versions, and see `folder`, or a new file in it.

        Raises:
            AppoccError: if one has not or does not.
        """
        mine = own_versions()
        for address, theirs in self._client.run(own_versions).items():
            if theirs != mine:
                raise AppoccError(f"worker {address}: {_difference(mine, theirs)}")
        for address, worker in self._client.scheduler_info(n_workers=-1)["workers"].items():
            if worker["nthreads"] != 1:
                raise AppoccError(
                    f"worker {address}: expected one thread (dask worker --nthreads 1), got {worker['nthreads']}"
                )
        if not writes:
            self._check_seen(folder, folder)
            return
        probe = (folder if isinstance(folder, RemotePath) else _existing(folder)) / f".appocc-{uuid4().hex}"
        write_bytes(probe, b"")
        try:
            self._check_seen(probe, probe.parent)
        finally:
            probe.unlink(missing_ok=True)

    def _check_seen(self, path: Path, folder: Path) -> None:
        blind = [address for address, sees in self._client.run(_sees, path).items() if not sees]
        if blind:
            raise AppoccError(f"worker {blind[0]}: expected the shared folder {folder}, it does not see it")


@contextmanager
def connected(cluster: str, workers: int, folder: Path, writes: bool = True) -> Iterator[Cluster]:
    """Connect to a cluster for the time of a block, checked for a shared folder.

    Args:
        cluster: `dask:tcp://HOST:PORT` of a running scheduler; `dask:slurm` or `dask:slurm:FILE`, which starts
            `workers` SLURM jobs by dask-jobqueue, with its settings or those of a YAML file.
        workers: number of jobs to start.
        folder: folder of the output, or of the input of a job that writes nothing.
        writes: whether a file may be written into it.

    Raises:
        DataError: if `cluster` is none of these.
        AppoccError: if the extra is missing, no scheduler or worker answers, or a check fails.
    """
    address = cluster.removeprefix(_SCHEME)
    if not cluster.startswith(_SCHEME) or not address:
        raise DataError(f"--cluster: expected {LOCAL}, dask:tcp://HOST:PORT or dask:slurm[:FILE], got '{cluster}'")
    distributed = import_extra("distributed", "cluster", "--cluster")
    kind, _, file = address.partition(":")
    started = _started_slurm(file, workers) if kind == _SLURM else None
    try:
        try:
            client = distributed.Client(started or address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            reason = str(error).splitlines()[0]
            raise AppoccError(f"--cluster: no Dask scheduler answers at {address} ({reason})") from error
        with client:
            found = Cluster(client)
            _await_workers(client, address, 1 if started is None else workers)
            found.check(folder, writes)
            yield found
    finally:
        if started is not None:
            started.close()


def _await_workers(client: Any, address: str, count: int) -> None:
    try:
        client.wait_for_workers(count, timeout=_CONNECT_S if count == 1 else 600)
    except TimeoutError as error:
        raise AppoccError(f"--cluster: expected a worker of the scheduler at {address}, got none") from error


def _started_slurm(file: str, workers: int) -> Any:
    jobqueue = import_extra("dask_jobqueue", "cluster", "--cluster dask:slurm")
    settings = read_yaml(file) if file else {}
    try:
        started = jobqueue.SLURMCluster(**{"cores": 1, "processes": 1, **settings})
        started.scale(jobs=workers)
    except (OSError, TypeError, ValueError) as error:
        where = f"--cluster: {file or _SLURM}"
        raise DataError(f"{where}: expected settings of dask_jobqueue.SLURMCluster ({error})") from error
    return started


def own_versions() -> dict[str, str]:
    """Return the versions that decide about results."""
    from importlib.metadata import PackageNotFoundError, version

    found = {"appocc": __version__, "Python": ".".join(platform.python_version_tuple()[:2])}
    for name in _PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _difference(mine: Mapping[str, str], theirs: Mapping[str, str]) -> str:
    name = next(name for name in {**mine, **theirs} if mine.get(name) != theirs.get(name))
    return f"expected {name} {mine.get(name, 'not installed')}, got {theirs.get(name, 'not installed')}"


def _sees(path: Path) -> bool:
    return path.exists()


def _name_of(job: Callable[..., Any]) -> str:
    """Return the name of a function, of what a partial one calls, or of the class of a job."""
    if isinstance(job, partial):
        return _name_of(job.func)
    return str(getattr(job, "__name__", type(job).__name__)).strip("_")


def _existing(folder: Path) -> Path:
    """Return the nearest folder that exists."""
    folder = folder.absolute()
    return next(each for each in (folder, *folder.parents) if each.is_dir())


def _run(job: Callable[[T], R], items: Sequence[T], versions: Mapping[str, str]) -> list[R]:
    """Run a chunk on a worker; one that joined later may have other versions."""
    if own_versions() != versions:
        raise AppoccError(f"worker on {platform.node()}: {_difference(versions, own_versions())}")
    cv2.setNumThreads(1)
    return [job(item) for item in items]
