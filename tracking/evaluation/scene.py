"""Scores of a scene's tracks against the annotations of its dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from appocc.boxes import Boxes, is_person_or_bicycle
from appocc.checks import FloatArray
from appocc.files import write_json
from appocc.nuscenes import Dataset, Sample
from tracking.evaluation.alignment import tracking_class
from tracking.evaluation.clear_id_hota import MetricCounts, Metrics, count
from tracking.evaluation.frames import GATE_M, EvaluationFrame
from tracking.io.nuscenes_detections import TRACKED
from tracking.pipeline import SceneTracks, write_tracks
from tracking.tracks import Track

RANGE_M = 40.0
# Minimum extent of a moving object's centres over the scene; annotations of parked objects jitter by less.
MOVING_SPAN_M = 2.0
# Names of the metrics: of all vehicles, of those that move in the scene, and of the others.
KINDS = ("metrics", "metrics_moving", "metrics_parked")


def score_scene(dataset: Dataset, result: SceneTracks) -> dict[str, Metrics] | None:
    """Return metrics of all, moving and parked vehicles, see `count_scene`; None if the scene has no annotations."""
    counts = count_scene(result, read_truths(dataset, result.scene, result.samples))
    return None if counts is None else metrics_of(counts)


def metrics_of(counts: Mapping[str, MetricCounts]) -> dict[str, Metrics]:
    """Return the metrics of each kind of vehicles from their counts."""
    return {name: each.metrics() for name, each in counts.items()}


def read_truths(dataset: Dataset, scene: str, samples: Iterable[Sample]) -> tuple[Boxes, ...] | None:
    """Return the annotated vehicles of some key frames of a scene; None if it has no annotations.

    Raises:
        DataError: if an annotation is damaged.
    """
    if not dataset.annotated(dataset.scene(scene)):
        return None
    return tuple(dataset.boxes_world(sample).vehicles() for sample in samples)


def count_scene(result: SceneTracks, truths: Sequence[Boxes] | None) -> dict[str, MetricCounts] | None:
    """Return what the metrics of all, moving and parked vehicles are computed from; None without annotations.

    Annotated vehicles whose centres are within RANGE_M of the ego on the ground are required. Others are ignored,
    also parked vehicles in the metrics of moving ones and vice versa, and so are unmatched tracks beyond the range.
    If a detector's boxes are tracked, vehicles that are of none of the classes tracked are ignored, too.
    """
    if truths is None:
        return None
    moving = moving_instances(truths)
    kinds = dict(zip(KINDS, (None, True, False), strict=True))
    vehicles = replace(result, tracks=tuple(tuple(filter(_is_vehicle, states)) for states in result.tracks))
    return {name: count(_evaluation_frames(vehicles, truths, moving, kind)) for name, kind in kinds.items()}


def _is_vehicle(track: Track) -> bool:
    """Return whether a track is compared with annotated vehicles."""
    return not is_person_or_bicycle(track.kind)


def moving_instances(truths: Sequence[Boxes]) -> set[str]:
    """Return the instances whose centres span more than MOVING_SPAN_M in the world plane over the given frames."""
    positions: dict[str, list[FloatArray]] = {}
    for boxes in truths:
        for instance, centre in zip(boxes.instance, boxes.centre_m, strict=True):
            positions.setdefault(instance, []).append(centre[:2])
    return {name for name, path in positions.items() if np.hypot(*np.ptp(path, axis=0)) > MOVING_SPAN_M}


def _evaluation_frames(
    result: SceneTracks, truths: Sequence[Boxes], moving: set[str], kind: bool | None
) -> list[EvaluationFrame]:
    """Return ground truth and tracks of each key frame, in world x and y; `kind` selects moving or parked objects."""
    from_maps = result.sensors is None
    names = sorted({instance for boxes in truths for instance in boxes.instance})
    number = {name: i for i, name in enumerate(names)}
    frames = []
    for pose, boxes, tracks in zip(result.world_from_ego, truths, result.tracks, strict=True):
        ego_xy_m = pose[:2, 3]
        track_xy_m = np.array([track.position_world_m[:2] for track in tracks]).reshape(-1, 2)
        selected = np.array([kind is None or (name in moving) == kind for name in boxes.instance], dtype=np.bool_)
        selected &= [from_maps or tracking_class(category) in TRACKED for category in boxes.category]
        frames.append(
            EvaluationFrame(
                truth_ids=np.array([number[name] for name in boxes.instance], dtype=np.int64),
                truth_xy_m=boxes.centre_m[:, :2].copy(),
                required=selected & (np.linalg.norm(boxes.centre_m[:, :2] - ego_xy_m, axis=1) <= RANGE_M),
                track_ids=np.array([track.id for track in tracks], dtype=np.int64),
                track_xy_m=track_xy_m,
                penalised=np.linalg.norm(track_xy_m - ego_xy_m, axis=1) <= RANGE_M,
            )
        )
    return frames


def write_scored_tracks(folder: Path, result: SceneTracks, metrics: dict[str, Metrics] | None) -> list[Path]:
    """Write the tracks, see `write_tracks`, and metrics.json if there are metrics; return the paths.

    Raises:
        DataError: if a file cannot be written.
    """
    paths = write_tracks(folder, result)
    if metrics is not None:
        paths.append(folder / "metrics.json")
        write_metrics(paths[-1], result, metrics)
    return paths


def write_metrics(path: Path, result: SceneTracks, metrics: dict[str, Metrics]) -> None:
    """Write the scores with their protocol.

    Raises:
        DataError: if the file cannot be written.
    """
    protocol: dict[str, Any] = {"range_m": RANGE_M, "gate_m": GATE_M, "moving_span_m": MOVING_SPAN_M}
    scores = {name: value.as_json() for name, value in metrics.items()}
    source = "bev" if result.sensors is None else "detections"
    write_json(path, {"scene": result.scene, source: result.source, "protocol": protocol, **scores})
