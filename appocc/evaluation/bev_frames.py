"""Comparison of the maps of one sample with the true ones: the job of a worker in the evaluation of maps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.bevmap import CLASSES, VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import BoolArray, check_distance
from appocc.errors import DataError
from appocc.evaluation.cells import CellCounts, cell_group_masks, count_cells, ious, mean_of_known, threshold_rows
from appocc.evaluation.pairs import MapPair, read_map_pair
from appocc.evaluation.vehicles import VehicleScore, score_vehicles, true_vehicles, visibility_levels
from appocc.geometry import inverse
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Scene
from appocc.probability_calibration import ProbabilityHistogram, histogram_of


@dataclass(frozen=True)
class EvaluationConfig:
    """Maps and cells to compare.

    Attributes:
        source: source of the evaluated maps.
        against: source of the true maps.
        ahead: whether only cells with x >= 0 count (the 180 degree setting).
        range_m: largest distance of a cell centre from the ego origin; None: all cells.
    """

    source: str
    against: str
    ahead: bool = False
    range_m: float | None = None

    def __post_init__(self) -> None:
        """Check the range.

        Raises:
            ShapeError: if it is not positive and finite.
        """
        check_distance("--range", self.range_m)


class FrameScore(NamedTuple):
    """Score of one sample.

    Attributes:
        token: token of the sample.
        number: index of the sample in its scene.
        iou: IoU by class at the map's thresholds, else at 0.5; NaN where neither map has a cell.
        thresholds: the map's thresholds by class; None for maps without.
    """

    token: str
    number: int
    iou: Mapping[str, float]
    thresholds: Mapping[str, float] | None

    @property
    def mean_iou(self) -> float:
        """Mean IoU of the classes that the frame has; NaN if it has none."""
        return mean_of_known(self.iou.values())


class FrameInput(NamedTuple):
    """A sample to compare, with what the tables tell of it: workers read no tables.

    Attributes:
        token: token of the sample.
        number: index of the sample in its scene.
        boxes_ego: annotated boxes in the ego frame; None if the scene is not annotated.
        levels: visibility level by instance token.
    """

    token: str
    number: int
    boxes_ego: Boxes | None
    levels: Mapping[str, str]


class FrameResult(NamedTuple):
    """What a sample adds to the sums of its scene.

    Attributes:
        score: score of the sample.
        counts: cell counts.
        probabilities: histogram of the probabilities of road, vehicle, lane.
        vehicles: scores of its vehicles.
    """

    score: FrameScore
    counts: CellCounts
    probabilities: tuple[ProbabilityHistogram, ...]
    vehicles: Sequence[VehicleScore]


def frame_inputs(dataset: Dataset, scene: Scene) -> Iterator[FrameInput]:
    """Yield the samples of a scene to compare.

    Raises:
        DataError: if an annotation or a pose is damaged.
    """
    annotated = dataset.annotated(scene)
    for number, sample in enumerate(dataset.samples(scene)):
        boxes = None
        if annotated:
            boxes = dataset.boxes_world(sample).transformed(inverse(dataset.world_from_ego(sample)))
        yield FrameInput(sample.token, number, boxes, visibility_levels(dataset, sample))


def model_of(bev: BEVMap) -> tuple[Any, bool]:
    """Return the weights of a map as in its meta, and whether it has thresholds: maps of one model have the same."""
    return bev.meta.get("weights"), bev.thresholds is not None


@dataclass(frozen=True)
class FrameComparison:
    """The job of a worker: compare the maps of a sample.

    Attributes:
        root: dataset.
        config: maps and cells to compare.
        model: what all evaluated maps must have, `model_of` the first.
    """

    root: Path
    config: EvaluationConfig
    model: tuple[Any, bool]

    def __call__(self, frame: FrameInput) -> FrameResult:
        """Compare the maps of a sample.

        Raises:
            DataError: if a map is missing, damaged, on another grid or of another model.
        """
        config = self.config
        pair = read_map_pair(self.root, config.source, config.against, frame.token, config.ahead)
        if model_of(pair.predicted) != self.model:
            raise DataError(f"{config.source}: expected maps of one model, got other weights in {frame.token}")
        grid, thresholds = pair.truth.grid, pair.predicted.thresholds
        rows = threshold_rows(thresholds)
        within = np.linalg.norm(grid.centres(), axis=-1) <= (config.range_m or np.inf)
        counts = count_cells(pair.predicted, pair.truth, cell_group_masks(grid, within, pair.seen), rows)
        true = true_vehicles(pair.truth, pair.instance, frame.boxes_ego)
        least = float(rows[-1, VEHICLE])
        vehicles = score_vehicles(pair.predicted, pair.truth, true, within, least, frame.levels)
        score = FrameScore(frame.token, frame.number, ious(counts.overlap[-1, 0]), thresholds)
        return FrameResult(score, counts, _histograms(pair, within), vehicles)


def _histograms(pair: MapPair, within: BoolArray) -> tuple[ProbabilityHistogram, ...]:
    """Return the histogram of each class over the cells of a mask (X, Y) that are valid in both maps."""
    valid = pair.predicted.occupancy_valid & pair.truth.occupancy_valid & within
    on = pair.truth.occupancy >= 0.5
    return tuple(histogram_of(pair.predicted.occupancy[c][valid[c]], on[c][valid[c]]) for c in range(len(CLASSES)))
