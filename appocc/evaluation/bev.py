"""Evaluation of the maps of a source against the true maps: metrics of the paper's tables I to III and more."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from appocc.bevmap import CLASSES
from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from appocc.evaluation.bev_frames import (
    EvaluationConfig,
    FrameComparison,
    FrameResult,
    FrameScore,
    frame_inputs,
    model_of,
)
from appocc.evaluation.bootstrap import DRAWS, LEVEL, confidence_interval, resampled_median
from appocc.evaluation.cells import (
    GROUPS,
    RINGS,
    RINGS_M,
    CellCounts,
    ious,
    known_values,
    l1_by_class,
    mean_of_known,
    psnr,
    ratio,
    threshold_rows,
)
from appocc.evaluation.pairs import FRAMES_AT_ONCE, check_maps_exist, read_map_pair
from appocc.evaluation.vehicles import VehicleScore
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Scene
from appocc.nuscenes.simulated import weather_of
from appocc.probability_calibration import (
    ProbabilityHistogram,
    calibration_error,
    reliability_table,
)
from appocc.workers import Engine, in_order

__all__ = ["Evaluation", "EvaluationConfig", "FrameScore", "SceneScores", "evaluate"]


class SceneScores(NamedTuple):
    """Sums over the samples of a scene.

    Attributes:
        name: name of the scene.
        weather: weather of a simulated scene; empty for recorded scenes.
        samples: number of samples.
        counts: cell counts.
        probabilities: histogram of the probabilities of road, vehicle, lane.
        vehicles: scores of all vehicles of all samples.
        frames: score of each sample.
    """

    name: str
    weather: str
    samples: int
    counts: CellCounts
    probabilities: tuple[ProbabilityHistogram, ...]
    vehicles: Sequence[VehicleScore]
    frames: Sequence[FrameScore]


@dataclass(frozen=True)
class Evaluation:
    """Result of an evaluation: sums by scene, from which all metrics are computed."""

    config: EvaluationConfig
    scenes: tuple[SceneScores, ...]

    @property
    def thresholds(self) -> dict[str, float] | None:
        """Mean thresholds of the maps, by class; None for maps without."""
        kept = [frame.thresholds for scene in self.scenes for frame in scene.frames if frame.thresholds is not None]
        return {name: float(np.mean([each[name] for each in kept])) for name in CLASSES} if kept else None

    def as_json(self) -> dict[str, Any]:
        """Return all metrics; ratios 0..1, colours 0..255, keys as in docs/evaluation.md."""
        vehicles = [score for scene in self.scenes for score in scene.vehicles]
        config = self.config
        groups = {name: self._cells(self.scenes, name) for name in GROUPS[1:]}
        by_range = {
            name: {**groups[name], "vehicles": _vehicles(s for s in vehicles if low <= s.distance_m < high)}
            for name, (low, high) in zip(RINGS, RINGS_M, strict=True)
        }
        sighted = sum(scene.counts.overlap[0, GROUPS.index("seen") :].sum() for scene in self.scenes) > 0
        weathers = sorted({scene.weather for scene in self.scenes} - {""})
        levels = sorted({score.visibility for score in vehicles} - {""}, key=_first_number)
        return {
            "source": config.source,
            "against": config.against,
            "setting": "180" if config.ahead else "360",
            "range_m": config.range_m,
            "scenes": len(self.scenes),
            "samples": sum(scene.samples for scene in self.scenes),
            "thresholds": self.thresholds,
            **self._cells(self.scenes, "all"),
            **{f"{key}_seen": groups["seen"][key] if sighted else None for key in ("iou", "iou_at_threshold")},
            "appearance_known": ratio(*np.sum([scene.counts.known for scene in self.scenes], axis=0)[::-1]),
            "vehicles": _vehicles(vehicles),
            "by_range": by_range,
            "by_sight": {name: groups[name] for name in ("seen", "unseen")} if sighted else None,
            "by_weather": {name: self._weather(name) for name in weathers},
            "by_visibility": {level: _vehicles(s for s in vehicles if s.visibility == level) for level in levels},
            "calibration": self._calibration(),
            "confidence": self._confidence(),
        }

    def _cells(self, scenes: Sequence[SceneScores], group: str) -> dict[str, Any]:
        """Return the metrics of a group of cells."""
        counts = [scene.counts for scene in scenes]
        overlap = np.sum([c.overlap for c in counts], axis=0)[:, GROUPS.index(group)]
        colour = np.sum([c.colour for c in counts], axis=0)[GROUPS.index(group)]
        return {
            "iou": ious(overlap[0]),
            "iou_at_threshold": ious(overlap[1]) if self.thresholds is not None else None,
            "appearance_l1": ratio(*colour[0]),
            "appearance_l1_by_class": l1_by_class(colour),
            "appearance_psnr": psnr(np.sum([c.squared for c in counts], axis=0)[GROUPS.index(group)]),
        }

    def _weather(self, name: str) -> dict[str, Any]:
        chosen = [scene for scene in self.scenes if scene.weather == name]
        vehicles = _vehicles(score for scene in chosen for score in scene.vehicles)
        return {"samples": sum(s.samples for s in chosen), **self._cells(chosen, "all"), "vehicles": vehicles}

    def _calibration(self) -> dict[str, Any] | None:
        """Return error and reliability table of each class; None if all probabilities are 0 or 1."""
        none = (ProbabilityHistogram.zeros(),) * len(CLASSES)
        sums = reduce(_added, (scene.probabilities for scene in self.scenes), none)
        if all(histogram.certain for histogram in sums):
            return None
        return {
            name: {"ece": calibration_error(histogram), "table": reliability_table(histogram)}
            for name, histogram in zip(CLASSES, sums, strict=True)
        }

    def _confidence(self) -> dict[str, Any]:
        """Return the confidence intervals of the main metrics."""
        overlap = np.stack([scene.counts.overlap[:, 0] for scene in self.scenes])  # S T 3 2
        colour = np.stack([scene.counts.colour[0] for scene in self.scenes])  # S 4 2
        number = len(self.scenes)

        def ratio_interval(sums: FloatArray) -> tuple[float, float] | None:
            return confidence_interval(number, lambda weights: ratio(*(weights @ sums)))

        figures: dict[str, Any] = {"level": LEVEL, "draws": DRAWS, "over": "scenes"}
        for t, key in enumerate(("iou", "iou_at_threshold")[: overlap.shape[1]]):
            figures[key] = {name: ratio_interval(overlap[:, t, c]) for c, name in enumerate(CLASSES)}
        figures["appearance_l1"] = ratio_interval(colour[:, 0])
        figures["appearance_l1_by_class"] = {name: ratio_interval(colour[:, c + 1]) for c, name in enumerate(CLASSES)}
        for key, only_detected in (("ciede2000_median", False), ("ciede2000_median_detected", True)):
            values, scene = self._delta_e(only_detected)
            figures[key] = confidence_interval(number, lambda w, v=values, s=scene: resampled_median(v, s, w))  # type: ignore[misc]
        return figures

    def _delta_e(self, only_detected: bool) -> tuple[FloatArray, IntArray]:
        """Return the known colour errors (V,) of vehicles and the scene index (V,) of each."""
        pairs = [
            (score.delta_e, i)
            for i, scene in enumerate(self.scenes)
            for score in scene.vehicles
            if score.delta_e == score.delta_e and (score.detected or not only_detected)
        ]
        values = np.array([value for value, _ in pairs], dtype=np.float64)
        return values, np.array([scene for _, scene in pairs], dtype=np.int64)


def evaluate(
    dataset: Dataset,
    scenes: Sequence[Scene],
    config: EvaluationConfig,
    advance: Callable[[float], None],
    pool: Engine | None = None,
) -> Evaluation:
    """Compare the maps of all samples, a few samples at a time.

    Args:
        dataset: dataset of the scenes.
        scenes: scenes to evaluate.
        config: maps and cells to compare.
        advance: progress callback with the number of new samples.
        pool: where samples are compared. Sums are made here in the order of the samples: the result does not depend
            on the pool.

    Raises:
        DataError: if there are no samples, or a map is missing, damaged or on another grid.
    """
    samples = [sample for scene in scenes for sample in dataset.samples(scene)]
    if not samples:
        raise DataError(f"{dataset.root}: no key frames to compare")
    for source in (config.source, config.against):
        check_maps_exist(dataset.root, source, samples)
    first = read_map_pair(dataset.root, config.source, config.against, samples[0].token, config.ahead)
    rows = len(threshold_rows(first.predicted.thresholds))
    frames = (frame for scene in scenes for frame in frame_inputs(dataset, scene))
    compared = in_order(
        pool, FrameComparison(dataset.root, config, model_of(first.predicted)), frames, FRAMES_AT_ONCE
    )
    scored = tuple(_sum_scene(dataset, scene, compared, rows, advance) for scene in scenes)
    return Evaluation(config, tuple(scene for scene in scored if scene.samples))


def _sum_scene(
    dataset: Dataset,
    scene: Scene,
    compared: Iterator[FrameResult],
    thresholds: int,
    advance: Callable[[float], None],
) -> SceneScores:
    """Take the results of a scene's samples from those of all scenes, and add them up."""
    counts, vehicles, frames = CellCounts.zeros(thresholds), list[VehicleScore](), list[FrameScore]()
    probabilities = (ProbabilityHistogram.zeros(),) * len(CLASSES)
    for result in islice(compared, len(dataset.samples(scene))):
        counts = counts.plus(result.counts)
        probabilities = _added(probabilities, result.probabilities)
        vehicles += result.vehicles
        frames.append(result.score)
        advance(1)
    return SceneScores(scene.name, weather_of(scene), len(frames), counts, probabilities, vehicles, frames)


def _added(
    one: tuple[ProbabilityHistogram, ...], other: tuple[ProbabilityHistogram, ...]
) -> tuple[ProbabilityHistogram, ...]:
    return tuple(a.plus(b) for a, b in zip(one, other, strict=True))


def _vehicles(scores: Iterable[VehicleScore]) -> dict[str, Any]:
    """Return the metrics of some vehicles."""
    rows = list(scores)
    detected = [score for score in rows if score.detected]
    return {
        "count": len(rows),
        "detected": len(detected),
        "detected_share": ratio(len(detected), len(rows)),
        "cells_found": mean_of_known(score.cell_recall for score in rows),
        "appearance_l1": mean_of_known(score.colour_l1 for score in rows),
        "ciede2000_median": _median(score.delta_e for score in rows),
        "ciede2000_median_detected": _median(score.delta_e for score in detected),
    }


def _median(values: Iterable[float]) -> float:
    known = known_values(values)
    return float(np.median(known)) if len(known) else float("nan")


def _first_number(level: str) -> int:
    """Return the first number of a visibility level, for sorting: v0-40 before v80-100."""
    found = re.search(r"\d+", level)
    return int(found[0]) if found else 0
