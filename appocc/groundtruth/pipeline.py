"""Ground-truth BEVs of datasets: sweeps coloured and samples composed in parallel, resumed by sample."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple, TypeVar

import cv2
import numpy as np

from appocc.bevmap import BEVMap, bev_path
from appocc.drawing import preview
from appocc.errors import DataError
from appocc.files import write_bytes, write_image
from appocc.groundtruth.colouring import colour_sweep
from appocc.groundtruth.compose import Settings, compose, vehicles_near
from appocc.groundtruth.inputs import SampleInput, SceneInputs, gather
from appocc.groundtruth.occupancy import RoadSources
from appocc.groundtruth.painting import Painted, paint_sample, pool_over_time
from appocc.groundtruth.surface import build_surface, exposure_gains
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.maps import mask_window, vector_map
from appocc.nuscenes.records import Scene

SOURCE = "groundtruth"
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
T = TypeVar("T")
R = TypeVar("R")


class Summary(NamedTuple):
    """Counts of a run."""

    made: int
    kept: int
    folder: Path


def generate(
    dataset: Dataset,
    scenes: Sequence[Scene],
    out: Path,
    settings: Settings,
    workers: int,
    advance: Callable[[int], None],
) -> Summary:
    """Write the BEV map and preview of every sample of the scenes below `out`; maps that are there already are kept.

    `advance` is called with the number of samples done. The result does not depend on `workers`.

    Raises:
        DataError: if a file of the dataset is damaged, or `out` cannot be written.
    """
    made = kept = 0
    with _workers(workers) as pool:
        for scene in scenes:
            samples = dataset.samples(scene)
            missing = {s.token for s in samples if not _is_there(bev_path(out, SOURCE, s.token), settings)}
            kept += len(samples) - len(missing)
            advance(len(samples) - len(missing))
            if missing:
                made += _make_scene(dataset, scene, missing, out, settings, pool, advance)
    return Summary(made, kept, bev_path(out, SOURCE, "").parent)


def _is_there(path: Path, settings: Settings) -> bool:
    """Whether a whole map made with the same settings lies there, with its picture."""
    if not (path.is_file() and path.with_suffix(".png").is_file()):
        return False
    try:
        return bool(BEVMap.load(path).meta.get("settings") == settings.as_meta())
    except DataError:  # whatever is wrong with it, it is made anew
        return False


def _make_scene(
    dataset: Dataset,
    scene: Scene,
    missing: set[str],
    out: Path,
    settings: Settings,
    pool: Executor | None,
    advance: Callable[[int], None],
) -> int:
    inputs = gather(dataset, scene)
    pairs = zip(inputs.samples, _paint(inputs, settings, pool), strict=True)
    wanted = [(sample, painted) for sample, painted in pairs if sample.token in missing]
    with tempfile.TemporaryDirectory(prefix="appocc-") as folder:
        sources = Path(folder) / "sources.pickle"  # our own file, read back by our own workers only
        write_bytes(sources, pickle.dumps(_sources(dataset, scene, inputs, pool)))
        job = partial(_make_sample, sources=sources, out=out, settings=settings)
        for _ in _in_order(pool, job, wanted):
            advance(1)
    return len(wanted)


def _paint(inputs: SceneInputs, settings: Settings, pool: Executor | None) -> Sequence[Painted | None]:
    """Colours of the vehicles of each sample; of all samples, as the robust colour is one for the whole scene."""
    if not inputs.annotated:
        return [None] * len(inputs.samples)
    painted = list(_in_order(pool, partial(_paint_sample, settings=settings), inputs.samples))
    return pool_over_time(inputs.samples, painted) if settings.paint == "robust" else painted


def _paint_sample(sample: SampleInput, settings: Settings) -> Painted:
    return paint_sample(sample, vehicles_near(sample, settings.grid), settings.paint)


def _sources(dataset: Dataset, scene: Scene, inputs: SceneInputs, pool: Executor | None) -> RoadSources:
    """Everything that the samples of a scene share."""
    origin = inputs.samples[0].world_from_ego[:3, 3]
    channels = tuple(sorted({view.camera.channel for sweep in inputs.sweeps for view in sweep.rounds[0]}))
    job = partial(colour_sweep, origin_m=origin, channels=channels)
    coloured = list(_in_order(pool, job, inputs.sweeps))
    surface = build_surface(coloured, origin, exposure_gains(coloured, len(channels)))
    places = np.stack([sample.world_from_ego[:2, 3] for sample in inputs.samples])
    low, high = places.min(axis=0) - 60, places.max(axis=0) + 60
    vector = vector_map(dataset, scene)
    labels = [sweep.labels for sweep in inputs.sweeps if sweep.labels is not None]
    return RoadSources(
        None if vector is None else vector.near(low, high),
        mask_window(dataset, scene, low, high),
        surface,
        (bool(labels), any(label.is_lane is not None for label in labels), labels[0].source if labels else ""),
    )


@lru_cache(maxsize=1)
def _read_sources(path: Path) -> RoadSources:
    sources: RoadSources = pickle.loads(path.read_bytes())
    return sources


def _make_sample(wanted: tuple[SampleInput, Painted | None], sources: Path, out: Path, settings: Settings) -> None:
    """Compose and write one sample; the map comes last, so that a map is never without its picture."""
    sample, painted = wanted
    bev = compose(sample, _read_sources(sources), painted, settings)
    path = bev_path(out, SOURCE, sample.token)
    write_image(path.with_suffix(".png"), preview(bev))
    bev.save(path)


# Workers ----------------------------------------------------------------------------------------------------------


@contextmanager
def _workers(count: int) -> Iterator[Executor | None]:
    """A pool of fresh processes, one thread each; None for a single worker, which needs no pool."""
    if count <= 1:
        yield None
        return
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _start_worker)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start_worker() -> None:
    """In a worker: one thread, and Ctrl-C is the parent's business."""
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _in_order(pool: Executor | None, job: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
    """Results of `job` in the order of the items, whoever did them."""
    if pool is None:
        yield from map(job, items)
    else:
        yield from pool.map(job, items, chunksize=2)
