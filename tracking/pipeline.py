"""A scene of a dataset: its maps or detections in, its tracks, files and scores out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.bevmap import is_truth, load_map
from appocc.boxes import Boxes, is_person_or_bicycle
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import plain_name, write_json
from appocc.nuscenes import Dataset, Sample, Scene
from tracking.detections import Detections, TakesDetections, lead
from tracking.evaluation.clear_id_hota import GATE_M, Metrics, Moment, evaluate
from tracking.evaluation.summary import summaries_of, write_summaries
from tracking.filtering.kalman import MotionConfig
from tracking.filtering.smoother import SmoothingConfig, smooth
from tracking.instances.instances import BlobConfig, find_blobs
from tracking.io.writers import write_csv, write_mot, write_nuscenes
from tracking.tracker import MAPS, Tracker
from tracking.tracks import Track

RANGE_M = 40.0
# An object whose centres span more than this in the scene moves; annotations of parked ones jitter by less.
MOVING_SPAN_M = 2.0


@dataclass(frozen=True)
class SceneTracks:
    """The tracks of a scene.

    Attributes:
        scene: its name.
        source: where the maps or detections came from.
        samples: T key frames.
        world_from_ego: (T, 4, 4) poses.
        tracks: T tuples of tracks.
        sensors: what detections were made from, of camera, lidar, radar, map and external; None for maps.
    """

    scene: str
    source: str
    samples: tuple[Sample, ...]
    world_from_ego: FloatArray
    tracks: tuple[tuple[Track, ...], ...]
    sensors: tuple[str, ...] | None = None

    @property
    def times_us(self) -> tuple[int, ...]:
        """T times of the key frames."""
        return tuple(sample.timestamp_us for sample in self.samples)

    def smoothed(self, motion: MotionConfig) -> SceneTracks:
        """The same in hindsight, see `tracking.filtering.smoother`, if their tracker took vehicles to move so."""
        return replace(self, tracks=smooth(self.times_us, self.tracks, SmoothingConfig(motion=motion)))

    @property
    def count(self) -> int:
        """Number of different vehicles."""
        return len({track.id for moment in self.tracks for track in moment})


class _Seen(NamedTuple):
    """A key frame for the tracker."""

    detections: Detections
    timestamp_us: int
    world_from_ego: FloatArray


def key_frames(dataset: Dataset, scene: Scene) -> tuple[tuple[Sample, ...], FloatArray]:
    """The T key frames of a scene, and world_from_ego (T, 4, 4) of each.

    Raises:
        DataError: if there are none, or two at one time.
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
    tracker: TakesDetections,
    advance: Callable[[int], None] = lambda _: None,
) -> tuple[tuple[Track, ...], ...]:
    """Lead a fresh tracker through T key frames with poses (T, 4, 4) and detections; `advance` as in `lead`."""
    moments = zip(samples, world_from_ego, detections, strict=True)
    return lead(tracker, (_Seen(seen, sample.timestamp_us, pose) for sample, pose, seen in moments), advance)


def track_scene(
    dataset: Dataset,
    scene: Scene,
    source: str,
    tracker: Tracker | None = None,
    blob_config: BlobConfig | None = None,
    advance: Callable[[int], None] = lambda _: None,
    trust_unseen: bool = False,
) -> SceneTracks:
    """Follow the vehicles of a scene through its maps; `advance` is called with the number of key frames done.

    With `trust_unseen` the guesses of predicted maps count too, see `BEVMap.with_guesses`.

    Raises:
        DataError: if the scene has no key frames or two at one time, or a map is missing or damaged.
    """
    tracker = tracker or Tracker(MAPS)
    samples, poses = key_frames(dataset, scene)
    maps = (load_map(dataset.root, source, sample.token) for sample in samples)
    blobs = (find_blobs(bev.with_guesses() if trust_unseen else bev, blob_config) for bev in maps)
    tracks = track_samples(samples, poses, (each.as_detections() for each in blobs), tracker, advance)
    return SceneTracks(scene.name, source, samples, poses, tracks)


def tracks_folder(root: Path, source: str, scene: str) -> Path:
    """Where a scene's tracks are written: `ROOT/tracks/SOURCE/SCENE`; of a source that is a folder, its last part.

    Raises:
        DataError: if a name leads elsewhere.
    """
    return root / "tracks" / plain_name(root, Path(source).absolute().name) / plain_name(root, scene)


def write_tracks(folder: Path, result: SceneTracks) -> list[Path]:
    """Write tracking.json (nuScenes), mot.txt (MOTChallenge), tracks.csv and summary.csv into a folder; their paths.

    Raises:
        DataError: if a file cannot be written.
    """
    paths = [folder / name for name in ("tracking.json", "mot.txt", "tracks.csv", "summary.csv")]
    modalities = result.sensors
    if modalities is None:
        modalities = ("camera", "lidar", "map", "external") if is_truth(result.source) else ("camera",)
    write_nuscenes(paths[0], [sample.token for sample in result.samples], result.tracks, modalities)
    write_mot(paths[1], result.tracks)
    write_csv(paths[2], result.times_us, result.tracks)
    write_summaries(paths[3], summaries_of(result.times_us, result.tracks))
    return paths


# Scores -----------------------------------------------------------------------------------------------------------


def score(dataset: Dataset, result: SceneTracks) -> dict[str, Metrics] | None:
    """Metrics of all, of moving and of parked vehicles; None where the scene has no annotations.

    Demanded are annotated vehicles whose centre is within RANGE_M of the ego on the ground; the others (and, where
    one kind is asked for, the other kind) are ignored, and so are unmatched tracks beyond the range.
    """
    if not dataset.annotated(dataset.scene(result.scene)):
        return None
    truths = [dataset.boxes_world(sample).vehicles() for sample in result.samples]
    moving = moving_instances(truths)
    kinds = {"metrics": None, "metrics_moving": True, "metrics_parked": False}
    vehicles = replace(result, tracks=tuple(tuple(filter(_is_vehicle, moment)) for moment in result.tracks))
    return {name: evaluate(_moments(vehicles, truths, moving, kind)) for name, kind in kinds.items()}


def _is_vehicle(track: Track) -> bool:
    """Whether a track is one of those that annotated vehicles are compared with."""
    return not is_person_or_bicycle(track.kind)


def moving_instances(truths: Sequence[Boxes]) -> set[str]:
    """Instances whose centres (x, y in the world) span more than MOVING_SPAN_M over the given moments."""
    places: dict[str, list[FloatArray]] = {}
    for boxes in truths:
        for instance, centre in zip(boxes.instance, boxes.centre_m, strict=True):
            places.setdefault(instance, []).append(centre[:2])
    return {name for name, path in places.items() if np.hypot(*np.ptp(path, axis=0)) > MOVING_SPAN_M}


def _moments(result: SceneTracks, truths: Sequence[Boxes], moving: set[str], kind: bool | None) -> list[Moment]:
    """Ground truth and tracks, key frame by key frame, in world x and y."""
    names = sorted({instance for boxes in truths for instance in boxes.instance})
    number = {name: i for i, name in enumerate(names)}
    moments = []
    for pose, boxes, tracks in zip(result.world_from_ego, truths, result.tracks, strict=True):
        ego = pose[:2, 3]
        places = np.array([track.position_world_m[:2] for track in tracks]).reshape(-1, 2)
        wanted = np.array([kind is None or (name in moving) == kind for name in boxes.instance], dtype=np.bool_)
        moments.append(
            Moment(
                np.array([number[name] for name in boxes.instance], dtype=np.int64),
                boxes.centre_m[:, :2].copy(),
                wanted & (np.linalg.norm(boxes.centre_m[:, :2] - ego, axis=1) <= RANGE_M),
                np.array([track.id for track in tracks], dtype=np.int64),
                places,
                np.linalg.norm(places - ego, axis=1) <= RANGE_M,
            )
        )
    return moments


def write_metrics(path: Path, result: SceneTracks, metrics: dict[str, Metrics]) -> None:
    """Write the scores with the protocol they follow.

    Raises:
        DataError: if the file cannot be written.
    """
    protocol: dict[str, Any] = {"range_m": RANGE_M, "gate_m": GATE_M, "moving_span_m": MOVING_SPAN_M}
    scores = {name: value.as_json() for name, value in metrics.items()}
    source = "bev" if result.sensors is None else "detections"
    write_json(path, {"scene": result.scene, source: result.source, "protocol": protocol, **scores})
