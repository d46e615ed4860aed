"""What a network is told of its errors: occupancy, colour, and what its pictures show."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor
from torch.nn import functional

from appocc.bevmap import CLASSES, VEHICLE
from appocc.models.base import DEPTH_BINS, DEPTH_STEP_M, FIRST_DEPTH_M, ModelOutput
from appocc.training.batch import Truth
from appocc.training.config import LossConfig


@dataclass(frozen=True)
class LossTerms:
    """Each error by its name, without its weight; scalars, None where the network does not answer.

    Attributes:
        road: occupancy of a class, mean over its cells that are known; so `vehicle` and `lane`.
        vehicle: see `road`.
        lane: see `road`.
        colour: L1 of sRGB 0..1 on cells of road, vehicle and lane, mean over channels and (weighted) cells.
        depth: cross-entropy of the depth bins, mean over places of which the depth is known.
        kind: cross-entropy of what is seen there.
    """

    road: Tensor
    vehicle: Tensor
    lane: Tensor
    colour: Tensor | None = None
    depth: Tensor | None = None
    kind: Tensor | None = None

    def total(self, config: LossConfig) -> Tensor:
        """The weighted sum; what has no weight is part of it still, so that every parameter has a gradient."""
        weights = {**dict(zip(CLASSES, config.classes, strict=True)), **config.model_dump()}
        terms = ((name, getattr(self, name)) for name in self.names())
        return torch.stack([weights[name] * term for name, term in terms]).sum()

    def names(self) -> tuple[str, ...]:
        """Of the terms that there are."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name) is not None)


def losses(output: ModelOutput, truth: Truth, config: LossConfig) -> LossTerms:
    """All errors of a batch, in float32 whatever the precision of the network."""
    road, vehicle, lane = occupancy_loss(output.occupancy, truth, config)
    colour = colour_loss(output.appearance, truth, config.vehicles) if output.appearance is not None else None
    depth = kind = None
    if output.views is not None and output.views.depth is not None:
        depth = depth_loss(output.views.depth, truth.depth_m)
    if output.views is not None and output.views.kind is not None:
        kind = kind_loss(output.views.kind, truth.kind, truth.depth_m)
    return LossTerms(road, vehicle, lane, colour, depth, kind)


def occupancy_loss(logits: Tensor, truth: Truth, config: LossConfig) -> Tensor:
    """(3,) mean over the known cells of each class: cross-entropy with `pos_weight`, or the focal loss.

    The focal loss (Lin et al. 2017, equation 4) takes the cross-entropy times (1 - p)^gamma, p what the network gives
    to what is true.
    """
    logits, on = logits.float(), truth.occupancy
    weight = torch.tensor(config.pos_weight, device=logits.device)[:, None, None]  # 3 1 1
    error = functional.binary_cross_entropy_with_logits(logits, on, pos_weight=weight, reduction="none")  # B 3 X Y
    if config.occupancy == "focal":
        wrong = torch.sigmoid(logits * (1 - 2 * on))  # probability of what is not true
        error = error * wrong**config.focal_gamma
    return _mean(error, truth.occupancy_valid.float(), (0, 2, 3))


def colour_weight(truth: Truth, vehicles: float) -> Tensor:
    """(B, X, Y) how much a cell's colour counts: cells of a known class and colour, 0 elsewhere, more on vehicles.

    What else lies around, roofs and crowns of trees, cannot be seen from a car.
    """
    on = (truth.occupancy > 0.5) & truth.occupancy_valid  # B 3 X Y
    weight = torch.where(on[:, VEHICLE], vehicles, on.any(1).float())
    return weight * truth.appearance_valid


def colour_loss(appearance: Tensor, truth: Truth, vehicles: float) -> Tensor:
    """L1 of colours, 0..1, mean over channels and cells by `colour_weight`."""
    error = (appearance.float() - truth.appearance).abs().mean(1)  # B X Y
    return _mean(error, colour_weight(truth, vehicles))


def depth_bin(depth_m: Tensor) -> Tensor:
    """Bin of each depth (its centre is nearest), -1 outside of the bins, in the sky and where unknown; int64."""
    place = (depth_m - (FIRST_DEPTH_M - DEPTH_STEP_M / 2)) / DEPTH_STEP_M
    inside = (depth_m > 0) & (place >= 0) & (place < DEPTH_BINS)
    return torch.where(inside, place.nan_to_num(posinf=0.0), -1.0).floor().long()


def depth_loss(logits: Tensor, depth_m: Tensor) -> Tensor:
    """Cross-entropy of bins; logits (B, N, DEPTH_BINS, h, w), truth (B, N, H, W), H a multiple of h."""
    # The truth that counts is the nearest known one: what stands in front hides the rest.
    distance = torch.where(depth_m > 0, depth_m, torch.inf)
    return _cross_entropy(logits, depth_bin(_nearest(depth_m, distance, logits.shape[-2])))


def kind_loss(logits: Tensor, kind: Tensor, depth_m: Tensor) -> Tensor:
    """Cross-entropy of kinds, -1 where unknown; logits (B, N, K, h, w), truths (B, N, H, W), H a multiple of h."""
    known = torch.where(depth_m > 0, depth_m, 1e9).clamp(max=1e9)
    return _cross_entropy(logits, _nearest(kind, torch.where(kind >= 0, known, torch.inf), logits.shape[-2]))


def _nearest(values: Tensor, distance: Tensor, height: int) -> Tensor:
    """(B, N, h, w) of (B, N, H, W): of each square of places the value at the least distance, the first of equals."""
    b, n, h, w = values.shape
    side = h // height
    if side == 1:
        return values
    squares = (b, n, h // side, side, w // side, side)
    values, distance = (
        each.reshape(squares).transpose(3, 4).flatten(4)  # B N h w side*side
        for each in (values, distance)
    )
    return values.gather(-1, distance.argmin(-1, keepdim=True))[..., 0]


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """Mean over places whose target is not -1, 0 without any; logits (B, N, C, h, w), target (B, N, h, w)."""
    error = functional.cross_entropy(
        logits.float().flatten(0, 1), target.flatten(0, 1), ignore_index=-1, reduction="sum"
    )
    return error / (target >= 0).sum().clamp(min=1)


def _mean(values: Tensor, weight: Tensor, axes: tuple[int, ...] = ()) -> Tensor:
    """Weighted mean over axes (all where none is named), 0 where all weights are 0."""
    total, weights = (values * weight).sum(axes or None), weight.sum(axes or None)
    return total / torch.where(weights > 0, weights, 1.0)
