"""Evaluation of detections, from a file of results or from the objects of maps, against the annotations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from appocc.bevmap import bev_folder, bev_path, load_map
from appocc.checks import FloatArray, check_distance
from appocc.errors import DataError, ShapeError
from appocc.evaluation.detections.benchmark import BenchmarkScores, score_benchmark
from appocc.evaluation.detections.box_table import detected_boxes
from appocc.evaluation.detections.truth import read_truth
from appocc.evaluation.detections.vehicles import VehicleDetection, score_vehicle_detection
from appocc.evaluation.pairs import FRAMES_AT_ONCE, check_maps_exist
from appocc.files import read_json
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.detection_results import MOST_PER_SAMPLE, ResultBox, read_boxes, result_boxes
from appocc.nuscenes.records import Sample, Scene
from appocc.workers import Engine, in_order


@dataclass(frozen=True)
class DetectionEvaluationConfig:
    """Detections to evaluate.

    Attributes:
        source: file of nuScenes' detection results, or source of maps with objects.
        against: source of the true maps for the colours of vehicles; None: colours are not evaluated.
        range_m: upper limit of the benchmark's ranges by class; None: 40 or 50 m by class.
    """

    source: Path | str
    against: str | None = None
    range_m: float | None = None

    def __post_init__(self) -> None:
        """Check the range.

        Raises:
            ShapeError: if it is not positive and finite.
        """
        check_distance("--range", self.range_m)


@dataclass(frozen=True, eq=False)
class DetectionEvaluation:
    """Result of an evaluation.

    Attributes:
        config: what was evaluated.
        scenes: number of scenes.
        samples: number of key frames.
        benchmark: nuScenes' detection metric.
        score: lowest score of the detections in `vehicles`.
        vehicles: vehicles as one class, by range.
    """

    config: DetectionEvaluationConfig
    scenes: int
    samples: int
    benchmark: BenchmarkScores
    score: float
    vehicles: Sequence[VehicleDetection]

    def as_json(self) -> dict[str, Any]:
        """Return all metrics; shares 0..1, keys as in docs/evaluation.md."""
        by_class = {
            kind: {"count": one.positives, "AP": one.mean_ap, "AP_at_m": {f"{m:g}": v for m, v in one.ap.items()}}
            | dict(one.errors)
            for kind, one in self.benchmark.by_class.items()
        }
        return {
            "source": str(self.config.source),
            "against": self.config.against,
            "range_m": self.config.range_m,
            "scenes": self.scenes,
            "samples": self.samples,
            "mAP": self.benchmark.mean_ap,
            **{f"m{name}": error for name, error in self.benchmark.errors.items()},
            "NDS": self.benchmark.nds,
            "by_class": by_class,
            "vehicles": {
                "score": self.score,
                **{f"within_{one.range_m:g}_m": one.as_json() for one in self.vehicles},
            },
        }


def true_map_source(root: Path) -> str | None:
    """Return the source of the true maps of a dataset: exact, else groundtruth; None if it has neither."""
    return next((name for name in ("exact", "groundtruth") if bev_folder(root, name).is_dir()), None)


def evaluate_detections(
    dataset: Dataset,
    scenes: Sequence[Scene],
    config: DetectionEvaluationConfig,
    advance: Callable[[float], None],
    pool: Engine | None = None,
) -> DetectionEvaluation:
    """Evaluate the detections of the annotated scenes among some scenes.

    Args:
        dataset: dataset of the scenes.
        scenes: scenes to evaluate.
        config: detections to evaluate.
        advance: progress callback with the number of new samples.
        pool: where maps are read; the result does not depend on it.

    Raises:
        DataError: if no scene is annotated, a file is missing or damaged or lacks a sample, or a map has no objects.
    """
    annotated = [scene for scene in scenes if dataset.annotated(scene)]
    samples = [sample for scene in annotated for sample in dataset.samples(scene)]
    if not samples:
        raise DataError(f"{dataset.root}: no annotated key frames to compare with")
    if config.against is not None:
        check_maps_exist(dataset.root, config.against, samples)
    # First, as a file that is wrong is told at once, and the truth takes long.
    boxes = _read_detections(dataset, samples, config.source, pool)
    truth = read_truth(dataset, samples, config.against, advance, pool)
    try:
        detected = detected_boxes(boxes, truth.world_from_ego, truth.racks)
    except ShapeError as error:
        raise DataError(f"{config.source}: {error}") from error
    benchmark = score_benchmark(detected, truth.boxes, config.range_m)
    score, vehicles = score_vehicle_detection(detected, truth.boxes, truth.light)
    return DetectionEvaluation(config, len(annotated), len(samples), benchmark, score, vehicles)


def _read_detections(
    dataset: Dataset, samples: Sequence[Sample], source: Path | str, pool: Engine | None
) -> list[list[ResultBox]]:
    if isinstance(source, Path):
        boxes = read_boxes(source, read_json(source), [sample.token for sample in samples])
        most = max(len(own) for own in boxes)
        if most > MOST_PER_SAMPLE:
            raise DataError(f"{source}: expected at most {MOST_PER_SAMPLE} boxes a sample, got {most}")
        return boxes
    check_maps_exist(dataset.root, source, list(samples))
    inputs = ((sample.token, dataset.world_from_ego(sample)) for sample in samples)
    return list(in_order(pool, partial(_map_boxes, root=dataset.root, source=source), inputs, FRAMES_AT_ONCE))


def _map_boxes(wanted: tuple[str, FloatArray], root: Path, source: str) -> list[ResultBox]:
    """Return the objects of a map as results; `wanted` is the token of its sample with the ego pose."""
    token, world_from_ego = wanted
    objects = load_map(root, source, token).known_objects
    if objects is None:
        raise DataError(f"{bev_path(root, source, token)}: expected a map with objects, got one without")
    return result_boxes(objects, world_from_ego)
