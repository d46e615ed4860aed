"""Losses of objects: targets say where each object is, and the losses are lowest for what is true."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from made_rows import SIZE_WLH_M, batch_of, row
from tolerances import assert_rounded
from torch import Tensor

from appocc.grid import BEVGrid
from appocc.models.base import VELOCITY_UNIT_MPS, ModelOutput, ObjectOutput
from appocc.objects import KINDS
from appocc.training.batches.batch import Truth
from appocc.training.config import LossConfig
from appocc.training.losses import compute_losses
from appocc.training.object_losses import ObjectTargets, box_loss, centre_loss, object_targets, paint_loss

GRID = BEVGrid(-8, 8, -4.8, 4.8, 0.4)
HALF = GRID.halved()
CAR, PEDESTRIAN = KINDS.index("car"), KINDS.index("pedestrian")
PARTS = [2, 1, 3, 2, 2, 2]


def output_of(box: Tensor, centre: Tensor | None = None) -> ObjectOutput:
    """Head outputs with these box values (B, 12, X', Y')."""
    centre = torch.zeros(len(box), len(KINDS), *box.shape[2:]) if centre is None else centre
    return ObjectOutput(centre, *torch.split(box, PARTS, dim=1))


def true_boxes(targets: ObjectTargets) -> Tensor:
    return targets.box.nan_to_num(nan=0.0)


def decoded(targets: ObjectTargets, i: int, j: int) -> dict[str, Any]:
    """The box that the targets of a cell say."""
    values = targets.box[0, :, i, j].double().numpy()
    return {
        "xy": HALF.centre_of(np.array([i, j])) + values[:2] * HALF.cell_m,
        "z": values[2],
        "wlh": np.exp(values[3:6]),
        "yaw": math.atan2(values[6], values[7]),
        "velocity": values[8:10] * VELOCITY_UNIT_MPS,
        "axis": math.atan2(values[10], values[11]),
    }


# Targets ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("x_m", "y_m"), [(0.4, 0.4), (3.1, -2.0), (-7.99, 4.79), (0.79, 0.01)])
def test_the_heat_of_an_object_is_1_in_the_cell_of_its_centre_alone(x_m: float, y_m: float) -> None:
    targets = object_targets(batch_of([row("car", x_m, y_m)]), HALF)
    assert targets.heat.shape == (1, len(KINDS), *HALF.shape)
    i, j = HALF.cell_of(np.array([x_m, y_m]))
    assert torch.nonzero(targets.heat[0, CAR] == 1).tolist() == [[i, j]]
    near = targets.heat[0, CAR, max(0, i - 1) : i + 2, max(0, j - 1) : j + 2]
    assert (near > 0.03).all()
    assert targets.heat[0, CAR, (i + 8) % HALF.shape[0], j] < 1e-6
    assert not targets.heat[0, :CAR].any()
    assert not targets.heat[0, CAR + 1 :].any()


def test_kinds_have_their_own_heat() -> None:
    targets = object_targets(batch_of([row("car", 2, 1), row("pedestrian", 2, 1.1), row("car", -3, 1)]), HALF)
    peaks = [(int(k), int(i), int(j)) for k, i, j in torch.nonzero(targets.heat[0] == 1)]
    first, other = HALF.cell_of(np.array([2, 1])), HALF.cell_of(np.array([-3, 1]))
    assert peaks == [(CAR, *other), (CAR, *first), (PEDESTRIAN, *first)]
    assert float(targets.number) == 3


def test_box_targets_decode_to_the_object_from_every_cell_near_it() -> None:
    car = row("car", 2.3, -1.4, z=1.1, wlh=(1.9, 4.7, 1.5), yaw=2.5, velocity=(-7.0, 3.0))
    targets = object_targets(batch_of([car]), HALF)
    i, j = HALF.cell_of(np.array([2.3, -1.4]))
    assert targets.weight[0, i, j] > 0.6
    for cell in ((i, j), (i + 1, j), (i, j - 1)):
        found = decoded(targets, *cell)
        np.testing.assert_allclose(found["xy"], [2.3, -1.4], atol=1e-5)
        assert found["z"] == pytest.approx(1.1)
        np.testing.assert_allclose(found["wlh"], [1.9, 4.7, 1.5], rtol=1e-5)
        assert found["yaw"] == pytest.approx(2.5, abs=1e-5)
        assert found["axis"] == pytest.approx(5.0 - 2 * math.pi, abs=1e-5)
        np.testing.assert_allclose(found["velocity"], [-7.0, 3.0], rtol=1e-5)


def test_cells_learn_the_box_of_the_nearest_object() -> None:
    targets = object_targets(batch_of([row("car", -2, 0), row("truck", 2, 0, z=1.7)]), HALF)
    heights = [float(targets.box[0, 2, *HALF.cell_of(np.array([x, 0.0]))]) for x in (-2.5, -1, 1, 2.5)]
    assert heights == pytest.approx([0.8, 0.8, 1.7, 1.7])
    assert not targets.weight[0, 0].any()  # far from both


def test_objects_outside_have_no_peak_and_do_not_count() -> None:
    outside = [row("car", 9, 0), row("car", 0, -5.3), row("car", -50, 0)]
    targets = object_targets(batch_of([*outside, row("car", 0, 0)]), HALF)
    assert int((targets.heat == 1).sum()) == 1
    assert float(targets.number) == 1


def test_samples_of_a_batch_do_not_mix() -> None:
    samples = [[row("car", 2, 1), row("bus", -4, 0)], [], [row("bicycle", 1, 1)]]
    together = object_targets(batch_of(*samples), HALF)
    for number, rows in enumerate(samples):
        alone = object_targets(batch_of(rows), HALF)
        assert torch.equal(together.heat[number], alone.heat[0])
        assert torch.equal(together.weight[number], alone.weight[0])
        near = alone.weight[0] > 0
        assert torch.equal(together.box[number][:, near], alone.box[0][:, near])


# Losses -----------------------------------------------------------------------------------------------------------


def test_centres_are_lowest_at_the_truth_and_their_gradient_leads_there() -> None:
    targets = object_targets(batch_of([row("car", 2, 1), row("pedestrian", -3, 2)]), HALF)
    logits = torch.zeros_like(targets.heat, requires_grad=True)
    torch.autograd.backward(centre_loss(logits, targets))
    assert logits.grad is not None
    peak = targets.heat == 1
    assert (logits.grad[peak] < 0).all()
    assert (logits.grad[~peak] > 0).all()
    true = torch.where(peak, 9.0, -9.0)
    shifted, swapped = true.roll(1, dims=2), true.flip(1)
    low, *high = (float(centre_loss(each, targets)) for each in (true, shifted, swapped, -true))
    assert low < 1e-3 < 1 < min(high)


def test_guesses_beside_a_centre_cost_less_than_far_away() -> None:
    targets = object_targets(batch_of([row("car", 0.4, 0.4)]), HALF)
    i, j = HALF.cell_of(np.array([0.4, 0.4]))
    base = torch.where(targets.heat == 1, 9.0, -9.0)
    near, far = base.clone(), base.clone()
    near[0, CAR, i + 1, j] = far[0, CAR, i + 5, j] = 2.0
    assert centre_loss(base, targets) < centre_loss(near, targets) < centre_loss(far, targets)


def test_kinds_other_than_cars_weigh_twice() -> None:
    car, pedestrian = (object_targets(batch_of([row(kind, 0.4, 0.4)]), HALF) for kind in ("car", "pedestrian"))
    missed = [-9.0 * targets.heat + 9.0 * (targets.heat - 1) for targets in (car, pedestrian)]
    losses = [centre_loss(logits, targets) for logits, targets in zip(missed, (car, pedestrian), strict=True)]
    assert_rounded(losses[1], 2 * losses[0], car.heat.numel(), 40.0)


def test_boxes_are_lowest_at_the_truth() -> None:
    targets = object_targets(batch_of([row("car", 2, 1, yaw=1.0, velocity=(5, 0))], [row("bus", 0, 0)]), HALF)
    true = true_boxes(targets)
    assert float(box_loss(output_of(true), targets)) == 0
    for channel in range(12):
        wrong = true.clone()
        wrong[:, channel] += 0.5
        assert_rounded(box_loss(output_of(wrong), targets), 0.5, 64, 16.0)
    nowhere = true.clone()
    nowhere[:, :, targets.weight[0] == 0] += 100.0
    only_first = nowhere[:1]
    alone = ObjectTargets(targets.heat[:1], targets.weight[:1], targets.box[:1], targets.number)
    assert float(box_loss(output_of(only_first), alone)) == 0


def test_unknown_velocities_are_ignored() -> None:
    targets = object_targets(batch_of([row("car", 2, 1, velocity=(math.nan, math.nan))]), HALF)
    box = true_boxes(targets)
    box[:, 8:10] = 3.0
    box.requires_grad_()
    loss = box_loss(output_of(box), targets)
    torch.autograd.backward(loss)
    assert float(loss.detach()) == 0
    assert box.grad is not None
    assert not box.grad[:, 8:].any()


def truth(objects: Tensor, owner: Tensor | None = None) -> Truth:
    b, (x, y) = len(objects), GRID.shape
    return Truth(
        torch.zeros(b, 3, x, y),
        torch.ones(b, 3, x, y, dtype=torch.bool),
        torch.zeros(b, 3, x, y),
        torch.ones(b, x, y, dtype=torch.bool),
        torch.zeros(b, 1, 2, 2),
        torch.full((b, 1, 2, 2), -1),
        objects,
        torch.zeros(b, x, y, dtype=torch.int64) if owner is None else owner,
    )


def test_paint_counts_alike_for_small_and_large_vehicles() -> None:
    objects = batch_of([row("car", 0, 0, rgb=(255, 0, 51)), row("bus", 4, 0, rgb=(0, 0, 0))])
    owner = torch.zeros(1, *GRID.shape, dtype=torch.int64)
    owner[0, 0, :2], owner[0, 10:20] = 1, 2
    appearance = torch.full((1, 3, *GRID.shape), 0.7)  # elsewhere: does not matter
    appearance[0, :, 10:20] = 0.0
    # On average right: half of the cells too bright, the others too dark.
    appearance[0, :, 0, 0], appearance[0, :, 0, 1] = torch.tensor([1.0, 0.2, 0.1]), torch.tensor([1.0, 0.4, 0.3])
    found = paint_loss(appearance, truth(objects, owner))
    assert_rounded(found, (0.3 / 3 + 0) / 2, 256)


def test_paint_of_unknown_colour_or_without_cells_does_not_count() -> None:
    objects = batch_of(
        [row("car", 0, 0, rgb=(255, 255, 255)), row("car", 4, 0), row("bus", 2, 0, rgb=(9, 9, 9))],
        [row("car", 0, 0, rgb=(0, 0, 0))],
    )
    owner = torch.zeros(2, *GRID.shape, dtype=torch.int64)
    owner[0, :2], owner[0, 4:6], owner[1, 7] = 1, 2, 1
    appearance = torch.full((2, 3, *GRID.shape), 0.5, requires_grad=True)
    loss = paint_loss(appearance, truth(objects, owner))
    assert_rounded(loss, 0.5, 256)
    torch.autograd.backward(loss)
    assert appearance.grad is not None
    assert (appearance.grad[0, :, :2] < 0).all()  # brighter
    assert (appearance.grad[1, :, 7] > 0).all()  # darker
    assert not appearance.grad[0, :, 2:].any()


def test_no_objects_at_all_are_finite_and_cost_almost_nothing() -> None:
    objects = batch_of([], [])
    centre = torch.full((2, len(KINDS), *HALF.shape), -9.0, requires_grad=True)
    box, colour = torch.zeros(2, 12, *HALF.shape, requires_grad=True), torch.zeros(2, 3, *GRID.shape)
    logits = torch.zeros(2, 3, *GRID.shape)
    terms = compute_losses(
        ModelOutput(logits, colour, None, output_of(box, centre)), truth(objects), LossConfig(), GRID
    )
    assert terms.names() == ("road", "vehicle", "lane", "colour", "centre", "box", "paint")
    assert terms.centre is not None
    assert 0 < float(terms.centre.detach()) < 1e-3
    assert terms.box is not None
    assert float(terms.box.detach()) == 0
    assert terms.paint is not None
    assert float(terms.paint) == 0
    torch.autograd.backward(terms.total(LossConfig()))
    for each in (centre, box):
        assert each.grad is not None
        assert torch.isfinite(each.grad).all()


def test_losses_and_gradients_of_samples_with_fewer_objects_are_finite() -> None:
    few = [row("car", 2, 1, rgb=(10, 20, 30), velocity=(math.nan, math.nan), wlh=SIZE_WLH_M)]
    objects = batch_of([row("car", -2, 1), *few, row("bicycle", 7.9, 4.7)], few, [])
    owner = torch.zeros(3, *GRID.shape, dtype=torch.int64)
    owner[1, 5:8] = 1
    parts = [torch.zeros(3, n, *shape) for n, shape in ((3, GRID.shape), (6, HALF.shape), (12, HALF.shape))]
    colour, centre, box = (part.requires_grad_() for part in parts)
    output = ModelOutput(torch.zeros(3, 3, *GRID.shape), colour, None, output_of(box, centre))
    total = compute_losses(output, truth(objects, owner), LossConfig(), GRID).total(LossConfig())
    torch.autograd.backward(total)
    assert torch.isfinite(total)
    for each in (colour, centre, box):
        assert each.grad is not None
        assert torch.isfinite(each.grad).all()
        assert each.grad.any()


def test_weights_of_the_object_losses_count() -> None:
    objects = batch_of([row("car", 2, 1, rgb=(200, 0, 0))])
    owner = torch.zeros(1, *GRID.shape, dtype=torch.int64)
    owner[0, 3] = 1
    output = ModelOutput(
        torch.zeros(1, 3, *GRID.shape),
        torch.zeros(1, 3, *GRID.shape),
        None,
        output_of(torch.zeros(1, 12, *HALF.shape)),
    )
    terms = compute_losses(output, truth(objects, owner), LossConfig(), GRID)
    nothing = LossConfig(centre=0, box=0, paint=0)
    for name in ("centre", "box", "paint"):
        own = getattr(terms, name)
        assert own > 0
        more = terms.total(nothing.model_copy(update={name: 2.0})) - terms.total(nothing)
        assert_rounded(more, 2 * own, 16, float(terms.total(LossConfig(centre=2, box=2, paint=2))))
