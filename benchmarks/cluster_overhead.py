"""Time of a Dask cluster of this machine against processes of `--workers`, on the same scenes of the simulator.

Run: OMP_NUM_THREADS=1 python -m benchmarks.cluster_overhead [--scenes 40] [--workers 2] [--repeats 3]
A scene is one frame. Both have warm workers: they have simulated some scenes of both towns before the clock starts.
Runs alternate, so that other load hits both. Prints medians of the seconds, of the processor seconds of all processes
(client, scheduler, workers), and of those in which the client alone puts the dataset together at the end; what Dask
costs more, in percent; the processor seconds of an idle cluster; and checks that both write the same bytes.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

import psutil

from appocc.cluster import connected
from appocc.errors import AppoccError
from appocc.files import read_json
from appocc.rigs import read_source_rig
from appocc.simulation.generate import DatasetSettings, simulate
from appocc.simulation.recording import RecordingSettings
from appocc.simulation.scenario import WEATHER_SHARES
from appocc.simulation.sources import town_sources
from appocc.workers import Engine, worker_pool

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
IDLE_S = 15


class Cost(NamedTuple):
    """Seconds of a run: by the clock, of all processors, and processor seconds of the client after the last scene."""

    wall_s: float
    processor_s: float
    merging_s: float


def settings(scenes: int) -> DatasetSettings:
    """Scenes of one frame in two towns, without LiDAR."""
    recording = RecordingSettings(1, 2.0, read_source_rig("paper").rig, lidar=False)
    towns = town_sources("train", ())[:2]
    return DatasetSettings(scenes, towns, tuple(WEATHER_SHARES), seed=1, recording=recording)


@contextmanager
def dask_cluster(folder: Path, workers: int) -> Iterator[tuple[Engine, list[int]]]:
    """Yield a cluster of a scheduler and workers as processes on loopback, and their ids."""
    environment = os.environ | dict.fromkeys(ONE_THREAD, "1") | {"PYTHONPATH": os.pathsep.join(sys.path)}
    file = folder / "scheduler.json"
    place = ["--scheduler-file", str(file), "--no-dashboard", "--host", "127.0.0.1"]
    commands = [["scheduler", *place, "--port", "0"]]
    commands += [["worker", *place, "--no-nanny", "--nthreads", "1"]] * workers
    ids: list[int] = []
    with ExitStack() as opened:
        for command in commands:
            words = [sys.executable, "-m", "dask", *command]
            started = subprocess.Popen(words, env=environment, stderr=subprocess.DEVNULL)
            opened.callback(started.wait)
            opened.callback(started.terminate)
            ids.append(started.pid)
            wait_for(file.is_file)
        with connected(f"dask:{read_json(file)['address']}", workers, folder) as cluster:
            wait_for(lambda: cluster.size == workers)
            yield cluster, ids


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait for at most two minutes."""
    deadline = time.monotonic() + 120
    while not condition():
        if time.monotonic() > deadline:
            raise AppoccError("the cluster did not start in two minutes")
        time.sleep(0.1)


def processor_s(ids: list[int]) -> float:
    """Return the processor seconds so far of this process and others."""
    times = [psutil.Process(number).cpu_times() for number in [os.getpid(), *ids]]
    return float(sum(each.user + each.system for each in times))


def timed(out: Path, scenes: int, engine: Engine | None, ids: list[int]) -> Cost:
    """Simulate once."""
    shutil.rmtree(out, ignore_errors=True)
    start, before = time.perf_counter(), processor_s(ids)
    last = time.process_time()

    def advance(count: float) -> None:
        nonlocal last
        last = time.process_time()

    simulate(out, settings(scenes), engine, advance)
    merging_s = time.process_time() - last
    return Cost(time.perf_counter() - start, processor_s(ids) - before, merging_s)


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, default in (("scenes", 40), ("workers", 2), ("repeats", 3)):
        parser.add_argument(f"--{name}", type=int, default=default)
    options = parser.parse_args()
    costs: dict[str, list[Cost]] = {"local": [], "dask": []}
    with tempfile.TemporaryDirectory() as name, ExitStack() as opened:
        folder = Path(name)
        pool = opened.enter_context(worker_pool(options.workers))
        cluster, dask_ids = opened.enter_context(dask_cluster(folder, options.workers))
        for kind, engine in (("local", pool), ("dask", cluster)):
            simulate(folder / f"warm-{kind}", settings(4 * options.workers), engine, lambda count: None)
        local_ids = [child.pid for child in multiprocessing.active_children() if child.pid is not None]
        for _ in range(options.repeats):
            for kind, engine, ids in (("local", pool, local_ids), ("dask", cluster, dask_ids)):
                costs[kind].append(timed(folder / kind, options.scenes, engine, ids))
                print(kind, *(f"{each:.1f}" for each in costs[kind][-1]), flush=True)
        before = processor_s(dask_ids)
        time.sleep(IDLE_S)
        idle = (processor_s(dask_ids) - before) / IDLE_S
        if contents(folder / "local") != contents(folder / "dask"):
            raise AppoccError("expected the same bytes from both, got others")
    print(
        f"{options.scenes} scenes, {options.workers} workers, load average {os.getloadavg()[0]:.1f}; the same bytes"
    )
    print(f"idle cluster: {idle:.3f} processor seconds a second")
    local, dask = (Cost(*map(median, zip(*costs[kind], strict=True))) for kind in ("local", "dask"))
    for what, a, b in zip(("seconds", "processor seconds", "merging, processor seconds"), local, dask, strict=True):
        print(f"{what}: local {a:.2f}, dask {b:.2f}, {100 * (b / a - 1):+.1f} %")


if __name__ == "__main__":
    main()
