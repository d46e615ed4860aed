"""Health of the environment and of a dataset, for one screen or as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appocc.environment import Environment, look_around
from appocc.nuscenes import Dataset
from appocc.nuscenes.problem import Problem
from appocc.nuscenes.validate import ProgressBar, no_progress, validate

_EXAMPLES, _FEW_KINDS, _NAMES = 3, 4, 6


@dataclass(frozen=True)
class Channel:
    """A sensor channel: its modality and how many files it has."""

    modality: str
    key_frames: int
    sweeps: int


@dataclass(frozen=True)
class Contents:
    """What a dataset holds.

    Attributes:
        root: its folder.
        version: folder of the tables below it.
        scenes: number of scenes.
        samples: number of key frames.
        annotations: number of boxes.
        instances: number of annotated objects.
        locations: where it was recorded.
        channels: sensor channels that have files.
        masks: number of drivable-area masks.
        scenes_with_mask: how many scenes have one.
        vector_maps: number of map-expansion files.
        lidarseg: number of LiDAR files with labels.
        bev: number of stored maps of each BEV source.
    """

    root: str
    version: str
    scenes: int
    samples: int
    annotations: int
    instances: int
    locations: tuple[str, ...]
    channels: dict[str, Channel]
    masks: int
    scenes_with_mask: int
    vector_maps: int
    lidarseg: int
    bev: dict[str, int]


@dataclass(frozen=True)
class Report:
    """All that was found; `contents` is None where no dataset was named or its tables are damaged."""

    environment: Environment
    contents: Contents | None
    problems: tuple[Problem, ...]

    @property
    def healthy(self) -> bool:
        """Whether nothing is wrong; notes do not count."""
        return not self.environment.complaints and not any(p.severity == "error" for p in self.problems)

    def as_json(self) -> dict[str, Any]:
        """The report as JSON values, every finding in it."""
        environment = {**asdict(self.environment), "complaints": self.environment.complaints}
        return {
            "healthy": self.healthy,
            "environment": environment,
            "dataset": asdict(self.contents) if self.contents else None,
            "problems": [asdict(problem) for problem in self.problems],
        }

    def lines(self) -> list[str]:
        """The report for people: one screen."""
        dataset = _contents_lines(self.contents) if self.contents else iter(())
        lines = [*_environment_lines(self.environment), *dataset, *_problem_lines(self.problems)]
        return [*lines, "healthy" if self.healthy else "not healthy: see the errors above"]


def examine(
    root: Path | None, version: str | None = None, images: bool = False, progress: ProgressBar = no_progress
) -> Report:
    """Look at the environment and, where `root` is given, at a dataset; `images` reads every file whole.

    Raises:
        DataError: if `root` holds no dataset, or several versions and none is named.
    """
    if root is None:
        return Report(look_around(Path.cwd()), None, ())
    dataset = Dataset(root, version)
    problems = validate(dataset, images, progress)
    damaged = any(problem.kind == "damaged table" for problem in problems)
    return Report(look_around(root), None if damaged else contents_of(dataset), problems)


def contents_of(dataset: Dataset) -> Contents:
    """Count what a dataset holds.

    Raises:
        DataError: if a table is damaged.
    """
    tables, root = dataset.tables, dataset.root
    masked = {token for tokens in tables["map"]["log_tokens"] for token in tokens}
    expansions = [*root.glob("maps/expansion/*.json"), *root.glob("maps/*.json")]
    sources = [folder for folder in sorted(root.glob("bev/*")) if folder.is_dir()]
    return Contents(
        str(root),
        dataset.tables.version,
        len(tables["scene"]),
        len(tables["sample"]),
        len(tables["sample_annotation"]),
        len(tables["instance"]),
        tuple(sorted({place for place in tables["log"]["location"] if place})),
        _channels(dataset),
        len(tables["map"]),
        sum(scene.log_token in masked for scene in dataset.scenes),
        len(expansions),
        len(tables["lidarseg"]),
        {folder.name: len(list(folder.glob("[!.]*.npz"))) for folder in sources},
    )


def _channels(dataset: Dataset) -> dict[str, Channel]:
    sensors, row = dataset.tables["sensor"], dataset.tables.data_channel
    keys = dataset.tables["sample_data"].array("is_key_frame")
    counts = [np.bincount(row[(row >= 0) & which], minlength=len(sensors)) for which in (keys, ~keys)]
    found: dict[str, Channel] = {}
    for name, modality, k, s in sorted(zip(sensors["channel"], sensors["modality"], *counts, strict=True)):
        if k + s:
            known = found.get(name, Channel(modality, 0, 0))
            found[name] = Channel(modality, known.key_frames + int(k), known.sweeps + int(s))
    return found


# For people -------------------------------------------------------------------------------------------------------


def _environment_lines(environment: Environment) -> Iterator[str]:
    e = environment
    yield f"appocc {e.appocc}, Python {e.python}, {e.platform}"
    memory = f"{_gb(e.memory_bytes)} memory ({_gb(e.free_memory_bytes)} free), " if e.memory_bytes else ""
    yield f"{e.cores} cores, {memory}{_gb(e.free_disk_bytes)} free on disk; GPU: {e.gpu or 'none'}"
    present = [f"{p.name} {p.version}" for p in e.packages if not p.complaint]
    yield f"packages: {len(present)} of {len(e.packages)} in order ({', '.join(present[:4])}, ...)"
    lacking = {name: [p.name for p in packages if p.complaint] for name, packages in e.extras.items()}
    extras = [f"{name} {'lacks ' + ', '.join(names) if names else 'yes'}" for name, names in lacking.items()]
    yield f"extras: {'; '.join(extras) or 'none'}"
    yield from (f"error: {complaint}" for complaint in e.complaints)


def _gb(size: int | None) -> str:
    return "?" if size is None else f"{size / 1e9:.1f} GB"


def _contents_lines(c: Contents) -> Iterator[str]:
    yield ""
    yield f"{c.root}: {c.version or 'tables in the root'}, {', '.join(c.locations[:_NAMES]) or 'unknown location'}"
    keys = sum(channel.key_frames for channel in c.channels.values())
    sweeps = sum(channel.sweeps for channel in c.channels.values())
    yield f"scenes: {c.scenes:,}; samples: {c.samples:,}; boxes: {c.annotations:,}; objects: {c.instances:,}"
    yield f"sensor files: {keys + sweeps:,}"
    yield f"  {'channel':<20} {'modality':<8} {'key frames':>10} {'sweeps':>10}"
    for name, channel in c.channels.items():
        yield f"  {name:<20} {channel.modality:<8} {channel.key_frames:>10,} {channel.sweeps:>10,}"
    yield f"masks: {c.masks}, for {c.scenes_with_mask} of {c.scenes} scenes; vector maps: {c.vector_maps}"
    yield f"LiDAR files with point labels: {c.lidarseg:,}"
    bev = ", ".join(f"{source} {count}" for source, count in list(c.bev.items())[:_NAMES])
    yield f"bev: {bev or 'none'}"


def _problem_lines(problems: tuple[Problem, ...]) -> Iterator[str]:
    """Findings by kind, errors first, with a count and the first few of each."""
    kinds: dict[tuple[str, str, str], list[Problem]] = {}
    for problem in sorted(problems, key=lambda p: p.severity):
        kinds.setdefault((problem.severity, problem.table, problem.kind), []).append(problem)
    yield ""
    yield f"findings: {len(problems):,}, kinds: {len(kinds)}" if problems else "findings: none"
    shown = _EXAMPLES if len(kinds) <= _FEW_KINDS else 1
    for (severity, table, kind), found in list(kinds.items())[: 2 * _NAMES]:
        yield f"{severity}: {table}: {kind} ({len(found):,})"
        yield from (f"  {problem.token} {problem.reason}" for problem in found[:shown])
    if len(kinds) > 2 * _NAMES:
        yield f"... and {len(kinds) - 2 * _NAMES} kinds more: see --json"
