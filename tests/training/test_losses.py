from __future__ import annotations

import math

import torch
from tolerances import assert_rounded
from torch import Tensor

from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, ImageOutput, ModelOutput
from appocc.training.batches.batch import Truth
from appocc.training.batches.packed_objects import COLUMNS
from appocc.training.config import LossConfig
from appocc.training.losses import colour_loss, compute_losses, depth_bin, depth_loss, kind_loss, occupancy_loss

GRID = BEVGrid(-0.4, 0.4, -0.4, 0.4, 0.4)
TERMS = 2 * DEPTH_BINS  # of a softmax, the longest sum in the losses of so few cells


def truth(**parts: Tensor) -> Truth:
    """One sample of 2x2 cells and one camera of 2x2 places, nothing on, everything known."""
    values = {
        "occupancy": torch.zeros(1, 3, 2, 2),
        "occupancy_valid": torch.ones(1, 3, 2, 2, dtype=torch.bool),
        "appearance": torch.zeros(1, 3, 2, 2),
        "appearance_valid": torch.ones(1, 2, 2, dtype=torch.bool),
        "depth_m": torch.zeros(1, 1, 2, 2),
        "kind": torch.full((1, 1, 2, 2), -1),
        "objects": torch.full((1, 1, COLUMNS), torch.nan),
        "owner": torch.zeros(1, 2, 2, dtype=torch.int64),
    }
    return Truth(**(values | parts))


def test_cross_entropy_weights_occupied_cells_and_ignores_unknown_cells() -> None:
    occupancy = torch.zeros(1, 3, 2, 2)
    occupancy[0, 1, 0, 0] = 1
    known = torch.ones(1, 3, 2, 2, dtype=torch.bool)
    known[0, 1, 1] = False
    logits = torch.zeros(1, 3, 2, 2)
    logits[0, 1, 0, 0] = math.log(3)  # probability 3/4
    logits[0, 1, 1] = 100.0  # wrong, but nothing is known there
    config = LossConfig(pos_weight=(1, 4, 1))
    found = occupancy_loss(logits, truth(occupancy=occupancy, occupancy_valid=known), config)
    vehicle = (4 * -math.log(3 / 4) + math.log(2)) / 2
    assert_rounded(found, [math.log(2), vehicle, math.log(2)], TERMS)


def test_focal_loss_down_weights_easy_cells() -> None:
    occupancy = torch.zeros(1, 3, 2, 2)
    occupancy[0, 0] = 1
    logits = torch.full((1, 3, 2, 2), math.log(3))
    config = LossConfig(occupancy="focal", focal_gamma=2, pos_weight=(2, 1, 1))
    road, vehicle, _ = occupancy_loss(logits, truth(occupancy=occupancy), config).tolist()
    assert_rounded(road, 2 * (1 / 4) ** 2 * -math.log(3 / 4), TERMS, dtype=torch.float32)
    assert_rounded(vehicle, (3 / 4) ** 2 * -math.log(1 / 4), TERMS, dtype=torch.float32)


def test_colour_counts_on_known_cells_of_the_classes_and_more_on_vehicles() -> None:
    occupancy = torch.zeros(1, 3, 2, 2)
    occupancy[0, 0, 0, 0] = 1  # road
    occupancy[0, 0:2, 0, 1] = 1  # a vehicle on the road
    occupancy[0, 2, 1, 0] = 1  # a lane whose colour nobody knows; (1, 1) is nothing
    known = torch.tensor([[[True, True], [False, True]]])
    appearance = torch.zeros(1, 3, 2, 2)
    appearance[0, :, 0, 0] = torch.tensor([0.3, 0.0, 0.0])  # L1 0.1
    appearance[0, :, 0, 1] = 0.5
    appearance[0, :, 1] = 1.0
    found = colour_loss(appearance, truth(occupancy=occupancy, appearance_valid=known), vehicles=3)
    assert_rounded(found, (1 * 0.1 + 3 * 0.5) / 4, TERMS)


def test_cells_of_unknown_class_have_no_colour_loss() -> None:
    none_known = torch.zeros(1, 3, 2, 2, dtype=torch.bool)
    found = colour_loss(
        torch.ones(1, 3, 2, 2), truth(occupancy=torch.ones(1, 3, 2, 2), occupancy_valid=none_known), 4
    )
    assert float(found) == 0


def test_depth_bins() -> None:
    depths = torch.tensor([0.0, 3.99, 4.0, 4.5, 4.99, 5.0, 44.99, 45.0, math.inf])
    assert depth_bin(depths).tolist() == [-1, -1, 0, 0, 0, 1, 40, -1, -1]


def test_depth_loss_uses_known_depths_only() -> None:
    logits = torch.zeros(1, 1, DEPTH_BINS, 2, 2)
    logits[0, 0, 6, 0, 0] = math.log(60)  # 10.5 m: 60 of 100
    logits[0, 0, 0, 1, 1] = 50.0  # unknown there
    depth = torch.tensor([[[[10.4, math.inf], [0.0, 0.0]]]])
    assert_rounded(depth_loss(logits, depth), -math.log(0.6), TERMS)


def test_coarser_outputs_are_compared_with_the_nearest_depth() -> None:
    depth = torch.tensor([[[[0.0, 20.2, 3.0, 0.0], [10.4, math.inf, 0.0, math.inf]]]])  # 2 squares of 2x2
    kind = torch.tensor([[[[7, 1, 2, -1], [5, 0, 0, 0]]]])
    logits = torch.zeros(1, 1, DEPTH_BINS, 1, 2)
    logits[0, 0, 6, 0, 0] = math.log(60)
    # The second square's nearest is before the first bin: what is behind it must not be told to be in front.
    assert_rounded(depth_loss(logits, depth), -math.log(0.6), TERMS)
    kinds = torch.zeros(1, 1, 8, 1, 2)
    kinds[0, 0, 5, 0, 0] = kinds[0, 0, 2, 0, 1] = math.log(7)
    assert_rounded(kind_loss(kinds, kind, depth), math.log(2), TERMS)


def test_a_kind_is_known_where_no_depth_is() -> None:
    kind = torch.tensor([[[[-1, 3], [-1, -1]]]])
    kinds = torch.zeros(1, 1, 4, 1, 1)
    assert_rounded(kind_loss(kinds, kind, torch.zeros(1, 1, 2, 2)), math.log(4), TERMS)


def test_nothing_known_is_no_loss_and_has_a_gradient() -> None:
    logits = torch.zeros(1, 3, 2, 2, requires_grad=True)
    colour = torch.zeros(1, 3, 2, 2, requires_grad=True)
    views = ImageOutput(
        torch.zeros(1, 1, DEPTH_BINS, 2, 2, requires_grad=True), torch.zeros(1, 1, 5, 2, 2, requires_grad=True)
    )
    nothing = truth(
        occupancy_valid=torch.zeros(1, 3, 2, 2, dtype=torch.bool),
        appearance_valid=torch.zeros(1, 2, 2, dtype=torch.bool),
    )
    terms = compute_losses(ModelOutput(logits, colour, views), nothing, LossConfig(), GRID)
    assert terms.names() == ("road", "vehicle", "lane", "colour", "depth", "kind")
    total = terms.total(LossConfig())
    assert float(total.detach()) == 0
    torch.autograd.backward(total)
    assert all(part.grad is not None and not part.grad.any() for part in (logits, colour, *views) if part is not None)


def test_the_total_is_weighted_and_skips_missing_outputs() -> None:
    terms = compute_losses(
        ModelOutput(torch.zeros(1, 3, 2, 2), None, None), truth(), LossConfig(classes=(1, 2, 0)), GRID
    )
    assert terms.names() == ("road", "vehicle", "lane")
    assert_rounded(terms.total(LossConfig(classes=(1, 2, 0))), 3 * math.log(2), TERMS)


def test_losses_of_half_precision_outputs_are_float32() -> None:
    logits = torch.full((1, 3, 2, 2), 0.25, dtype=torch.bfloat16)
    found = occupancy_loss(logits, truth(), LossConfig())
    assert found.dtype == torch.float32
    assert_rounded(found, [math.log1p(math.exp(0.25))] * 3, TERMS)
