"""Scenes of a dataset: maps or detections in, tracks and files out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.bevmap import load_map
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.nuscenes import Dataset, Sample, Scene
from appocc.objects import BEVObjects
from tracking.class_votes import vote_classes
from tracking.detections import Detections
from tracking.filtering.kalman import MotionConfig
from tracking.filtering.smoother import SmoothingConfig, smooth
from tracking.instances.instances import InstanceConfig
from tracking.io.nuscenes_detections import TRACKED, DetectionResults
from tracking.io.track_summaries import summarise_tracks, write_summaries
from tracking.io.writers import write_csv, write_mot, write_nuscenes
from tracking.pipeline.online import OnlineTracker, count_tracks, no_progress, run_tracker, select_scores
from tracking.presets import MAPS, OBJECTS
from tracking.tracker import Tracker
from tracking.tracks import Track


@dataclass(frozen=True, eq=False)
class SceneTracks:
    """Tracks of a scene.

    Attributes:
        scene: name of the scene.
        source: source of the maps, or path of the detections.
        samples: T key frames.
        world_from_ego: (T, 4, 4) ego poses.
        tracks: T tuples of tracks.
        sensors: inputs of the detections: camera, lidar, radar, map or external; None for maps.
        on_truth: whether the maps are true ones and not predicted.
    """

    scene: str
    source: str
    samples: tuple[Sample, ...]
    world_from_ego: FloatArray
    tracks: tuple[tuple[Track, ...], ...]
    sensors: tuple[str, ...] | None = None
    on_truth: bool = False

    @property
    def times_us(self) -> tuple[int, ...]:
        """T times of the key frames."""
        return tuple(sample.timestamp_us for sample in self.samples)

    def smoothed(self, motion: MotionConfig) -> SceneTracks:
        """Return the tracks after offline smoothing with the motion model of their tracker."""
        return replace(self, tracks=smooth(self.times_us, self.tracks, SmoothingConfig(motion=motion)))

    def with_scores(self, min_score: float) -> SceneTracks:
        """Return the tracks with at least a score, see `select_scores`."""
        return replace(self, tracks=select_scores(self.tracks, min_score))

    @property
    def count(self) -> int:
        """Number of tracks."""
        return count_tracks(self.tracks)


class _KeyFrame(NamedTuple):
    """A key frame as input of a tracker."""

    detections: Detections
    timestamp_us: int
    world_from_ego: FloatArray


def read_key_frames(dataset: Dataset, scene: Scene) -> tuple[tuple[Sample, ...], FloatArray]:
    """Return the T key frames of a scene and their poses world_from_ego (T, 4, 4).

    Raises:
        DataError: if there are none, or two have the same time.
    """
    samples = dataset.samples(scene)
    if not samples:
        raise DataError(f"{dataset.root}: scene '{scene.name}' has no key frames")
    for one, other in pairwise(samples):
        if one.timestamp_us == other.timestamp_us:
            raise DataError(f"{dataset.tables.path('sample')}: {one.token} and {other.token} have the same time")
    return samples, np.stack([dataset.world_from_ego(sample) for sample in samples])


def track_samples(
    samples: Sequence[Sample],
    world_from_ego: FloatArray,
    detections: Iterable[Detections],
    tracker: OnlineTracker,
    advance: Callable[[int], None] = no_progress,
) -> tuple[tuple[Track, ...], ...]:
    """Run a new tracker on T key frames with poses (T, 4, 4) and detections; `advance` as in `run_tracker`."""
    frames = zip(samples, world_from_ego, detections, strict=True)
    return run_tracker(
        tracker, (_KeyFrame(found, sample.timestamp_us, pose) for sample, pose, found in frames), advance
    )


class SceneFrames(NamedTuple):
    """A scene to track, with what the tables tell of it: workers read no tables.

    Attributes:
        scene: name of the scene.
        samples: T key frames.
        world_from_ego: (T, 4, 4) ego poses.
    """

    scene: str
    samples: tuple[Sample, ...]
    world_from_ego: FloatArray

    @classmethod
    def of(cls, dataset: Dataset, scene: Scene) -> SceneFrames:
        """Read the key frames of a scene; raises DataError as `read_key_frames`."""
        return cls(scene.name, *read_key_frames(dataset, scene))


def track_scene(
    dataset: Dataset,
    scene: Scene,
    source: str,
    *,
    tracker: Tracker | None = None,
    instance_config: InstanceConfig | None = None,
    trust_unseen: bool = False,
    smoothing: bool = False,
    advance: Callable[[int], None] = no_progress,
) -> SceneTracks:
    """Track the objects of a scene's maps, see `track_maps`.

    Raises:
        DataError: if the scene has no key frames or two with the same time, or a map is missing or damaged.
    """
    return track_maps(
        dataset.root,
        SceneFrames.of(dataset, scene),
        source,
        tracker=tracker,
        instance_config=instance_config,
        trust_unseen=trust_unseen,
        smoothing=smoothing,
        advance=advance,
    )


def track_maps(
    root: Path,
    frames: SceneFrames,
    source: str,
    *,
    tracker: Tracker | None = None,
    instance_config: InstanceConfig | None = None,
    trust_unseen: bool = False,
    smoothing: bool = False,
    advance: Callable[[int], None] = no_progress,
) -> SceneTracks:
    """Track the objects of a scene's maps, or the vehicle instances of maps without objects.

    Args:
        root: dataset of the scene.
        frames: scene to track.
        source: source of the maps, see `load_map`.
        tracker: new tracker; by default with the configuration OBJECTS if the first map has objects, else MAPS.
        instance_config: configuration of the instance segmentation.
        trust_unseen: also use predictions in cells that no camera sees, see `BEVMap.with_guesses`.
        smoothing: smooth the tracks offline.
        advance: called with 1 after each key frame.

    Raises:
        DataError: if a map is missing or damaged.
    """
    if tracker is None:
        first = load_map(root, source, frames.samples[0].token)
        tracker = Tracker(MAPS if first.objects is None else OBJECTS)
    objects: list[BEVObjects | None] = []
    true_maps: list[bool] = []

    def read_detections() -> Iterator[Detections]:
        for sample in frames.samples:
            bev = load_map(root, source, sample.token)
            true_maps.append(bev.is_truth)
            bev = bev.with_guesses() if trust_unseen else bev
            objects.append(bev.known_objects)
            yield Detections.from_bev(bev, instance_config)

    tracks = track_samples(frames.samples, frames.world_from_ego, read_detections(), tracker, advance)
    voted = vote_classes(tracks, objects)
    result = SceneTracks(frames.scene, source, frames.samples, frames.world_from_ego, voted, on_truth=all(true_maps))
    return result.smoothed(tracker.config.lifecycle.motion) if smoothing else result


def track_detections(
    dataset: Dataset,
    scene: Scene,
    path: Path,
    *,
    tracker: OnlineTracker | None = None,
    smoothing: bool = False,
    advance: Callable[[int], None] = no_progress,
) -> tuple[SceneTracks, dict[str, int]]:
    """Track the objects of a scene through a file of nuScenes detection results.

    Args:
        dataset: dataset of the scene.
        scene: scene to track.
        path: file of the detection results.
        tracker: new tracker; by default with the default configuration.
        smoothing: smooth the tracks offline, with the default motion model.
        advance: called with 1 after each key frame.

    Returns:
        The tracks, and for each class that is not in TRACKED the number of boxes that were skipped.

    Raises:
        DataError: if the scene has no key frames or two with the same time, or the file is missing, damaged or lacks
            a key frame.
    """
    samples, poses = read_key_frames(dataset, scene)
    results = DetectionResults.load(path)
    found = results.detections([sample.token for sample in samples], poses)
    skipped = Counter(kind for each in found for kind in each.kind if kind not in TRACKED)
    tracked = (each.select(np.array([kind in TRACKED for kind in each.kind], dtype=np.bool_)) for each in found)
    tracks = track_samples(samples, poses, tracked, tracker or Tracker(), advance)
    result = SceneTracks(scene.name, str(path), samples, poses, tracks, results.sensors)
    if smoothing:
        result = result.smoothed(MotionConfig())
    return result, dict(sorted(skipped.items()))


def write_tracks(folder: Path, result: SceneTracks) -> list[Path]:
    """Write tracking.json (nuScenes), mot.txt (MOTChallenge), tracks.csv and summary.csv; return their paths.

    Raises:
        DataError: if a file cannot be written.
    """
    paths = [folder / name for name in ("tracking.json", "mot.txt", "tracks.csv", "summary.csv")]
    modalities = result.sensors
    if modalities is None:
        modalities = ("camera", "lidar", "map", "external") if result.on_truth else ("camera",)
    write_nuscenes(paths[0], [sample.token for sample in result.samples], result.tracks, modalities)
    write_mot(paths[1], result.tracks)
    write_csv(paths[2], result.times_us, result.tracks)
    write_summaries(paths[3], summarise_tracks(result.times_us, result.tracks))
    return paths
