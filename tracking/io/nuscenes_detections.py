"""nuScenes detections: result files of the detection benchmark, and scenes with boxes in one JSON file.

Both have boxes in the global frame; detections are in the ego frame of their key frame. The benchmark's classes are
categories, its scores are probabilities, and the field of view is a range around the ego (50 m, the benchmark's range
for all vehicles except two-wheelers).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from appocc.checks import FloatArray, IntArray, check_transform, frozen
from appocc.errors import DataError, ShapeError
from appocc.files import read_json
from appocc.geometry import apply, inverse, quaternion_from_yaw, rotation_from_quaternion, yaw_of
from appocc.jsonparts import JsonPart, first_problem
from appocc.nuscenes.detection_results import ResultBox, read_boxes
from tracking.detections import Detections, log_odds_from_probability
from tracking.field_of_view import CircularView

RANGE_M = 50.0
# Classes of the tracking benchmark; the detection benchmark has more.
TRACKED = frozenset({"bicycle", "bus", "car", "motorcycle", "pedestrian", "trailer", "truck"})

_Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
_Share = Annotated[float, Field(ge=0, le=1)]
_Row = Annotated[list[float], Field(min_length=4, max_length=4)]


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


@dataclass(frozen=True, eq=False)
class AnnotatedObjects:
    """N annotated objects of one key frame, in the world frame.

    Attributes:
        ids: (N,) integers, constant over time.
        kind: N categories.
        centre_m: (N, 3) box centres.
        points: (N,) number of LiDAR points inside.
    """

    ids: IntArray
    kind: tuple[str, ...]
    centre_m: FloatArray
    points: IntArray


@dataclass(frozen=True, eq=False)
class SceneDetections:
    """T key frames of a scene with detections and ground truth.

    Attributes:
        name: name of the scene.
        tokens: T sample tokens.
        timestamps_us: (T,) increasing times.
        world_from_ego: (T, 4, 4) ego poses.
        detections: detections of each key frame.
        truth: annotated objects of each key frame.
    """

    name: str
    tokens: tuple[str, ...]
    timestamps_us: IntArray
    world_from_ego: FloatArray
    detections: tuple[Detections, ...]
    truth: tuple[AnnotatedObjects, ...]

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        for name in ("timestamps_us", "world_from_ego"):
            copy = getattr(self, name).copy()
            frozen(copy)
            object.__setattr__(self, name, copy)


@dataclass(frozen=True, eq=False)
class DetectionResults:
    """Content of a file of detection results.

    Attributes:
        path: path of the file.
        content: its JSON value; samples are validated when they are read.
    """

    path: Path
    content: Any = field(repr=False)

    @classmethod
    def load(cls, path: Path) -> DetectionResults:
        """Read a file.

        Raises:
            DataError: if the file is missing or is no JSON.
        """
        return cls(path, read_json(path))

    @property
    def sensors(self) -> tuple[str, ...]:
        """Sensors that the detector uses, such as camera and lidar, from the file's `meta`; empty if unknown."""
        meta = self.content.get("meta")
        used = [name for name, value in meta.items() if value is True] if isinstance(meta, dict) else []
        return tuple(name.removeprefix("use_") for name in used if name.startswith("use_"))

    def detections(
        self, sample_tokens: Sequence[str], world_from_ego: FloatArray, range_m: float = RANGE_M
    ) -> tuple[Detections, ...]:
        """Return the detections of T samples, given their poses (T, 4, 4); other samples are not validated.

        Raises:
            DataError: if the file is damaged or lacks a sample.
        """
        boxes = read_boxes(self.path, self.content, sample_tokens)
        return tuple(
            _sample_detections(self.path, token, own, pose, range_m)
            for token, own, pose in zip(sample_tokens, boxes, world_from_ego, strict=True)
        )


def read_detections(
    path: Path, sample_tokens: Sequence[str], world_from_ego: FloatArray, range_m: float = RANGE_M
) -> tuple[Detections, ...]:
    """Read the detections of T samples from a file of detection results.

    Args:
        path: path of the file.
        sample_tokens: T sample tokens.
        world_from_ego: (T, 4, 4) ego poses.
        range_m: range of the detector; boxes beyond it are kept.

    Raises:
        DataError: if the file is missing or damaged or lacks a sample.
    """
    return DetectionResults.load(path).detections(sample_tokens, world_from_ego, range_m)


def _sample_detections(
    path: Path, token: str, boxes: Sequence[ResultBox], pose: FloatArray, range_m: float
) -> Detections:
    try:
        return _to_ego(
            world_from_ego=pose,
            centre_m=np.array([box.translation for box in boxes]).reshape(-1, 3),
            rotation=rotation_from_quaternion(np.array([box.rotation for box in boxes]).reshape(-1, 4)),
            size_m=np.array([box.size for box in boxes]).reshape(-1, 3),
            probability=np.array([box.detection_score for box in boxes]),
            kind=tuple(box.detection_name for box in boxes),
            range_m=range_m,
        )
    except ShapeError as error:
        raise DataError(f"{path}: sample {token}: {error}") from error


def read_scene_file(path: Path, detector: str, range_m: float = RANGE_M) -> tuple[SceneDetections, ...]:
    """Read scenes with the boxes of one of the file's detectors.

    For each scene, the file has a list of key frames with token, timestamp (microseconds), ego2global (4x4), gt (a
    list of id, name, xyz, num_lidar_pts) and det (for each detector, a list of name, score, xyz, wlh, yaw); positions
    are in the global frame.

    Raises:
        DataError: if the file is missing or damaged, lacks the detector, or times do not increase.
    """
    try:
        scenes = _SCENES.validate_python(read_json(path))
    except ValidationError as error:
        raise DataError(f"{path}: expected key frames by scene ({first_problem(error)})") from error
    return tuple(_scene(path, name, frames, detector, range_m) for name, frames in scenes.items())


def _scene(path: Path, name: str, frames: Sequence[_KeyFrame], detector: str, range_m: float) -> SceneDetections:
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
                _to_ego(
                    world_from_ego=pose,
                    centre_m=np.array([box.xyz for box in boxes]).reshape(-1, 3),
                    rotation=rotation_from_quaternion(quaternion_from_yaw([box.yaw for box in boxes])),
                    size_m=np.array([box.wlh for box in boxes]).reshape(-1, 3),
                    probability=np.array([box.score for box in boxes]),
                    kind=tuple(box.name for box in boxes),
                    range_m=range_m,
                )
            )
        except ShapeError as error:
            raise DataError(f"{path}: {name}: {frame.token}: {error}") from error
    truth = tuple(_objects(frame.gt) for frame in frames)
    tokens = tuple(frame.token for frame in frames)
    return SceneDetections(name, tokens, times_us, poses, tuple(detections), truth)


def _objects(objects: Sequence[_SceneObject]) -> AnnotatedObjects:
    return AnnotatedObjects(
        np.array([one.id for one in objects], dtype=np.int64),
        tuple(one.name for one in objects),
        np.array([one.xyz for one in objects]).reshape(-1, 3),
        np.array([one.num_lidar_pts for one in objects], dtype=np.int64),
    )


def _to_ego(
    world_from_ego: FloatArray,
    centre_m: FloatArray,
    rotation: FloatArray,
    size_m: FloatArray,
    probability: FloatArray,
    kind: tuple[str, ...],
    range_m: float,
) -> Detections:
    """Return detections of N world boxes: centres (N, 3), rotations (N, 3, 3), and sizes w, l, h (N, 3)."""
    ego_from_world = inverse(world_from_ego)
    rotation_ego = ego_from_world[:3, :3] @ rotation
    half_height = size_m[:, 2:] / 2 * np.array([0.0, 0.0, 1.0])
    return Detections.from_boxes(
        ground_m=apply(ego_from_world, centre_m) - half_height,
        yaw_rad=yaw_of(rotation_ego),
        size_m=size_m,
        log_odds=log_odds_from_probability(probability),
        kind=kind,
        view=CircularView(range_m),
    )
