"""Generate a dataset of simulated scenes: parallel, resumable by scene, moved to its folder when complete."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from appocc.nuscenes.assembly import Assembly, count_finished_scenes, resolved
from appocc.simulation.recording import VERSION, RecordingSettings, build_town_simulation, record_scene, write_map
from appocc.simulation.scenario import Scenario, draw_scenario
from appocc.simulation.sources import TownSource
from appocc.version import __version__
from appocc.workers import Engine, in_order

SETTINGS_FILE = "simulation.json"
_Job = tuple[Scenario, TownSource]
_TOWNS = "towns"
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
    pool: Engine | None,
    advance: Callable[[float], None],
    notify: Callable[[str], None] = lambda text: None,
) -> SimulationCounts:
    """Record a dataset below `out`; `advance` gets the number of finished frames, `notify` a line before slow steps.

    The result depends neither on the pool nor on interruptions: finished scenes are kept in a hidden folder next to
    `out`, and the same call resumes from them.

    Raises:
        DataError: if `out` holds something else or cannot be written, or a town cannot be simulated.
    """
    out = resolved(out)
    total = settings.scenes * settings.recording.frames
    assembly = Assembly(out, VERSION, SETTINGS_FILE, settings.as_json(), "simulation")
    if assembly.is_finished():
        advance(total)
        return SimulationCounts(0, total)
    with assembly.opened():
        work = assembly.work
        kept = count_finished_scenes(out)
        if kept:
            notify(f"{out}: resuming after {kept} of {settings.scenes} scenes")
        for town in settings.towns[: settings.scenes]:
            if not town.is_prepared(work / _TOWNS):
                notify(f"{town.name}: generating streets and traffic, which takes about a minute")
                town.prepare(work / _TOWNS)
        scenarios = [_draw_scene(number, settings, work) for number in range(settings.scenes)]
        left = [scene for scene in scenarios if not assembly.has(scene.name)]
        advance((len(scenarios) - len(left)) * settings.recording.frames)
        # Scenes of a town follow each other, so that a worker rarely has to build another town.
        left.sort(key=lambda scene: (scene.town, scene.number))
        _record(left, settings, assembly, pool, advance)
        assembly.finish([scene.name for scene in scenarios], work / _SHARED)
    return SimulationCounts(len(left) * settings.recording.frames, total)


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
    assembly: Assembly,
    pool: Engine | None,
    advance: Callable[[float], None],
) -> None:
    sources = {town.name: town for town in settings.towns}
    jobs: list[_Job] = [(scenario, sources[scenario.town]) for scenario in scenarios]
    job = partial(_record_one, recording=settings.recording, assembly=assembly)
    for frames in in_order(pool, partial(job, advance=None if pool else advance), jobs):
        advance(frames)


def _record_one(
    job: _Job, recording: RecordingSettings, assembly: Assembly, advance: Callable[[float], None] | None
) -> int:
    """Record a scene into its own folder; return the number of frames not yet reported to `advance`."""
    scenario, source = job
    simulation = build_town_simulation(source, assembly.work / _TOWNS)
    write_map(simulation.town, source.name, assembly.work / _SHARED)
    report = advance or (lambda frames: None)
    assembly.write(scenario.name, lambda writer: record_scene(scenario, simulation, recording, writer, report))
    return recording.frames if advance is None else 0
