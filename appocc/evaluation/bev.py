"""Maps of a source against the truth of a dataset: the figures of the paper's tables I to III, and what they hide."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from appocc.bevmap import CLASSES, VEHICLE
from appocc.checks import FloatArray, IntArray, check_distance
from appocc.errors import DataError
from appocc.evaluation.bootstrap import DRAWS, LEVEL, interval, median_of_drawn
from appocc.evaluation.cells import (
    GROUPS,
    RINGS,
    RINGS_M,
    CellCounts,
    count_cells,
    group_masks,
    ious,
    l1_by_class,
    share,
    threshold_rows,
)
from appocc.evaluation.pairs import check_there, read_pair
from appocc.evaluation.vehicles import VehicleScore, score_vehicles, true_vehicles, visibility_levels
from appocc.geometry import inverse
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample, Scene
from appocc.nuscenes.simulated import weather_of


@dataclass(frozen=True)
class Question:
    """What is compared.

    Attributes:
        source: of the maps that are judged.
        against: source of the true ones.
        ahead: whether only cells with x >= 0 count, the 180 degree setting.
        range_m: cells whose centre is farther from the ego do not count; None: all count.
    """

    source: str
    against: str
    ahead: bool = False
    range_m: float | None = None

    def __post_init__(self) -> None:
        """Check that the range can be true.

        Raises:
            ShapeError: if it is not positive and finite.
        """
        check_distance("--range", self.range_m)


class SceneScores(NamedTuple):
    """Sums over the samples of a scene.

    Attributes:
        name: of the scene.
        weather: of a simulated scene; empty of others.
        samples: how many.
        counts: of cells.
        vehicles: all vehicles of all samples.
    """

    name: str
    weather: str
    samples: int
    counts: CellCounts
    vehicles: Sequence[VehicleScore]


@dataclass(frozen=True)
class Evaluation:
    """The answer: sums by scene, from which every figure follows."""

    question: Question
    thresholds: Mapping[str, float] | None
    scenes: tuple[SceneScores, ...]

    def as_json(self) -> dict[str, Any]:
        """All figures; shares are 0..1, colours 0..255, keys as in docs/evaluation.md."""
        vehicles = [score for scene in self.scenes for score in scene.vehicles]
        q = self.question
        groups = {name: self._cells(self.scenes, name) for name in GROUPS[1:]}
        by_range = {
            name: {**groups[name], "vehicles": _vehicles(s for s in vehicles if low <= s.distance_m < high)}
            for name, (low, high) in zip(RINGS, RINGS_M, strict=True)
        }
        sighted = sum(scene.counts.overlap[0, GROUPS.index("seen") :].sum() for scene in self.scenes) > 0
        weathers = sorted({scene.weather for scene in self.scenes} - {""})
        levels = sorted({score.visibility for score in vehicles} - {""}, key=_first_number)
        return {
            "source": q.source,
            "against": q.against,
            "setting": "180" if q.ahead else "360",
            "range_m": q.range_m,
            "scenes": len(self.scenes),
            "samples": sum(scene.samples for scene in self.scenes),
            "thresholds": self.thresholds,
            **self._cells(self.scenes, "all"),
            **{f"{key}_seen": groups["seen"][key] if sighted else None for key in ("iou", "iou_at_threshold")},
            "appearance_known": share(*np.sum([scene.counts.known for scene in self.scenes], axis=0)[::-1]),
            "vehicles": _vehicles(vehicles),
            "by_range": by_range,
            "by_sight": {name: groups[name] for name in ("seen", "unseen")} if sighted else None,
            "by_weather": {name: self._weather(name) for name in weathers},
            "by_visibility": {level: _vehicles(s for s in vehicles if s.visibility == level) for level in levels},
            "confidence": self._confidence(),
        }

    def _cells(self, scenes: Sequence[SceneScores], group: str) -> dict[str, Any]:
        """Figures of a group of cells."""
        counts = [scene.counts for scene in scenes]
        overlap = np.sum([c.overlap for c in counts], axis=0)[:, GROUPS.index(group)]
        colour = np.sum([c.colour for c in counts], axis=0)[GROUPS.index(group)]
        return {
            "iou": ious(overlap[0]),
            "iou_at_threshold": ious(overlap[1]) if self.thresholds is not None else None,
            "appearance_l1": share(*colour[0]),
            "appearance_l1_by_class": l1_by_class(colour),
        }

    def _weather(self, name: str) -> dict[str, Any]:
        chosen = [scene for scene in self.scenes if scene.weather == name]
        vehicles = _vehicles(score for scene in chosen for score in scene.vehicles)
        return {"samples": sum(s.samples for s in chosen), **self._cells(chosen, "all"), "vehicles": vehicles}

    def _confidence(self) -> dict[str, Any]:
        """Ranges of the main figures."""
        overlap = np.stack([scene.counts.overlap[:, 0] for scene in self.scenes])  # S T 3 2
        colour = np.stack([scene.counts.colour[0] for scene in self.scenes])  # S 4 2
        number = len(self.scenes)

        def ratio(sums: FloatArray) -> tuple[float, float] | None:
            return interval(number, lambda weights: share(*(weights @ sums)))

        figures: dict[str, Any] = {"level": LEVEL, "draws": DRAWS, "over": "scenes"}
        for t, key in enumerate(("iou", "iou_at_threshold")[: overlap.shape[1]]):
            figures[key] = {name: ratio(overlap[:, t, c]) for c, name in enumerate(CLASSES)}
        figures["appearance_l1"] = ratio(colour[:, 0])
        figures["appearance_l1_by_class"] = {name: ratio(colour[:, c + 1]) for c, name in enumerate(CLASSES)}
        for key, only_detected in (("ciede2000_median", False), ("ciede2000_median_detected", True)):
            values, scene = self._delta_e(only_detected)
            figures[key] = interval(number, lambda w, v=values, s=scene: median_of_drawn(v, s, w))  # type: ignore[misc]
        return figures

    def _delta_e(self, only_detected: bool) -> tuple[FloatArray, IntArray]:
        """Colour errors (V,) of the vehicles that have one, and the number of each one's scene (V,)."""
        pairs = [
            (score.delta_e, i)
            for i, scene in enumerate(self.scenes)
            for score in scene.vehicles
            if score.delta_e == score.delta_e and (score.detected or not only_detected)
        ]
        values = np.array([value for value, _ in pairs], dtype=np.float64)
        return values, np.array([scene for _, scene in pairs], dtype=np.int64)


def evaluate(
    dataset: Dataset, scenes: Sequence[Scene], question: Question, advance: Callable[[float], None]
) -> Evaluation:
    """Compare the maps of all samples; only one sample's maps are in memory at a time.

    `advance` is called with the samples done.

    Raises:
        DataError: if there are no samples, or a map is missing, damaged or on another grid.
    """
    samples = [sample for scene in scenes for sample in dataset.samples(scene)]
    if not samples:
        raise DataError(f"{dataset.root}: no key frames to compare")
    for source in (question.source, question.against):
        check_there(dataset.root, source, samples)
    first = read_pair(dataset.root, question.source, question.against, samples[0].token, question.ahead)
    kept = first.made.thresholds
    scored = tuple(_score_scene(dataset, scene, question, kept, advance) for scene in scenes)
    return Evaluation(question, kept, tuple(scene for scene in scored if scene.samples))


def _score_scene(
    dataset: Dataset,
    scene: Scene,
    question: Question,
    kept: Mapping[str, float] | None,
    advance: Callable[[float], None],
) -> SceneScores:
    thresholds = threshold_rows(kept)
    counts, vehicles = CellCounts.nothing(len(thresholds)), []
    samples = dataset.samples(scene)
    annotated = dataset.annotated(scene)
    for sample in samples:
        pair = read_pair(dataset.root, question.source, question.against, sample.token, question.ahead)
        if pair.made.thresholds != kept:
            raise DataError(f"{question.source}: expected maps of one model, got other thresholds at {sample.token}")
        grid = pair.truth.grid
        within = np.linalg.norm(grid.centres(), axis=-1) <= (question.range_m or np.inf)
        masks = group_masks(grid, within, pair.seen)
        counts = counts.plus(count_cells(pair.made, pair.truth, masks, thresholds))
        boxes = _boxes(dataset, sample) if pair.instance is None and annotated else None
        true = true_vehicles(pair.truth, pair.instance, boxes)
        levels = visibility_levels(dataset, sample)
        vehicles += score_vehicles(pair.made, pair.truth, true, within, float(thresholds[-1, VEHICLE]), levels)
        advance(1)
    return SceneScores(scene.name, weather_of(scene), len(samples), counts, vehicles)


def _boxes(dataset: Dataset, sample: Sample) -> Any:
    """Annotated boxes of a sample in its ego frame."""
    return dataset.boxes_world(sample).transformed(inverse(dataset.world_from_ego(sample)))


def _vehicles(scores: Iterable[VehicleScore]) -> dict[str, Any]:
    """Figures of some vehicles."""
    rows = list(scores)
    detected = [score for score in rows if score.detected]
    return {
        "count": len(rows),
        "detected": len(detected),
        "detected_share": share(len(detected), len(rows)),
        "cells_found": _mean(score.found for score in rows),
        "appearance_l1": _mean(score.l1 for score in rows),
        "ciede2000_median": _median(score.delta_e for score in rows),
        "ciede2000_median_detected": _median(score.delta_e for score in detected),
    }


def _known(values: Iterable[float]) -> FloatArray:
    array = np.array(list(values), dtype=np.float64)
    return array[np.isfinite(array)]


def _mean(values: Iterable[float]) -> float:
    known = _known(values)
    return float(known.mean()) if len(known) else float("nan")


def _median(values: Iterable[float]) -> float:
    known = _known(values)
    return float(np.median(known)) if len(known) else float("nan")


def _first_number(level: str) -> int:
    """v0-40 comes before v80-100."""
    found = re.search(r"\d+", level)
    return int(found[0]) if found else 0
