"""Where long commands compute: processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import in_path, say

if TYPE_CHECKING:
    from appocc.workers import Engine

LOCAL = "local"
ClusterOption = Annotated[
    str,
    typer.Option(
        "--cluster",
        metavar="CLUSTER",
        help="local; dask:tcp://HOST:PORT, a running Dask scheduler; dask:slurm[:FILE], SLURM jobs.",
    ),
]

ProcessesOption = Annotated[
    int | None, typer.Option("--workers", min=1, max=1024, help="Processes; default: one per core.")
]


# Key frames for which a process is worth its start, in jobs of milliseconds a frame.
_FRAMES_A_PROCESS = 50


def processes(workers: int | None, frames: int) -> int:
    """Return how many processes take part in a job of milliseconds a key frame: as wanted, else what is worth it."""
    from appocc.environment import cores

    return workers or max(1, min(cores(), frames // _FRAMES_A_PROCESS))


def shared(cluster: str, path: Path) -> Path:
    """Return a path as all workers of a cluster can read it: absolute."""
    return path if cluster == LOCAL else path.absolute()


def shared_source(cluster: str, source: str) -> str:
    """Return a source of maps as all workers of a cluster can read it: a folder is absolute, see `bev_folder`."""
    return str(shared(cluster, in_path(source))) if "/" in source else source


@contextmanager
def engine(cluster: str, workers: int, folder: Path, writes: bool = True) -> Iterator[Engine | None]:
    """Yield what runs the jobs of a command; None: this process, one job after the other.

    Args:
        cluster: value of `--cluster`.
        workers: number of processes of this machine, or of SLURM jobs.
        folder: folder that the workers of a cluster share: that of the output, or else of the input.
        writes: whether the command writes into it.

    Raises:
        DataError: if `cluster` is not valid.
        AppoccError: if the cluster cannot be used.
    """
    if cluster == LOCAL:
        from appocc.workers import worker_pool

        with worker_pool(workers) as pool:
            yield pool
        return
    from appocc.cluster import connected

    with connected(cluster, workers, folder, writes) as found:
        count = found.size
        say(f"{cluster}: {count} worker{'s' if count != 1 else ''}; dashboard: {found.dashboard}")
        yield found
