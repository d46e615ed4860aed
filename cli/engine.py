"""Where long commands compute: processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import say

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


def shared(cluster: str, path: Path) -> Path:
    """Return a path as all workers of a cluster can read it: absolute."""
    return path if cluster == LOCAL else path.absolute()


@contextmanager
def engine(cluster: str, workers: int, folder: Path) -> Iterator[Engine | None]:
    """Yield what runs the jobs of a command that writes into `folder`; None: this process, one job after the other.

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

    with connected(cluster, workers, folder) as found:
        say(f"{cluster}: {found.size} workers; dashboard: {found.dashboard}")
        yield found
