"""Validation metrics during a training: IoU of each class at every threshold, and colour error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import torch
from torch import Tensor, distributed

from appocc.bevmap import CLASSES, VEHICLE
from appocc.errors import DataError
from appocc.models.base import ModelOutput
from appocc.training.batch import Truth
from appocc.training.losses import LossTerms, colour_weight

# Candidate thresholds are k / 100.
_BINS = 100
_LOSSES = (*(field.name for field in fields(LossTerms)), "total")


@dataclass(frozen=True, kw_only=True)
class ValidationMetrics:
    """Metrics on the validation set; NaN where there are no cells to compare.

    Attributes:
        iou: IoU of each class at threshold 0.5.
        best_iou: IoU of each class at its best threshold.
        thresholds: best threshold of each class.
        colour_l1: L1 colour error 0..255 over road, vehicle and lane cells of known colour; None without appearance.
        colour_l1_vehicles: L1 colour error over vehicle cells.
        losses: mean of each loss term over the batches, and `total`.
        samples: number of samples.
    """

    iou: Mapping[str, float]
    best_iou: Mapping[str, float]
    thresholds: Mapping[str, float]
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

    def __init__(self, device: torch.device) -> None:
        """Start with zero counts."""
        # [class, true state, bin of the predicted probability]
        self._cells = torch.zeros(len(CLASSES), 2, _BINS, dtype=torch.float64, device=device)
        # Sum of L1 and number of cells: all classes, vehicles.
        self._colour = torch.zeros(2, 2, dtype=torch.float64, device=device)
        # Sum over batches and their number: each loss and the total.
        self._losses = torch.zeros(len(_LOSSES), 2, dtype=torch.float64, device=device)
        self._samples = torch.zeros(1, dtype=torch.int64, device=device)

    def update(self, output: ModelOutput, truth: Truth, terms: LossTerms, total: Tensor) -> None:
        """Add a batch."""
        probability = torch.sigmoid(output.occupancy.float())  # B 3 X Y
        place = (probability * _BINS).long().clamp(max=_BINS - 1) + _BINS * (truth.occupancy > 0.5)
        for number in range(len(CLASSES)):
            known = place[:, number][truth.occupancy_valid[:, number]]
            self._cells[number] += torch.bincount(known, minlength=2 * _BINS).view(2, _BINS)
        if output.appearance is not None:
            error = 255 * (output.appearance.float() - truth.appearance).abs().mean(1)  # B X Y
            weight = colour_weight(truth, 1.0)
            vehicles = weight * (truth.occupancy[:, VEHICLE] > 0.5) * truth.occupancy_valid[:, VEHICLE]
            for number, cells in enumerate((weight, vehicles)):
                self._colour[number] += torch.stack([(error * cells).sum(), cells.sum()])
        for number, name in enumerate(_LOSSES):
            value = total if name == "total" else getattr(terms, name)
            if value is not None:
                self._losses[number] += torch.stack([value.double(), torch.ones_like(value).double()])
        self._samples += len(truth.occupancy)

    def all_reduced(self) -> Self:
        """Sum the counts over all processes of a distributed training."""
        if distributed.is_initialized():
            for counts in (self._cells, self._colour, self._losses, self._samples):
                distributed.all_reduce(counts)
        return self

    def compute(self) -> ValidationMetrics:
        """Return the metrics of all batches.

        Raises:
            DataError: if there are no samples.
        """
        if not int(self._samples):
            raise DataError("validation: expected samples, got none")
        cells, losses = self._cells.cpu(), self._losses.cpu().tolist()
        # Cells at or above each threshold k / 100, k = 0 .. 99.
        above = cells.flip(-1).cumsum(-1).flip(-1)  # 3 2 _BINS
        iou = above[:, 1] / (cells[:, 1].sum(-1, keepdim=True) + above[:, 0])  # 3 _BINS
        present = cells[:, 1].sum(-1) > 0
        iou[~present] = torch.nan
        best = torch.where(present, iou[:, 1:].nan_to_num().argmax(-1) + 1, _BINS // 2)
        means = {name: value / count for name, (value, count) in zip(_LOSSES, losses, strict=True) if count}
        colour, vehicles = (self._colour[:, 0] / self._colour[:, 1]).tolist() if "colour" in means else (None, None)
        return ValidationMetrics(
            iou=_by_class(iou[:, _BINS // 2]),
            best_iou=_by_class(iou.gather(1, best[:, None])[:, 0]),
            thresholds=_by_class(best.double() / _BINS),
            colour_l1=colour,
            colour_l1_vehicles=vehicles,
            losses=means,
            samples=int(self._samples),
        )


def _by_class(values: Tensor) -> dict[str, float]:
    return dict(zip(CLASSES, values.tolist(), strict=True))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
