"""Generate a dataset of simulated scenes: parallel, resumable by scene, moved to its folder when complete."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from appocc.errors import DataError
from appocc.files import read_json, write_json
from appocc.nuscenes.writer import Writer
from appocc.simulation.recording import VERSION, RecordingSettings, build_town_simulation, record_scene, write_map
from appocc.simulation.scenario import Scenario, draw_scenario
from appocc.simulation.sources import TownSource
from appocc.temporary import locked, made_folder
from appocc.version import __version__
from appocc.workers import in_order, worker_pool

SETTINGS_FILE = "simulation.json"
_Job = tuple[Scenario, TownSource]
_SCENES, _TOWNS, _ROWS = "scenes", "towns", "rows.json"
# Files shared by the scenes of a town.
_SHARED = "shared"


@dataclass(frozen=True)
class DatasetSettings:
    """Settings that determine every byte of a dataset.

    Attributes:
        scenes: number of scenes.
        towns: used in turn.
        weathers: names to draw from.
        seed: random seed.
        recording: what each scene records.
    """

    scenes: int
    towns: tuple[TownSource, ...]
    weathers: tuple[str, ...]
    seed: int
    recording: RecordingSettings

    def as_json(self) -> dict[str, Any]:
        """Return the settings as JSON values, which are stored with the tables."""
        return {
            "appocc": __version__,
            "scenes": self.scenes,
            "towns": [town.as_json() for town in self.towns],
            "weathers": list(self.weathers),
            "seed": self.seed,
            **self.recording.as_json(),
        }


class SimulationCounts(NamedTuple):
    """Number of frames recorded by this run, and in total."""

    made: int
    frames: int


def simulate(
    out: Path,
    settings: DatasetSettings,
    workers: int,
    advance: Callable[[float], None],
    notify: Callable[[str], None] = lambda text: None,
) -> SimulationCounts:
    """Record a dataset below `out`; `advance` gets the number of finished frames, `notify` a line before slow steps.

    The result depends neither on `workers` nor on interruptions: finished scenes are kept in a hidden folder next to
    `out`, and the same call resumes from them.

    Raises:
        DataError: if `out` holds something else or cannot be written, or a town cannot be simulated.
    """
    out = _resolved(out)
    total = settings.scenes * settings.recording.frames
    if _is_finished(out, settings):
        shutil.rmtree(unfinished_folder(out), ignore_errors=True)  # left by a run that was killed at its very end
        advance(total)
        return SimulationCounts(0, total)
    with _working_folder(out, settings) as work:
        kept = count_finished_scenes(out)
        if kept:
            notify(f"{out}: resuming after {kept} of {settings.scenes} scenes")
        for town in settings.towns[: settings.scenes]:
            if not town.is_prepared(work / _TOWNS):
                notify(f"{town.name}: generating streets and traffic, which takes about a minute")
                town.prepare(work / _TOWNS)
        scenarios = [_draw_scene(number, settings, work) for number in range(settings.scenes)]
        left = [scene for scene in scenarios if not (work / _SCENES / scene.name / _ROWS).is_file()]
        advance((len(scenarios) - len(left)) * settings.recording.frames)
        # Scenes of a town follow each other, so that a worker rarely has to build another town.
        left.sort(key=lambda scene: (scene.town, scene.number))
        _record(left, settings, work, workers, advance)
        _assemble(scenarios, settings, work)
        _publish(work / "dataset", out)
    return SimulationCounts(len(left) * settings.recording.frames, total)


def unfinished_folder(out: Path) -> Path:
    """Return the folder with the finished scenes of an interrupted run."""
    out = _resolved(out)
    return out.parent / f".{out.name}.unfinished"


def count_finished_scenes(out: Path) -> int:
    """Return the number of scenes an interrupted run has finished."""
    return len(list(unfinished_folder(out).glob(f"{_SCENES}/*/{_ROWS}")))


def _resolved(out: Path) -> Path:
    """Resolve the output folder if it is a link or ends in dots."""
    return out.resolve() if out.is_symlink() or out.name in ("", "..") else out


def _is_finished(out: Path, settings: DatasetSettings) -> bool:
    """Return whether `out` already is the finished dataset.

    Raises:
        DataError: if `out` holds anything else, or cannot be replaced by a finished dataset.
    """
    if out.is_mount() or out.resolve() == Path.cwd():
        raise DataError(f"{out}: expected a new folder, got the working folder or a mounted disk; name one in it")
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return False
    if out.is_dir() and (out / SETTINGS_FILE).is_file():
        other = _differences(read_json(out / SETTINGS_FILE), settings)
        if not other:
            return True
        raise DataError(f"{out}: holds a simulation with other settings ({other}); name a new folder")
    raise DataError(f"{out}: exists already; name a new folder")


def _differences(kept: Any, settings: DatasetSettings) -> str:
    """Return the names of the settings that differ from those stored in a file, empty if there are none."""
    asked = json.loads(json.dumps(settings.as_json()))  # as they are after writing and reading
    if not isinstance(kept, dict):
        return "all"
    missing = object()
    names = (*asked, *(name for name in kept if name not in asked))
    return ", ".join(name for name in names if kept.get(name, missing) != asked.get(name, missing))


@contextmanager
def _working_folder(out: Path, settings: DatasetSettings) -> Iterator[Path]:
    """Lock and yield the working folder; it keeps its finished scenes when the block is interrupted.

    Raises:
        DataError: if it belongs to other settings or to a running process, or cannot be written.
    """
    work = unfinished_folder(out)
    try:
        with made_folder(work), locked(work / "lock", out):
            try:
                _check_settings(work, settings)
                yield work
            finally:
                for part in work.glob(f"{_SCENES}/*.part"):
                    shutil.rmtree(part, ignore_errors=True)
                if not any(work.glob(f"{_SCENES}/*")):
                    shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        raise DataError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from error


def _check_settings(work: Path, settings: DatasetSettings) -> None:
    kept = work / SETTINGS_FILE
    if kept.is_file() and (other := _differences(read_json(kept), settings)):
        if any(work.glob(f"{_SCENES}/*/{_ROWS}")):
            raise DataError(f"{work}: left by a run with other settings ({other}); resume with those, or remove it")
        for name in (_SCENES, _TOWNS, _SHARED):  # nothing is lost
            shutil.rmtree(work / name, ignore_errors=True)
    write_json(kept, settings.as_json())


def _draw_scene(number: int, settings: DatasetSettings, work: Path) -> Scenario:
    source = settings.towns[number % len(settings.towns)]
    _, log = source.load(work / _TOWNS)
    seconds = (settings.recording.frames - 1) / settings.recording.hz
    return draw_scenario(
        number, source.name, log, seconds, settings.weathers, seed=settings.seed, hz=settings.recording.hz
    )


def _record(
    scenarios: Sequence[Scenario],
    settings: DatasetSettings,
    work: Path,
    workers: int,
    advance: Callable[[float], None],
) -> None:
    sources = {town.name: town for town in settings.towns}
    jobs: list[_Job] = [(scenario, sources[scenario.town]) for scenario in scenarios]
    with worker_pool(min(workers, len(jobs))) as pool:
        job = partial(_record_one, recording=settings.recording, work=work)
        for frames in in_order(pool, partial(job, advance=None if pool else advance), jobs):
            advance(frames)


def _record_one(job: _Job, recording: RecordingSettings, work: Path, advance: Callable[[float], None] | None) -> int:
    """Record a scene into its own folder; return the number of frames not yet reported to `advance`."""
    scenario, source = job
    place = work / _SCENES / scenario.name
    part = place.with_suffix(".part")
    shutil.rmtree(part, ignore_errors=True)

    writer, simulation = Writer(part, VERSION), build_town_simulation(source, work / _TOWNS)
    write_map(simulation.town, source.name, work / _SHARED)
    record_scene(scenario, simulation, recording, writer, advance or (lambda frames: None))
    write_json(part / _ROWS, {"rows": writer.rows, "extra": writer.extra}, indent=None)
    part.replace(place)
    return recording.frames if advance is None else 0


def _assemble(scenarios: Sequence[Scenario], settings: DatasetSettings, work: Path) -> None:
    """Merge the scenes' files and rows into one dataset; the merge can be interrupted and repeated."""
    root = work / "dataset"
    for half in root.rglob(".*"):  # written by a run that was killed
        half.unlink()
    writer = Writer(root, VERSION)
    for scenario in scenarios:
        place = work / _SCENES / scenario.name
        found = read_json(place / _ROWS)
        writer.absorb(found["rows"], found["extra"])
        _move_files(place, root)
    _move_files(work / _SHARED, root)
    writer.save()
    write_json(root / SETTINGS_FILE, settings.as_json())


def _move_files(source: Path, target: Path) -> None:
    """Move the files below one folder to the same paths below another; rows and partial files stay."""
    for path in sorted(path for path in source.rglob("*") if path.is_file()):
        if path.name != _ROWS and not path.name.startswith("."):
            place = target / path.relative_to(source)
            place.parent.mkdir(parents=True, exist_ok=True)
            path.replace(place)


def _publish(dataset: Path, out: Path) -> None:
    """Move the finished dataset to its folder and remove the working folder."""
    if out.is_dir():
        out.rmdir()
    dataset.replace(out)
    shutil.rmtree(unfinished_folder(out), ignore_errors=True)
