"""Tracking of many scenes: each is a job of a worker process or of a cluster."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import NamedTuple

from appocc.boxes import Boxes, is_person_or_bicycle
from appocc.nuscenes import Dataset, Scene
from tracking.evaluation.clear_id_hota import MetricCounts, Metrics
from tracking.evaluation.scene import KINDS, count_scene, metrics_of, read_truths, write_scored_tracks
from tracking.pipeline import SceneFrames, SceneTracks, track_maps


class TrackedScene(NamedTuple):
    """Counts and files of a scene whose tracks are written.

    Attributes:
        scene: name of the scene.
        key_frames: number of key frames.
        tracks: number of tracks.
        vehicles_only: whether no track is one of a person or a bicycle.
        files: written files.
        counts: what the metrics of all, moving and parked vehicles are computed from; None without annotations.
    """

    scene: str
    key_frames: int
    tracks: int
    vehicles_only: bool
    files: tuple[Path, ...]
    counts: Mapping[str, MetricCounts] | None

    @property
    def metrics(self) -> dict[str, Metrics] | None:
        """Metrics of all, moving and parked vehicles; None without annotations."""
        return None if self.counts is None else metrics_of(self.counts)


def pooled_metrics(scenes: Iterable[TrackedScene]) -> dict[str, Metrics] | None:
    """Return the metrics of all vehicles of the annotated scenes among some; None without any."""
    counts = [scene.counts for scene in scenes if scene.counts is not None]
    if not counts:
        return None
    return metrics_of({name: reduce(MetricCounts.plus, (each[name] for each in counts)) for name in KINDS})


def finish_scene(result: SceneTracks, truths: Sequence[Boxes] | None, folder: Path) -> TrackedScene:
    """Score the tracks of a scene and write them.

    Args:
        result: tracks.
        truths: annotated vehicles of each key frame; None without annotations.
        folder: output folder, see `write_scored_tracks`.

    Raises:
        DataError: if a file cannot be written.
    """
    counts = count_scene(result, truths)
    files = write_scored_tracks(folder, result, None if counts is None else metrics_of(counts))
    people = any(is_person_or_bicycle(track.kind) for states in result.tracks for track in states)
    return TrackedScene(result.scene, len(result.samples), result.count, not people, tuple(files), counts)


class SceneInput(NamedTuple):
    """A scene to track; the annotated vehicles of its key frames, None without annotations; the output folder."""

    frames: SceneFrames
    truths: tuple[Boxes, ...] | None
    folder: Path


def scene_inputs(dataset: Dataset, folders: Mapping[Scene, Path]) -> Iterator[SceneInput]:
    """Yield the inputs of scenes with their output folders; a scene's tables are read when its turn comes.

    Raises:
        DataError: if a scene has no key frames, or a table entry cannot be true.
    """
    for scene, folder in folders.items():
        frames = SceneFrames.of(dataset, scene)
        yield SceneInput(frames, read_truths(dataset, scene.name, frames.samples), folder)


@dataclass(frozen=True)
class SceneTracking:
    """The job of a worker: track a scene through its maps, score and write the tracks.

    Attributes:
        root: dataset.
        source: source of the maps, as a worker finds it.
        name: source of the maps, as it is named in the files.
        smoothing: whether tracks are smoothed offline.
        min_score: least score of a track in a frame, 0..1.
        trust_unseen: whether predictions in cells that no camera sees are used.
    """

    root: Path
    source: str
    name: str
    smoothing: bool = False
    min_score: float = 0.0
    trust_unseen: bool = False

    def __call__(self, wanted: SceneInput) -> TrackedScene:
        """Track a scene.

        Raises:
            DataError: if a map is missing or damaged, or a file cannot be written.
        """
        result = track_maps(
            self.root, wanted.frames, self.source, trust_unseen=self.trust_unseen, smoothing=self.smoothing
        )
        result = replace(result, source=self.name).with_scores(self.min_score)
        return finish_scene(result, wanted.truths, wanted.folder)
