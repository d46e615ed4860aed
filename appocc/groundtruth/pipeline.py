"""Ground-truth BEVs of datasets: sweeps coloured and samples composed in parallel, resumed by sample."""

from __future__ import annotations

import pickle
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.bevmap import BEVMap, bev_folder, bev_path
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import write_bytes, write_image
from appocc.groundtruth.bodywork import Bodywork
from appocc.groundtruth.colouring import ColouredPoints, colour_sweep
from appocc.groundtruth.compose import Settings, compose, vehicles_near
from appocc.groundtruth.inputs import SampleInput, SceneInputs, gather
from appocc.groundtruth.occupancy import RoadSources
from appocc.groundtruth.painting import Painted, bodies_of, paint_mode_of, paint_scene
from appocc.groundtruth.store import PointStore
from appocc.groundtruth.surface import Surface, build_surface, exposure_gains
from appocc.groundtruth.work import Work
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.maps import mask_window, vector_map
from appocc.nuscenes.records import Scene
from appocc.nuscenes.writer import token_of
from appocc.provenance import Parts, Record, add_record, scene_parts
from appocc.temporary import made_folder, partial_folder
from appocc.visualization.canvas import preview
from appocc.workers import Pool, worker_pool

SOURCE = "groundtruth"


class Summary(NamedTuple):
    """Counts of a run; `stale`: maps that were there and were made anew, by the reason."""

    made: int
    kept: int
    folder: Path
    stale: dict[str, int]


def generate(
    dataset: Dataset,
    scenes: Sequence[Scene],
    out: Path,
    settings: Settings,
    workers: int,
    advance: Callable[[float], None],
) -> Summary:
    """Write the BEV map and preview of every sample of the scenes below `out`; maps of the same inputs are kept.

    `advance` is called with the samples done, in parts: painting and colouring, which come first for a whole scene,
    count too. The result does not depend on `workers`.

    Raises:
        DataError: if a file of the dataset is damaged, there are no samples, or `out` cannot be written.
    """
    if not any(dataset.samples(scene) for scene in scenes):
        names = ", ".join(scene.name for scene in scenes[:6])
        raise DataError(f"{dataset.root}: no key frames (scenes: {names or 'none'})")
    made = kept = 0
    stale: Counter[str] = Counter()
    record = Record(bev_folder(out, SOURCE))
    why_stale = partial(_why_stale, settings=settings)
    with worker_pool(workers) as pool:
        for scene in scenes:
            samples = dataset.samples(scene)
            parts = scene_parts(dataset, scene)
            missing = set()
            for path in (bev_path(out, SOURCE, sample.token) for sample in samples):
                reason = record.why_remake(path, path.with_suffix(".png"), parts, why_stale)
                if reason is not None:
                    missing.add(path.stem)
                    stale.update([reason] if reason else [])
            kept += len(samples) - len(missing)
            advance(len(samples) - len(missing))
            if missing:
                made += _make_scene(dataset, scene, missing, out, settings, pool, advance, parts)
    record.tidy()
    return Summary(made, kept, bev_folder(out, SOURCE), dict(stale))


def _why_stale(path: Path, settings: Settings) -> str:
    """Why a map that is there was not made with these settings; '' if it was."""
    try:
        return "" if BEVMap.load(path).meta.get("settings") == settings.as_meta() else "settings changed"
    except DataError:
        return "damaged"


def _make_scene(
    dataset: Dataset,
    scene: Scene,
    missing: set[str],
    out: Path,
    settings: Settings,
    pool: Pool | None,
    advance: Callable[[float], None],
    parts: Parts,
) -> int:
    inputs = gather(dataset, scene)
    work = Work(pool, advance, len(missing))
    with _scratch(out, scene) as folder:
        surface, gains = ground_of(inputs, work, folder)
        pairs = zip(inputs.samples, _paint(inputs, gains, settings, work), strict=True)
        wanted = [(sample, painted) for sample, painted in pairs if sample.token in missing]
        sources = folder / "sources.pickle"  # our own file, read back by our own workers only
        write_bytes(sources, pickle.dumps(_sources(dataset, scene, inputs, surface)))
        work.done(partial(_make_sample, sources=sources, out=out, settings=settings, parts=parts), wanted, 1.0)
    return len(wanted)


@contextmanager
def _scratch(out: Path, scene: Scene) -> Iterator[Path]:
    """A folder for what the workers share of a scene; beside the maps, where another run of it is noticed.

    Raises:
        DataError: if there is one, or the folder cannot be made.
    """
    place = bev_folder(out, SOURCE) / token_of("scene", scene.token)
    try:
        with made_folder(place.parent), partial_folder(place) as folder:
            yield folder
    except OSError as error:
        raise DataError(f"{error.filename or place.parent}: cannot be written ({error.strerror or error})") from error


def ground_of(inputs: SceneInputs, work: Work, folder: Path) -> tuple[Surface, dict[str, FloatArray]]:
    """The ground of a scene, and the factors (3,) by channel that even the cameras' colours out.

    What the sweeps show is kept in an empty folder meanwhile.

    Raises:
        DataError: if a sweep, its labels or an image is damaged.
    """
    origin = inputs.samples[0].world_from_ego[:3, 3]
    channels = tuple(sorted({view.camera.channel for sweep in inputs.sweeps for view in sweep.rounds[0]}))
    job = partial(colour_sweep, origin_m=origin, channels=channels)
    store = PointStore(folder)

    def stored() -> Iterator[ColouredPoints]:
        for points in work.each(job, inputs.sweeps, 0.6):
            store.add(points)
            yield points

    gains = exposure_gains(stored(), len(channels))
    return build_surface(store, origin, gains), dict(zip(channels, gains.factors, strict=True))


def _paint(
    inputs: SceneInputs, gains: Mapping[str, FloatArray], settings: Settings, work: Work
) -> Sequence[Painted | None]:
    """Colours of the vehicles of each sample; of all samples, as the robust colour is one for the whole scene."""
    if not inputs.annotated:
        return [None] * len(inputs.samples)
    if settings.paint == "mode":
        return work.done(partial(_mode, settings=settings), inputs.samples, 0.5)
    job = partial(_bodies, gains=gains, settings=settings)
    return paint_scene(inputs.samples, work.done(job, inputs.samples, 0.5))


def _mode(sample: SampleInput, settings: Settings) -> Painted:
    return paint_mode_of(sample, vehicles_near(sample, settings.grid))


def _bodies(sample: SampleInput, gains: Mapping[str, FloatArray], settings: Settings) -> list[list[Bodywork]]:
    return bodies_of(sample, vehicles_near(sample, settings.grid), gains)


def _sources(dataset: Dataset, scene: Scene, inputs: SceneInputs, surface: Surface) -> RoadSources:
    """Everything that the samples of a scene share."""
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


def _make_sample(
    wanted: tuple[SampleInput, Painted | None], sources: Path, out: Path, settings: Settings, parts: Parts
) -> None:
    """Compose and write one sample; the map comes last, so that a map is never without its picture."""
    sample, painted = wanted
    bev = compose(sample, _read_sources(sources), painted, settings)
    path = bev_path(out, SOURCE, sample.token)
    write_image(path.with_suffix(".png"), preview(bev, EgoVehicle()))
    bev.save(path)
    add_record(path.parent, path.stem, parts)
