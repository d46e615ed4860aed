"""Training losses: occupancy, colour, and the auxiliary depth and pixel-class losses of the images."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor
from torch.nn import functional

from appocc.bevmap import CLASSES, VEHICLE
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, DEPTH_STEP_M, FIRST_DEPTH_M, ModelOutput
from appocc.training.batches.batch import Truth
from appocc.training.config import LossConfig
from appocc.training.object_losses import box_loss, centre_loss, object_targets, paint_loss


@dataclass(frozen=True, eq=False)
class LossTerms:
    """Unweighted loss terms, scalars; None where the network has no such output.

    Attributes:
        road: occupancy loss of the road, mean over its known cells.
        vehicle: occupancy loss of vehicles.
        lane: occupancy loss of lane markings.
        colour: L1 of sRGB 0..1 on cells of road, vehicle and lane, mean over channels and (weighted) cells.
        depth: cross-entropy of the depth bins, mean over feature pixels of known depth.
        kind: cross-entropy of the pixel classes.
        centre: focal loss of object centres.
        box: L1 of offset, height, size, heading and velocity of objects.
        paint: L1 of the mean colour of each vehicle, sRGB 0..1.
    """

    road: Tensor
    vehicle: Tensor
    lane: Tensor
    colour: Tensor | None = None
    depth: Tensor | None = None
    kind: Tensor | None = None
    centre: Tensor | None = None
    box: Tensor | None = None
    paint: Tensor | None = None

    def total(self, config: LossConfig) -> Tensor:
        """Return the weighted sum; terms of weight 0 are included, so that every parameter has a gradient."""
        weights = {**dict(zip(CLASSES, config.classes, strict=True)), **config.model_dump()}
        terms = ((name, getattr(self, name)) for name in self.names())
        return torch.stack([weights[name] * term for name, term in terms]).sum()

    def names(self) -> tuple[str, ...]:
        """Return the names of the present terms."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name) is not None)


def compute_losses(output: ModelOutput, truth: Truth, config: LossConfig, grid: BEVGrid) -> LossTerms:
    """Return all loss terms of a batch on a grid, in float32 for any precision of the network."""
    road, vehicle, lane = occupancy_loss(output.occupancy, truth, config)
    colour = colour_loss(output.appearance, truth, config.vehicles) if output.appearance is not None else None
    depth = kind = None
    if output.views is not None and output.views.depth is not None:
        depth = depth_loss(output.views.depth, truth.depth_m)
    if output.views is not None and output.views.kind is not None:
        kind = kind_loss(output.views.kind, truth.kind, truth.depth_m)
    terms = LossTerms(road, vehicle, lane, colour, depth, kind)
    if output.objects is None:
        return terms
    targets = object_targets(truth.objects, grid.halved())
    paint = None if output.appearance is None else paint_loss(output.appearance, truth)
    centre, box = centre_loss(output.objects.centre, targets), box_loss(output.objects, targets)
    return replace(terms, centre=centre, box=box, paint=paint)


def occupancy_loss(logits: Tensor, truth: Truth, config: LossConfig) -> Tensor:
    """Return the (3,) occupancy loss, mean over the known cells: cross-entropy with `pos_weight`, or focal loss.

    The focal loss (Lin et al. 2017, equation 4) is the cross-entropy times (1 - p)^gamma, where p is the predicted
    probability of the true state.
    """
    logits, on = logits.float(), truth.occupancy
    weight = torch.tensor(config.pos_weight, device=logits.device)[:, None, None]  # 3 1 1
    error = functional.binary_cross_entropy_with_logits(logits, on, pos_weight=weight, reduction="none")  # B 3 X Y
    if config.occupancy == "focal":
        wrong = torch.sigmoid(logits * (1 - 2 * on))  # probability of the wrong state
        error = error * wrong**config.focal_gamma
    return _mean(error, truth.occupancy_valid.float(), (0, 2, 3))


def colour_weight(truth: Truth, vehicles: float) -> Tensor:
    """Return the (B, X, Y) weight of each cell in the colour loss: vehicles more, 0 if class or colour is unknown.

    Cells of no class, such as roofs and treetops, are invisible from the ego vehicle.
    """
    on = (truth.occupancy > 0.5) & truth.occupancy_valid  # B 3 X Y
    weight = torch.where(on[:, VEHICLE], vehicles, on.any(1).float())
    return weight * truth.appearance_valid


def colour_loss(appearance: Tensor, truth: Truth, vehicles: float) -> Tensor:
    """Return the L1 loss of colours 0..1, mean over channels and over cells weighted by `colour_weight`."""
    error = (appearance.float() - truth.appearance).abs().mean(1)  # B X Y
    return _mean(error, colour_weight(truth, vehicles))


def depth_bin(depth_m: Tensor) -> Tensor:
    """Return the int64 bin of each depth, by nearest centre; -1 outside the bins, in the sky and where unknown."""
    place = (depth_m - (FIRST_DEPTH_M - DEPTH_STEP_M / 2)) / DEPTH_STEP_M
    inside = (depth_m > 0) & (place >= 0) & (place < DEPTH_BINS)
    return torch.where(inside, place.nan_to_num(posinf=0.0), -1.0).floor().long()


def depth_loss(logits: Tensor, depth_m: Tensor) -> Tensor:
    """Return the cross-entropy of depth bins: logits (B, N, DEPTH_BINS, h, w), truth (B, N, k h, k w)."""
    # The nearest known depth of a block is the target: it occludes the rest.
    distance = torch.where(depth_m > 0, depth_m, torch.inf)
    return _cross_entropy(logits, depth_bin(_nearest(depth_m, distance, logits.shape[-2])))


def kind_loss(logits: Tensor, kind: Tensor, depth_m: Tensor) -> Tensor:
    """Return the cross-entropy of pixel classes: logits (B, N, K, h, w), truth (B, N, k h, k w), -1 where unknown."""
    known = torch.where(depth_m > 0, depth_m, 1e9).clamp(max=1e9)
    return _cross_entropy(logits, _nearest(kind, torch.where(kind >= 0, known, torch.inf), logits.shape[-2]))


def _nearest(values: Tensor, distance: Tensor, height: int) -> Tensor:
    """Reduce (B, N, H, W) to (B, N, h, w): the value at the smallest distance in each block; ties take the first."""
    b, n, h, w = values.shape
    side = h // height
    if side == 1:
        return values
    blocks = (b, n, h // side, side, w // side, side)
    values, distance = (
        each.reshape(blocks).transpose(3, 4).flatten(4)  # B N h w side*side
        for each in (values, distance)
    )
    return values.gather(-1, distance.argmin(-1, keepdim=True))[..., 0]


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """Return the mean over targets other than -1, or 0; logits (B, N, C, h, w), target (B, N, h, w)."""
    error = functional.cross_entropy(
        logits.float().flatten(0, 1), target.flatten(0, 1), ignore_index=-1, reduction="sum"
    )
    return error / (target >= 0).sum().clamp(min=1)


def _mean(values: Tensor, weight: Tensor, axes: tuple[int, ...] = ()) -> Tensor:
    """Return the weighted mean over axes (default: all), 0 where all weights are 0."""
    total, weights = (values * weight).sum(axes or None), weight.sum(axes or None)
    return total / torch.where(weights > 0, weights, 1.0)
