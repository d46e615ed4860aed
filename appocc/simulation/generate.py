"""A dataset of simulated scenes: recorded in parallel, resumed by scene, put in its place when all is there."""

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
from appocc.simulation.recording import VERSION, Recipe, build_place, record_scene, write_map
from appocc.simulation.scenario import Scenario, draw_scenario
from appocc.simulation.sources import TownSource
from appocc.temporary import locked, made_folder
from appocc.version import __version__
from appocc.workers import in_order, worker_pool

SETTINGS_FILE = "simulation.json"
_Job = tuple[Scenario, TownSource]
_SCENES, _TOWNS, _ROWS = "scenes", "towns", "rows.json"
# What scenes of a town have in common.
_SHARED = "shared"


@dataclass(frozen=True)
class Settings:
    """What decides every byte of a dataset.

    Attributes:
        scenes: number of scenes.
        towns: taken in turn.
        weathers: names to draw from.
        seed: of everything that is drawn.
        recipe: what is recorded of a scene.
    """

    scenes: int
    towns: tuple[TownSource, ...]
    weathers: tuple[str, ...]
    seed: int
    recipe: Recipe

    def as_json(self) -> dict[str, Any]:
        """JSON values, kept beside the tables."""
        return {
            "appocc": __version__,
            "scenes": self.scenes,
            "towns": [town.as_json() for town in self.towns],
            "weathers": list(self.weathers),
            "seed": self.seed,
            **self.recipe.as_json(),
        }


class Summary(NamedTuple):
    """Counts of a run: frames made now and in all."""

    made: int
    frames: int


def simulate(
    out: Path,
    settings: Settings,
    workers: int,
    advance: Callable[[float], None],
    tell: Callable[[str], None] = lambda text: None,
) -> Summary:
    """Record a dataset below `out`; `advance` is called with the frames done, `tell` with what takes long.

    The result does not depend on `workers`, nor on whether the run was interrupted: finished scenes are kept in a
    hidden folder beside `out`, and the same call goes on from there.

    Raises:
        DataError: if `out` holds something else or cannot be written, or a town cannot be simulated.
    """
    out = _place(out)
    total = settings.scenes * settings.recipe.frames
    if _is_made(out, settings):
        shutil.rmtree(unfinished(out), ignore_errors=True)  # a run that was killed at its very end leaves it
        advance(total)
        return Summary(0, total)
    with _unfinished_folder(out, settings) as work:
        kept = finished_scenes(out)
        if kept:
            tell(f"{out}: going on after {kept} of {settings.scenes} scenes")
        for town in settings.towns[: settings.scenes]:
            if not town.is_prepared(work / _TOWNS):
                tell(f"{town.name}: making its streets and traffic, which takes a minute or so")
                town.prepare(work / _TOWNS)
        scenarios = [_draw(number, settings, work) for number in range(settings.scenes)]
        left = [scene for scene in scenarios if not (work / _SCENES / scene.name / _ROWS).is_file()]
        advance((len(scenarios) - len(left)) * settings.recipe.frames)
        # Scenes of a town follow each other, so that a worker seldom has to build another town.
        left.sort(key=lambda scene: (scene.town, scene.number))
        _record(left, settings, work, workers, advance)
        _assemble(scenarios, settings, work)
        _put(work / "dataset", out)
    return Summary(len(left) * settings.recipe.frames, total)


def unfinished(out: Path) -> Path:
    """Where the finished scenes of an interrupted run lie."""
    out = _place(out)
    return out.parent / f".{out.name}.unfinished"


def finished_scenes(out: Path) -> int:
    """How many scenes an interrupted run has left."""
    return len(list(unfinished(out).glob(f"{_SCENES}/*/{_ROWS}")))


def _place(out: Path) -> Path:
    """The folder that is meant, whatever links or dots lead to it."""
    return out.resolve() if out.is_symlink() or out.name in ("", "..") else out


def _is_made(out: Path, settings: Settings) -> bool:
    """Whether `out` is the finished dataset already.

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


def _differences(kept: Any, settings: Settings) -> str:
    """Names of the settings that are not those kept in a file, empty if there are none."""
    asked = json.loads(json.dumps(settings.as_json()))  # as they are once written and read
    if not isinstance(kept, dict):
        return "all"
    missing = object()
    names = (*asked, *(name for name in kept if name not in asked))
    return ", ".join(name for name in names if kept.get(name, missing) != asked.get(name, missing))


@contextmanager
def _unfinished_folder(out: Path, settings: Settings) -> Iterator[Path]:
    """The folder to work in, locked; it stays, with its finished scenes, when the block is interrupted.

    Raises:
        DataError: if it belongs to other settings or to a run that goes on, or cannot be written.
    """
    work = unfinished(out)
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


def _check_settings(work: Path, settings: Settings) -> None:
    kept = work / SETTINGS_FILE
    if kept.is_file() and (other := _differences(read_json(kept), settings)):
        if any(work.glob(f"{_SCENES}/*/{_ROWS}")):
            raise DataError(f"{work}: left by a run with other settings ({other}); go on with those, or remove it")
        for name in (_SCENES, _TOWNS, _SHARED):  # nothing is lost
            shutil.rmtree(work / name, ignore_errors=True)
    write_json(kept, settings.as_json())


def _draw(number: int, settings: Settings, work: Path) -> Scenario:
    source = settings.towns[number % len(settings.towns)]
    _, log = source.load(work / _TOWNS)
    seconds = (settings.recipe.frames - 1) / settings.recipe.hz
    return draw_scenario(number, source.name, log, seconds, settings.weathers, settings.seed, settings.recipe.hz)


def _record(
    scenarios: Sequence[Scenario], settings: Settings, work: Path, workers: int, advance: Callable[[float], None]
) -> None:
    sources = {town.name: town for town in settings.towns}
    jobs: list[_Job] = [(scenario, sources[scenario.town]) for scenario in scenarios]
    with worker_pool(min(workers, len(jobs))) as pool:
        job = partial(_record_one, recipe=settings.recipe, work=work)
        for frames in in_order(pool, partial(job, advance=None if pool else advance), jobs):
            advance(frames)


def _record_one(job: _Job, recipe: Recipe, work: Path, advance: Callable[[float], None] | None) -> int:
    """Record a scene into a folder of its own; returns the frames that `advance` has not been told of."""
    scenario, source = job
    place = work / _SCENES / scenario.name
    part = place.with_suffix(".part")
    shutil.rmtree(part, ignore_errors=True)

    writer, built = Writer(part, VERSION), build_place(source, work / _TOWNS)
    write_map(built.town, source.name, work / _SHARED)
    record_scene(scenario, built, recipe, writer, advance or (lambda frames: None))
    write_json(part / _ROWS, {"rows": writer.rows, "extra": writer.extra}, indent=None)
    part.replace(place)
    return recipe.frames if advance is None else 0


def _assemble(scenarios: Sequence[Scenario], settings: Settings, work: Path) -> None:
    """Join the scenes' files and rows into one dataset; can be interrupted anywhere and called again."""
    root = work / "dataset"
    for half in root.rglob(".*"):  # written when the run before was killed
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
    """Move what is below one folder to the same places below another; rows and half-written files stay."""
    for path in sorted(path for path in source.rglob("*") if path.is_file()):
        if path.name != _ROWS and not path.name.startswith("."):
            place = target / path.relative_to(source)
            place.parent.mkdir(parents=True, exist_ok=True)
            path.replace(place)


def _put(dataset: Path, out: Path) -> None:
    """The finished dataset takes its place; then nothing is left to go on with."""
    if out.is_dir():
        out.rmdir()
    dataset.replace(out)
    shutil.rmtree(unfinished(out), ignore_errors=True)
