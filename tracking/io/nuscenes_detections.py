"""Boxes of nuScenes detectors as detections: from result files of the benchmark, and from scenes in one JSON file.

Either has boxes in the global frame; detections are in the ego frame of their key frame. The benchmark's classes are
the detections' kinds, its scores their probabilities, and what is farther than the range of the class (50 m for all
vehicles but two-wheelers) counts as out of view.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from appocc.checks import FloatArray, IntArray, check_transform, frozen
from appocc.errors import DataError, ShapeError
from appocc.files import read_json
from appocc.geometry import apply, inverse, quaternion_from_yaw, rotation_from_quaternion, yaw_of
from appocc.jsonparts import JsonPart, first_problem
from appocc.nuscenes import Dataset, Scene
from tracking.detections import Around, Detections, TakesDetections, boxes_as_detections, log_odds_of
from tracking.pipeline import SceneTracks, key_frames, track_samples
from tracking.tracker import Tracker

RANGE_M = 50.0
# The classes of the tracking benchmark; that of detections has some more.
TRACKED = frozenset({"bicycle", "bus", "car", "motorcycle", "pedestrian", "trailer", "truck"})

_Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
_Quaternion = Annotated[list[float], Field(min_length=4, max_length=4)]
_Share = Annotated[float, Field(ge=0, le=1)]
_Row = Annotated[list[float], Field(min_length=4, max_length=4)]


class _ResultBox(JsonPart):
    """A box of the benchmark's detection results."""

    translation: _Vector
    size: _Vector
    rotation: _Quaternion
    detection_name: str
    detection_score: _Share


class _Results(JsonPart):
    results: dict[str, Any]


class _SampleResults(JsonPart):
    results: dict[str, list[_ResultBox]]


class _SceneBox(JsonPart):
    """A detector's box in a file of scenes."""

    name: str
    score: _Share
    xyz: _Vector
    wlh: _Vector
    yaw: float


class _SceneObject(JsonPart):
    """An annotated object in a file of scenes."""

    id: int
    name: str
    xyz: _Vector
    num_lidar_pts: int


class _KeyFrame(JsonPart):
    token: str
    timestamp: int
    ego2global: Annotated[list[_Row], Field(min_length=4, max_length=4)]
    gt: list[_SceneObject]
    det: dict[str, list[_SceneBox]]


_SCENES = TypeAdapter(dict[str, list[_KeyFrame]])


@dataclass(frozen=True)
class Objects:
    """N annotated objects of one key frame, in the world frame.

    Attributes:
        ids: (N,) whole numbers, the same over time.
        kind: N categories.
        centre_m: (N, 3) box centres.
        points: (N,) LiDAR points inside.
    """

    ids: IntArray
    kind: tuple[str, ...]
    centre_m: FloatArray
    points: IntArray


@dataclass(frozen=True)
class DetectedScene:
    """T key frames with a detector's boxes and the truth.

    Attributes:
        name: of the scene.
        tokens: T samples.
        timestamps_us: (T,) rising.
        world_from_ego: (T, 4, 4) poses.
        detections: T.
        truth: T.
    """

    name: str
    tokens: tuple[str, ...]
    timestamps_us: IntArray
    world_from_ego: FloatArray
    detections: tuple[Detections, ...]
    truth: tuple[Objects, ...]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        frozen(self.timestamps_us)
        frozen(self.world_from_ego)


def read_detections(
    path: Path, sample_tokens: Sequence[str], world_from_ego: FloatArray, range_m: float = RANGE_M
) -> tuple[Detections, ...]:
    """Detections of T samples from a file of detection results.

    Args:
        path: the file.
        sample_tokens: T of its samples.
        world_from_ego: (T, 4, 4) their poses.
        range_m: how far the detector sees; boxes beyond it are kept.

    Raises:
        DataError: if the file is missing or damaged or lacks a sample.
    """
    return _detections(path, read_json(path), sample_tokens, world_from_ego, range_m)


def _detections(
    path: Path, content: Any, sample_tokens: Sequence[str], world_from_ego: FloatArray, range_m: float
) -> tuple[Detections, ...]:
    """As `read_detections`, of the file's content; samples that were not asked for are not looked at."""
    try:
        results = _Results.model_validate(content).results
        detections = []
        for token, pose in zip(sample_tokens, world_from_ego, strict=True):
            if token not in results:
                raise DataError(f"{path}: expected boxes, or an empty list, for sample {token}, got nothing")
            boxes = _SampleResults.model_validate({"results": {token: results[token]}}).results[token]
            detections.append(_of_sample(path, token, boxes, pose, range_m))
    except ValidationError as error:
        raise DataError(f"{path}: expected detection results of nuScenes ({first_problem(error)})") from error
    return tuple(detections)


def _of_sample(path: Path, token: str, boxes: Sequence[_ResultBox], pose: FloatArray, range_m: float) -> Detections:
    try:
        return _in_ego(
            pose,
            np.array([box.translation for box in boxes]).reshape(-1, 3),
            rotation_from_quaternion(np.array([box.rotation for box in boxes]).reshape(-1, 4)),
            np.array([box.size for box in boxes]).reshape(-1, 3),
            np.array([box.detection_score for box in boxes]),
            tuple(box.detection_name for box in boxes),
            range_m,
        )
    except ShapeError as error:
        raise DataError(f"{path}: sample {token}: {error}") from error


def track_detections(
    dataset: Dataset,
    scene: Scene,
    path: Path,
    tracker: TakesDetections | None = None,
    advance: Callable[[int], None] = lambda _: None,
) -> tuple[SceneTracks, dict[str, int]]:
    """Follow the objects of a scene through a file of detection results.

    `advance` is called with the number of key frames done.

    Returns:
        The tracks, and of how many boxes were left out because their class is none of TRACKED.

    Raises:
        DataError: if the scene has no key frames or two at one time, or the file is missing or damaged or lacks one.
    """
    samples, poses = key_frames(dataset, scene)
    content = read_json(path)
    seen = _detections(path, content, [sample.token for sample in samples], poses, RANGE_M)
    others = Counter(kind for each in seen for kind in each.kind if kind not in TRACKED)
    tracked = (each.select(np.array([kind in TRACKED for kind in each.kind], dtype=np.bool_)) for each in seen)
    tracks = track_samples(samples, poses, tracked, tracker or Tracker(), advance)
    return SceneTracks(scene.name, str(path), samples, poses, tracks, _sensors(content)), dict(sorted(others.items()))


def _sensors(content: Any) -> tuple[str, ...]:
    """What the file says that its boxes were made from, such as camera and lidar; nothing if it does not."""
    meta = content.get("meta")
    used = [name for name, value in meta.items() if value is True] if isinstance(meta, dict) else []
    return tuple(name.removeprefix("use_") for name in used if name.startswith("use_"))


def read_scenes(path: Path, detector: str, range_m: float = RANGE_M) -> tuple[DetectedScene, ...]:
    """Scenes with the boxes of one of the file's detectors.

    The file has for each scene a list of key frames, each with token, timestamp (microseconds), ego2global (4x4), gt
    (a list of id, name, xyz, num_lidar_pts) and det (for each detector a list of name, score, xyz, wlh, yaw); places
    in the global frame.

    Raises:
        DataError: if the file is missing or damaged, has no such detector, or times do not rise.
    """
    try:
        scenes = _SCENES.validate_python(read_json(path))
    except ValidationError as error:
        raise DataError(f"{path}: expected key frames by scene ({first_problem(error)})") from error
    return tuple(_scene(path, name, frames, detector, range_m) for name, frames in scenes.items())


def _scene(path: Path, name: str, frames: Sequence[_KeyFrame], detector: str, range_m: float) -> DetectedScene:
    times_us = np.array([frame.timestamp for frame in frames], dtype=np.int64)
    if (np.diff(times_us) <= 0).any():
        raise DataError(f"{path}: scene {name}: expected rising timestamps, got {times_us.tolist()}")
    poses = np.array([frame.ego2global for frame in frames]).reshape(-1, 4, 4)
    detections = []
    for frame, pose in zip(frames, poses, strict=True):
        if detector not in frame.det:
            known = ", ".join(frame.det) or "none"
            raise DataError(f"{path}: {name}: {frame.token}: expected boxes of '{detector}', got those of {known}")
        boxes = frame.det[detector]
        try:
            check_transform("ego2global", pose)
            detections.append(
                _in_ego(
                    pose,
                    np.array([box.xyz for box in boxes]).reshape(-1, 3),
                    rotation_from_quaternion(quaternion_from_yaw([box.yaw for box in boxes])),
                    np.array([box.wlh for box in boxes]).reshape(-1, 3),
                    np.array([box.score for box in boxes]),
                    tuple(box.name for box in boxes),
                    range_m,
                )
            )
        except ShapeError as error:
            raise DataError(f"{path}: {name}: {frame.token}: {error}") from error
    truth = tuple(_objects(frame.gt) for frame in frames)
    tokens = tuple(frame.token for frame in frames)
    return DetectedScene(name, tokens, times_us, poses, tuple(detections), truth)


def _objects(objects: Sequence[_SceneObject]) -> Objects:
    return Objects(
        np.array([one.id for one in objects], dtype=np.int64),
        tuple(one.name for one in objects),
        np.array([one.xyz for one in objects]).reshape(-1, 3),
        np.array([one.num_lidar_pts for one in objects], dtype=np.int64),
    )


def _in_ego(
    world_from_ego: FloatArray,
    centre_m: FloatArray,
    rotation: FloatArray,
    size_m: FloatArray,
    probability: FloatArray,
    kind: tuple[str, ...],
    range_m: float,
) -> Detections:
    """Detections of N boxes with centres (N, 3) and rotations (N, 3, 3) in the world, and sizes w, l, h (N, 3)."""
    ego_from_world = inverse(world_from_ego)
    turn = ego_from_world[:3, :3] @ rotation
    below = size_m[:, 2:] / 2 * np.array([0.0, 0.0, 1.0])
    ground_m = apply(ego_from_world, centre_m) - below
    return boxes_as_detections(ground_m, yaw_of(turn), size_m, log_odds_of(probability), kind, Around(range_m))
