"""Losses of objects: centre heatmaps, boxes, and one paint for each vehicle.

Heatmaps and their focal loss are those of CenterPoint (Yin, Zhou and Krähenbühl, CVPR 2021) and CornerNet (Law and
Deng, ECCV 2018, equation 1).
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from appocc.grid import BEVGrid
from appocc.models.base import VELOCITY_UNIT_MPS, ObjectOutput
from appocc.objects import KINDS
from appocc.training.batches.batch import Truth
from appocc.training.batches.packed_objects import KIND, RGB, VELOCITY, WLH, XY, YAW, Z

# Standard deviation of the Gaussian around a centre, in cells of twice the size, and the reach of its box.
_DEVIATION, _REACH = 0.8, 1.6
# Weight of the centres of each kind: cars are two thirds of all objects and the easiest to see.
_KIND_WEIGHTS = [1.0 if kind == "car" else 2.0 for kind in KINDS]


class ObjectTargets(NamedTuple):
    """Targets at cells of twice the size.

    Attributes:
        heat: (B, len(KINDS), X', Y') 1 at centres, falling as Gaussians.
        weight: (B, X', Y') weight of the box of a cell; 0 far from every centre.
        box: (B, 12, X', Y') offset, height, size, heading, velocity and axis of the nearest object, as in
            `ObjectOutput`; NaN where unknown.
        number: () number of objects, at least 1.
    """

    heat: Tensor
    weight: Tensor
    box: Tensor
    number: Tensor


def object_targets(objects: Tensor, grid: BEVGrid) -> ObjectTargets:
    """Return the targets of objects (B, K, 13) on a grid of cells of twice the size."""
    x, y = grid.shape
    place = (objects[..., XY] - objects.new_tensor([grid.x_min_m, grid.y_min_m])) / grid.cell_m - 0.5  # B K 2
    place = place.nan_to_num(nan=-1e3)
    along = (torch.arange(x, device=objects.device) - place[..., :1]) ** 2  # B K X'
    across = (torch.arange(y, device=objects.device) - place[..., 1:]) ** 2  # B K Y'
    squared = along[..., None] + across[:, :, None]  # B K X' Y'
    gauss = torch.exp(-squared / (2 * _DEVIATION**2))
    # The cell of a centre is a positive, wherever in the cell the centre is.
    cell = place.round()
    at_row = torch.arange(x, device=objects.device) == cell[..., :1]  # B K X'
    at_column = torch.arange(y, device=objects.device) == cell[..., 1:]  # B K Y'
    gauss = torch.where(at_row[..., None] & at_column[:, :, None], 1.0, gauss)
    kind = objects[..., KIND]
    heat = torch.stack(
        [(gauss * (kind == number)[..., None, None]).amax(dim=1) for number in range(len(KINDS))], dim=1
    )
    nearest = squared.argmin(dim=1)  # B X' Y'
    least = squared.gather(1, nearest[:, None])[:, 0]
    sample_of_cell = torch.arange(len(objects), device=objects.device)[:, None, None]
    own = objects[sample_of_cell, nearest].permute(0, 3, 1, 2)  # B 13 X' Y'
    at = place[sample_of_cell, nearest].permute(0, 3, 1, 2)
    cells = torch.stack(
        torch.meshgrid(torch.arange(x, device=objects.device), torch.arange(y, device=objects.device), indexing="ij")
    )
    box = torch.cat(
        [
            at - cells,
            own[:, Z : Z + 1],
            own[:, WLH].log(),
            own[:, YAW : YAW + 1].sin(),
            own[:, YAW : YAW + 1].cos(),
            own[:, VELOCITY] / VELOCITY_UNIT_MPS,
            (2 * own[:, YAW : YAW + 1]).sin(),
            (2 * own[:, YAW : YAW + 1]).cos(),
        ],
        dim=1,
    )
    weight = torch.exp(-least / (2 * _DEVIATION**2)) * (least < _REACH**2)
    inside = at_row.any(-1) & at_column.any(-1)
    return ObjectTargets(heat, weight, box, inside.sum().clamp(min=1))


def centre_loss(logits: Tensor, targets: ObjectTargets) -> Tensor:
    """Return the focal loss of centre logits (B, len(KINDS), X', Y'), per object; cars weigh less than others."""
    on = targets.heat >= 1
    probability = torch.sigmoid(logits)
    positive = (1 - probability) ** 2 * functional.logsigmoid(logits) * on
    negative = probability**2 * functional.logsigmoid(-logits) * (1 - targets.heat) ** 4 * ~on
    return -((positive + negative).sum((0, 2, 3)) * logits.new_tensor(_KIND_WEIGHTS)).sum() / targets.number


def box_loss(output: ObjectOutput, targets: ObjectTargets) -> Tensor:
    """Return the L1 of the known box values, summed over them in their own units, weighted mean over cells."""
    predicted = torch.cat(output[1:], dim=1)
    known = torch.isfinite(targets.box)
    error = (predicted - torch.where(known, targets.box, 0.0)).abs() * known
    return (error * targets.weight[:, None]).sum() / targets.weight.sum().clamp(min=1e-6)


def paint_loss(appearance: Tensor, truth: Truth) -> Tensor:
    """Return the L1 of mean colours (B, 3, X, Y) over the cells of each vehicle, mean over known paints."""
    batch, most = truth.objects.shape[:2]
    first = torch.arange(batch, device=truth.owner.device)[:, None, None] * (most + 1)
    place = (torch.where(truth.owner <= most, truth.owner, 0) + first).flatten()
    size = batch * (most + 1)
    values = appearance.float().permute(0, 2, 3, 1).reshape(-1, 3)
    sums = values.new_zeros(size, 3).index_add(0, place, values)
    count = values.new_zeros(size).index_add(0, place, torch.ones_like(values[:, 0]))
    mean = (sums / count.clamp(min=1)[:, None]).reshape(batch, most + 1, 3)[:, 1:]
    paint = truth.objects[..., RGB] / 255
    known = torch.isfinite(paint).all(-1) & (count.reshape(batch, most + 1)[:, 1:] > 0)
    error: Tensor = (mean - paint.nan_to_num()).abs().mean(-1) * known
    return error.sum() / known.sum().clamp(min=1)
