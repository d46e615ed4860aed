"""Health report of the environment and of a dataset, as text or JSON."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appocc.boxes import is_vehicle
from appocc.environment import Environment, inspect_environment
from appocc.errors import AppoccError, DataError
from appocc.files import RemotePath
from appocc.files.questions import can_list
from appocc.levelling import ego_from_level
from appocc.nuscenes import Dataset, Scene
from appocc.nuscenes.problem import Problem
from appocc.nuscenes.records import NO_MAP
from appocc.nuscenes.validate import ProgressBar, no_progress, validate
from appocc.nuscenes.view_targets import count_labelled_images
from appocc.uses import uses_of

_EXAMPLES, _FEW_KINDS, _NAMES = 3, 4, 6
# Scenes, and key frames of each, in which the ground is looked at; more tilt than this moves what cameras see.
_LOOKED_AT, _TILTED_DEG = 8, 1.0


@dataclass(frozen=True)
class Channel:
    """A sensor channel: modality and numbers of files."""

    modality: str
    key_frames: int
    sweeps: int


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Contents of a dataset.

    Attributes:
        root: root folder.
        version: folder of the tables below the root.
        scenes: number of scenes.
        samples: number of key frames.
        annotations: number of boxes.
        instances: number of annotated objects.
        no_label_zones: number of zones in which nothing is annotated.
        locations: locations of the recordings.
        channels: sensor channels that have files.
        masks: number of drivable-area masks.
        scenes_with_mask: number of scenes with a mask.
        vector_maps: number of map-expansion files.
        lidarseg: number of LiDAR files with labels.
        pixel_classes: number of images with pixel classes; None if they are in a store, where each file is a request.
        bev: number of maps of each BEV source.
        ground_tilt_deg: largest tilt over a few scenes of the ground, on which annotated vehicles stand, in the ego
            frame; None if too few vehicles are annotated.
        uses: lines for people, see `appocc.uses`.
    """

    root: str
    version: str
    scenes: int
    samples: int
    annotations: int
    instances: int
    no_label_zones: int
    locations: tuple[str, ...]
    channels: dict[str, Channel]
    masks: int
    scenes_with_mask: int
    vector_maps: int
    lidarseg: int
    pixel_classes: int | None
    bev: dict[str, int]
    ground_tilt_deg: float | None
    uses: tuple[str, ...]


@dataclass(frozen=True)
class Report:
    """Findings; `contents` is None without a dataset or if its tables are damaged."""

    environment: Environment
    contents: Contents | None
    problems: tuple[Problem, ...]

    @property
    def healthy(self) -> bool:
        """Whether there are no errors; notes are ignored."""
        return not self.environment.complaints and not any(p.severity == "error" for p in self.problems)

    def as_json(self) -> dict[str, Any]:
        """Return the report with all findings as JSON values."""
        environment = {**asdict(self.environment), "complaints": self.environment.complaints}
        return {
            "healthy": self.healthy,
            "environment": environment,
            "dataset": asdict(self.contents) if self.contents else None,
            "problems": [asdict(problem) for problem in self.problems],
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text, about one screen."""
        dataset = _contents_lines(self.contents) if self.contents else iter(())
        lines = [*_environment_lines(self.environment), *dataset, *_problem_lines(self.problems)]
        return [*lines, "healthy" if self.healthy else "not healthy: see the errors above"]


def examine(
    root: Path | None, version: str | None = None, images: bool = False, progress: ProgressBar = no_progress
) -> Report:
    """Examine the environment and, if `root` is given, a dataset; `images` also reads every image.

    Raises:
        DataError: if `root` is not a dataset, or has several versions and none is named.
    """
    if root is None:
        return Report(inspect_environment(Path.cwd()), None, ())
    dataset = Dataset(root, version)
    problems = validate(dataset, images, progress)
    damaged = any(problem.kind == "damaged table" for problem in problems)
    here = Path.cwd() if isinstance(dataset.root, RemotePath) else dataset.root
    return Report(inspect_environment(here), None if damaged else contents_of(dataset), problems)


def contents_of(dataset: Dataset) -> Contents:
    """Count the contents of a dataset.

    Raises:
        DataError: if a table is damaged.
    """
    tables, root = dataset.tables, dataset.root
    maps = tables["map"]
    masks = [logs for logs, kind in zip(maps["log_tokens"], maps["category"], strict=True) if kind != NO_MAP]
    masked = {token for logs in masks for token in logs}
    # A web server has no lists.
    expansions = [*root.glob("maps/expansion/*.json"), *root.glob("maps/*.json")] if can_list(root) else []
    sources = [folder for folder in sorted(root.glob("bev/*")) if folder.is_dir()] if can_list(root) else []
    return Contents(
        root=str(root),
        version=dataset.tables.version,
        scenes=len(tables["scene"]),
        samples=len(tables["sample"]),
        annotations=len(tables["sample_annotation"]),
        no_label_zones=len(tables["nolabelzone"]),
        instances=len(tables["instance"]),
        locations=tuple(sorted({place for place in tables["log"]["location"] if place})),
        channels=_channels(dataset),
        masks=len(masks),
        scenes_with_mask=sum(scene.log_token in masked for scene in dataset.scenes),
        vector_maps=len(expansions),
        lidarseg=len(tables["lidarseg"]),
        pixel_classes=_pixel_classes(root),
        bev={folder.name: len(list(folder.glob("[!.]*.npz"))) for folder in sources},
        ground_tilt_deg=_ground_tilt_deg(dataset),
        uses=uses_of(dataset, len(masks), len(expansions)),
    )


def _pixel_classes(root: Path) -> int | None:
    found = [*root.glob("views/*.npz")] if can_list(root) else []
    if found and isinstance(root, RemotePath):
        return None
    total = 0
    for path in found:
        with suppress(DataError):  # packing names a damaged file
            total += count_labelled_images(path)
    return total


def _ground_tilt_deg(dataset: Dataset) -> float | None:
    tilts = [_scene_tilt_deg(dataset, dataset.scenes[i]) for i in _spread(len(dataset.scenes))]
    return max((tilt for tilt in tilts if tilt is not None), default=None)


def _scene_tilt_deg(dataset: Dataset, scene: Scene) -> float | None:
    samples, grounds = dataset.samples(scene), [np.empty((0, 3))]
    try:
        for i in _spread(len(samples)):
            boxes = dataset.frame(samples[i], images=False).boxes_ego
            if boxes is None:
                continue
            vehicles = boxes.select(np.flatnonzero([is_vehicle(name) for name in boxes.category]))
            grounds.append(vehicles.centre_m - np.outer(vehicles.size_wlh_m[:, 2] / 2, [0.0, 0.0, 1.0]))
    except AppoccError:
        return None  # the findings say what is wrong
    level = ego_from_level(np.concatenate(grounds))
    return None if level is None else float(np.degrees(np.arccos(min(1.0, level[2, 2]))))


def _spread(count: int) -> list[int]:
    """Return a few indices, spread evenly."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(count, _LOOKED_AT))})


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


# Text -------------------------------------------------------------------------------------------------------


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
    zones = f"; no-label zones: {c.no_label_zones:,}" if c.no_label_zones else ""
    yield f"scenes: {c.scenes:,}; samples: {c.samples:,}; boxes: {c.annotations:,}; objects: {c.instances:,}{zones}"
    yield f"sensor files: {keys + sweeps:,}"
    yield f"  {'channel':<20} {'modality':<8} {'key frames':>10} {'sweeps':>10}"
    for name, channel in c.channels.items():
        yield f"  {name:<20} {channel.modality:<8} {channel.key_frames:>10,} {channel.sweeps:>10,}"
    yield f"masks: {c.masks}, for {c.scenes_with_mask} of {c.scenes} scenes; vector maps: {c.vector_maps}"
    yield f"LiDAR files with point labels: {c.lidarseg:,}"
    classes = "not counted in a store" if c.pixel_classes is None else f"{c.pixel_classes:,}"
    yield f"images with pixel classes: {classes}"
    bev = ", ".join(f"{source} {count}" for source, count in list(c.bev.items())[:_NAMES])
    yield f"bev: {bev or 'none'}"
    yield from c.uses
    if c.ground_tilt_deg is not None:
        yield f"ground under the vehicles: leans by up to {c.ground_tilt_deg:.1f} degrees in the ego frame"
        if c.ground_tilt_deg > _TILTED_DEG:
            yield "  predicted maps need level ground: by a LiDAR, or level the calibration (docs/conventions.md)"


def _problem_lines(problems: tuple[Problem, ...]) -> Iterator[str]:
    """Yield findings by kind, errors first, with a count and the first few of each."""
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
