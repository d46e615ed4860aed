"""Validation metrics during a training: IoU of each class at every threshold, and colour error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor, distributed

from appocc.bevmap import CLASSES, VEHICLE
from appocc.errors import DataError
from appocc.grid import BEVGrid
from appocc.models.base import ModelOutput
from appocc.probability_calibration import (
    BINS,
    EDGES,
    Calibration,
    ProbabilityHistogram,
    fit_temperature_and_bias,
)
from appocc.training.batches.batch import Truth
from appocc.training.losses import LossTerms, colour_weight
from appocc.training.object_metrics import BINS as OBJECT_BINS
from appocc.training.object_metrics import best_score, object_counts, score_calibration

# Candidate thresholds are k / 100; they are among the edges of the histogram.
_THRESHOLDS = 100
_LOSSES = (*(field.name for field in fields(LossTerms)), "total")


@dataclass(frozen=True, kw_only=True)
class ValidationMetrics:
    """Metrics on the validation set; NaN where there are no cells to compare.

    Attributes:
        iou: IoU of each class at threshold 0.5.
        best_iou: IoU of each class at its best threshold.
        thresholds: best threshold of each class.
        calibration: temperature and bias of each class that fit the probabilities to the observed shares.
        vehicle_f1: best F1 of the boxes of vehicles within 40 m; None without objects.
        object_threshold: lowest score of these boxes.
        object_calibration: temperature and bias that fit the scores to the observed shares; None without objects.
        colour_l1: L1 colour error 0..255 over road, vehicle and lane cells of known colour; None without appearance.
        colour_l1_vehicles: L1 colour error over vehicle cells.
        losses: mean of each loss term over the batches, and `total`.
        samples: number of samples.
    """

    iou: Mapping[str, float]
    best_iou: Mapping[str, float]
    thresholds: Mapping[str, float]
    calibration: Mapping[str, Calibration]
    vehicle_f1: float | None
    object_threshold: float | None
    object_calibration: Calibration | None
    colour_l1: float | None
    colour_l1_vehicles: float | None
    losses: Mapping[str, float]
    samples: int

    @property
    def mean_iou(self) -> float:
        """Return the mean of the best IoU over the classes present, 0 if there is none."""
        present = [value for value in self.best_iou.values() if not math.isnan(value)]
        return sum(present) / len(present) if present else 0.0

    def as_json(self) -> dict[str, Any]:
        """Return JSON values; NaN becomes null."""
        found = {name: getattr(self, name) for name in self.__dataclass_fields__} | {"mean_iou": self.mean_iou}
        return {name: _plain(value) for name, value in found.items()}


class MetricAccumulator:
    """Accumulates `ValidationMetrics` over batches."""

    def __init__(self, device: torch.device, grid: BEVGrid) -> None:
        """Start with zero counts, for maps of a grid."""
        self._grid = grid
        self._objects = torch.zeros(3, OBJECT_BINS, dtype=torch.float64, device=device)
        self._edges = torch.from_numpy(EDGES).float().to(device)
        # [class, true state, bin of the predicted probability], and the sums of these probabilities.
        self._cells = torch.zeros(2, len(CLASSES), 2, BINS, dtype=torch.float64, device=device)
        # Sum of L1 and number of cells: all classes, vehicles.
        self._colour = torch.zeros(2, 2, dtype=torch.float64, device=device)
        # Sum over batches and their number: each loss and the total.
        self._losses = torch.zeros(len(_LOSSES), 2, dtype=torch.float64, device=device)
        self._samples = torch.zeros(1, dtype=torch.int64, device=device)

    def update(self, output: ModelOutput, truth: Truth, terms: LossTerms, total: Tensor) -> None:
        """Add a batch."""
        probability = torch.sigmoid(output.occupancy.float()).contiguous()  # B 3 X Y
        # A probability of k / 100 counts as above the threshold; rounding may put it below the edge.
        place = torch.bucketize(probability + 1e-7, self._edges, right=True).clamp(1, BINS) - 1
        place += BINS * (truth.occupancy > 0.5)
        for number in range(len(CLASSES)):
            valid = truth.occupancy_valid[:, number]
            known, values = place[:, number][valid], probability[:, number][valid].double()
            self._cells[0, number] += torch.bincount(known, minlength=2 * BINS).view(2, BINS)
            self._cells[1, number] += torch.bincount(known, values, minlength=2 * BINS).view(2, BINS)
        if output.appearance is not None:
            error = 255 * (output.appearance.float() - truth.appearance).abs().mean(1)  # B X Y
            weight = colour_weight(truth, 1.0)
            vehicles = weight * (truth.occupancy[:, VEHICLE] > 0.5) * truth.occupancy_valid[:, VEHICLE]
            for number, cells in enumerate((weight, vehicles)):
                self._colour[number] += torch.stack([(error * cells).sum(), cells.sum()])
        if output.objects is not None:
            counts = object_counts(output.objects, truth.objects, self._grid)
            self._objects += counts.to(self._objects.device)
        for number, name in enumerate(_LOSSES):
            value = total if name == "total" else getattr(terms, name)
            if value is not None:
                self._losses[number] += torch.stack([value.double(), torch.ones_like(value).double()])
        self._samples += len(truth.occupancy)

    def all_reduced(self) -> Self:
        """Sum the counts over all processes of a distributed training."""
        if distributed.is_initialized():
            for counts in (self._cells, self._objects, self._colour, self._losses, self._samples):
                distributed.all_reduce(counts)
        return self

    def compute(self) -> ValidationMetrics:
        """Return the metrics of all batches.

        Raises:
            DataError: if there are no samples.
        """
        if not int(self._samples):
            raise DataError("validation: expected samples, got none")
        (cells, sums), losses = self._cells.cpu(), self._losses.cpu().tolist()
        # Cells at or above each threshold k / 100, k = 0 .. 99.
        starts = np.searchsorted(EDGES, np.arange(_THRESHOLDS) / _THRESHOLDS - 1e-9)
        above = cells.flip(-1).cumsum(-1).flip(-1)[..., starts]  # 3 2 _THRESHOLDS
        iou = above[:, 1] / (cells[:, 1].sum(-1, keepdim=True) + above[:, 0])  # 3 _THRESHOLDS
        present = cells[:, 1].sum(-1) > 0
        iou[~present] = torch.nan
        best = torch.where(present, iou[:, 1:].nan_to_num().argmax(-1) + 1, _THRESHOLDS // 2)
        means = {name: value / count for name, (value, count) in zip(_LOSSES, losses, strict=True) if count}
        colour, vehicles = (self._colour[:, 0] / self._colour[:, 1]).tolist() if "colour" in means else (None, None)
        objects = self._objects.cpu() if "centre" in means else None
        f1, score = (None, None) if objects is None else best_score(objects)
        return ValidationMetrics(
            iou=_by_class(iou[:, _THRESHOLDS // 2]),
            best_iou=_by_class(iou.gather(1, best[:, None])[:, 0]),
            thresholds=_by_class(best.double() / _THRESHOLDS),
            calibration={name: _fit(cells[k], sums[k]) for k, name in enumerate(CLASSES)},
            vehicle_f1=f1,
            object_threshold=score,
            object_calibration=None if objects is None else score_calibration(objects),
            colour_l1=colour,
            colour_l1_vehicles=vehicles,
            losses=means,
            samples=int(self._samples),
        )


def _fit(cells: Tensor, sums: Tensor) -> Calibration:
    """Return the calibration of a class from its cells and sums of probabilities (2, BINS), false and true."""
    false, true = cells.numpy()
    return fit_temperature_and_bias(ProbabilityHistogram(false + true, sums.numpy().sum(0), true))


def _by_class(values: Tensor) -> dict[str, float]:
    return dict(zip(CLASSES, values.tolist(), strict=True))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
