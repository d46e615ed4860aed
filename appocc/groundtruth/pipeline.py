"""Ground-truth pipeline: colour the sweeps and compose the samples in parallel; resumes by sample."""

from __future__ import annotations

import hashlib
import pickle
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.bevmap import BEVMap, bev_folder, bev_path, picture_path
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import MOST_TEXT_BYTES, RemotePath, read_file, write_bytes, write_image
from appocc.files.transfer import working_folder
from appocc.groundtruth.bodywork import BodyworkSamples
from appocc.groundtruth.colouring import ColouredPoints, colour_sweep
from appocc.groundtruth.compose import GroundTruthSettings, compose_map, vehicles_near
from appocc.groundtruth.inputs import SampleInput, SceneInputs, gather_inputs
from appocc.groundtruth.occupancy import RoadSources
from appocc.groundtruth.painting import BoxColours, bodywork_by_box, mode_colours, robust_colours
from appocc.groundtruth.scene_jobs import SceneJobs
from appocc.groundtruth.store import PointStore
from appocc.groundtruth.surface import GroundSurface, build_surface, exposure_gains
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.maps import mask_window, vector_map
from appocc.nuscenes.records import Scene
from appocc.nuscenes.writer import token_of
from appocc.provenance import Parts, Record, add_record, scene_parts
from appocc.temporary import made_folder, partial_folder
from appocc.visualization.canvas import preview
from appocc.workers import Engine

SOURCE = "groundtruth"


class GenerationSummary(NamedTuple):
    """Counts of a run; `stale`: number of outdated maps that were replaced, by reason."""

    made: int
    kept: int
    folder: Path
    stale: dict[str, int]


def generate(
    dataset: Dataset,
    scenes: Sequence[Scene],
    out: Path,
    settings: GroundTruthSettings,
    pool: Engine | None,
    advance: Callable[[float], None],
) -> GenerationSummary:
    """Write BEV map and picture of every sample of the scenes below `out`; up-to-date maps are kept.

    `advance` is the progress callback in samples; colouring and painting of a whole scene count as parts of its
    samples. The result does not depend on the pool.

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
    for scene in scenes:
        samples, titles = dataset.samples(scene), dataset.titles(scene)
        parts = scene_parts(dataset, scene)
        missing = set()
        for path in (bev_path(out, SOURCE, sample.token) for sample in samples):
            picture = picture_path(path.parent, titles[path.stem])
            reason = record.why_remake(path, picture, parts, why_stale)
            if reason is not None:
                missing.add(path.stem)
                stale.update([reason] if reason else [])
        kept += len(samples) - len(missing)
        advance(len(samples) - len(missing))
        if missing:
            made += _process_scene(
                dataset=dataset,
                scene=scene,
                missing=missing,
                out=out,
                settings=settings,
                pool=pool,
                advance=advance,
                parts=parts,
            )
    record.tidy()
    return GenerationSummary(made, kept, bev_folder(out, SOURCE), dict(stale))


def _why_stale(path: Path, settings: GroundTruthSettings) -> str:
    """Return why an existing map was not made with these settings; '' if it was."""
    try:
        return "" if BEVMap.load(path).meta.get("settings") == settings.as_meta() else "settings changed"
    except DataError:
        return "damaged"


def _process_scene(
    dataset: Dataset,
    scene: Scene,
    missing: set[str],
    out: Path,
    settings: GroundTruthSettings,
    pool: Engine | None,
    advance: Callable[[float], None],
    parts: Parts,
) -> int:
    inputs = gather_inputs(dataset, scene)
    jobs = SceneJobs(pool, advance, len(missing))
    with _scratch(out, scene) as folder:
        surface, gains = reconstruct_ground(inputs, jobs, folder)
        pairs = zip(inputs.samples, _paint(inputs, gains, settings, jobs), strict=True)
        wanted = [(sample, painted) for sample, painted in pairs if sample.token in missing]
        titles = dataset.titles(scene)
        with _shared(_sources(dataset, scene, inputs, surface), folder, out, scene) as sources:
            job = partial(_process_sample, sources=sources, out=out, settings=settings, parts=parts, titles=titles)
            jobs.run(job, wanted, 1.0)
    return len(wanted)


class _SharedSources(NamedTuple):
    """The file of the sources of a scene that all workers read, with its digest: only what this run wrote is read."""

    path: Path
    sha256: str


@contextmanager
def _shared(sources: RoadSources, folder: Path, out: Path, scene: Scene) -> Iterator[_SharedSources]:
    """Write the sources of a scene where all workers read them: in the folder, or next to remote maps."""
    place = bev_folder(out, SOURCE)
    remote = isinstance(place, RemotePath)
    path = place / f".{token_of('scene', scene.token)}.sources" if remote else folder / "sources.pickle"
    data = pickle.dumps(sources)
    write_bytes(path, data)
    try:
        yield _SharedSources(path, hashlib.sha256(data).hexdigest())
    finally:
        if remote:
            path.unlink()


@contextmanager
def _scratch(out: Path, scene: Scene) -> Iterator[Path]:
    """Create a temporary folder for a scene, next to the maps, where another run finds it, or for remote maps here.

    Raises:
        DataError: if another run uses it, or it cannot be created.
    """
    place = bev_folder(out, SOURCE) / token_of("scene", scene.token)
    if isinstance(place, RemotePath):
        place = working_folder(place)
    try:
        with made_folder(place.parent), partial_folder(place) as folder:
            yield folder
    except OSError as error:
        raise DataError(f"{error.filename or place.parent}: cannot be written ({error.strerror or error})") from error


def reconstruct_ground(
    inputs: SceneInputs, jobs: SceneJobs, folder: Path
) -> tuple[GroundSurface, dict[str, FloatArray]]:
    """Reconstruct the coloured ground of a scene; return it and the exposure gains (3,) by channel.

    The coloured points are stored in an empty folder meanwhile.

    Raises:
        DataError: if a sweep, its labels or an image is damaged.
    """
    origin = inputs.samples[0].world_from_ego[:3, 3]
    channels = tuple(sorted({view.camera.channel for sweep in inputs.sweeps for view in sweep.rounds[0]}))
    job = partial(colour_sweep, origin_m=origin, channels=channels)
    store = PointStore(folder)

    def stored() -> Iterator[ColouredPoints]:
        for points in jobs.run_lazily(job, inputs.sweeps, 0.6):
            store.add(points)
            yield points

    gains = exposure_gains(stored(), len(channels))
    return build_surface(store, origin, gains), dict(zip(channels, gains.factors, strict=True))


def _paint(
    inputs: SceneInputs, gains: Mapping[str, FloatArray], settings: GroundTruthSettings, jobs: SceneJobs
) -> Sequence[BoxColours | None]:
    """Return the vehicle colours of all samples: the robust colour needs the whole scene."""
    if not inputs.annotated:
        return [None] * len(inputs.samples)
    if settings.paint == "mode":
        return jobs.run(partial(_mode_colours, settings=settings), inputs.samples, 0.5)
    job = partial(_bodywork, gains=gains, settings=settings)
    return robust_colours(inputs.samples, jobs.run(job, inputs.samples, 0.5))


def _mode_colours(sample: SampleInput, settings: GroundTruthSettings) -> BoxColours:
    return mode_colours(sample, vehicles_near(sample, settings.grid))


def _bodywork(
    sample: SampleInput, gains: Mapping[str, FloatArray], settings: GroundTruthSettings
) -> list[list[BodyworkSamples]]:
    return bodywork_by_box(sample, vehicles_near(sample, settings.grid), gains)


def _sources(dataset: Dataset, scene: Scene, inputs: SceneInputs, surface: GroundSurface) -> RoadSources:
    """Return the road and lane sources shared by the samples of a scene."""
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
def _read_sources(written: _SharedSources) -> RoadSources:
    data = read_file(written.path, MOST_TEXT_BYTES)
    if hashlib.sha256(data).hexdigest() != written.sha256:
        raise DataError(f"{written.path}: in use by another run")
    sources: RoadSources = pickle.loads(data)
    return sources


def _process_sample(
    wanted: tuple[SampleInput, BoxColours | None],
    sources: _SharedSources,
    out: Path,
    settings: GroundTruthSettings,
    parts: Parts,
    titles: Mapping[str, str],
) -> None:
    """Compose and write one sample; the map is written last, so that every map has a picture."""
    sample, painted = wanted
    bev = compose_map(sample, _read_sources(sources), painted, settings)
    path = bev_path(out, SOURCE, sample.token)
    write_image(picture_path(path.parent, titles[sample.token]), preview(bev, EgoVehicle()))
    bev.save(path)
    add_record(path.parent, path.stem, parts)
