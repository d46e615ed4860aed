"""Training of the network of the second stage."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import torch
from safetensors.torch import save
from torch import Tensor, nn
from torch.nn import functional

from appocc.checks import IntArray
from appocc.colours import lab_from_rgb
from appocc.files import write_bytes
from appocc.geometry import wrap_angle
from appocc.inference.second_stage.network import Corrections, CropNetwork
from appocc.training.batches.packed_objects import KIND, RGB, WLH, YAW
from appocc.training.schedule import ema_decay, learning_rate
from benchmarks.second_stage.augment import augmented
from benchmarks.second_stage.examples import Examples

BATCH, RATE, WARMUP, WEIGHT_DECAY, EMA, CLIP = 64, 2e-3, 0.02, 1e-2, 0.998, 5.0
# Fronts of vehicles that stand across their box are not learnt from: radians from a right angle.
_ACROSS_RAD = 0.4
# Weights of the losses: found, near front, kind, paint (per unit of CIELAB), size.
_WEIGHTS = (1.0, 1.0, 0.5, 0.1, 2.0)
_LAB_SLACK, _REAL_SHARE = 1.0, 0.35


N = TypeVar("N", bound=nn.Module)


class Schedule(NamedTuple):
    """Highest learning rate, share of the steps in which it rises, and decay of the average of the weights."""

    rate: float
    warmup: float
    ema: float


class Truth(NamedTuple):
    """Truth of K boxes that face away from the ego; undefined without a vehicle.

    Attributes:
        found: (K,) bool, whether there is a vehicle.
        turn_rad: (K,) angle from the heading of the box to that of the vehicle.
        kind: (K,) its kind.
        lab: (K, 3) CIELAB of its paint, NaN if unknown.
        log_size: (K, 3) logarithm of the factors of width, length and height.
    """

    found: Tensor
    turn_rad: Tensor
    kind: Tensor
    lab: Tensor
    log_size: Tensor


def truth_of(examples: Examples) -> Truth:
    """Return the truth of examples."""
    rows = examples.truth.astype(np.float64)
    found = np.isfinite(rows[:, KIND])
    painted = np.asarray(np.isfinite(rows[:, RGB]).all(axis=1, keepdims=True))
    true = np.where(np.isfinite(rows), rows, 1.0)
    lab = np.where(painted, lab_from_rgb(true[:, RGB]), np.nan)
    turn_rad = wrap_angle(true[:, YAW] - examples.yaw_rad)
    kind = np.where(found, true[:, KIND], 0).astype(np.int64)
    log_size = np.log(true[:, WLH] / examples.size_wlh_m)
    numbers = (turn_rad, lab, log_size)
    turn, paint, size = (torch.from_numpy(array.astype(np.float32)) for array in numbers)
    return Truth(torch.from_numpy(found), turn, torch.from_numpy(kind), paint, size)


def train(
    examples: Examples, epochs: float, seed: int, real: Examples | None = None, start: CropNetwork | None = None
) -> CropNetwork:
    """Return a trained network: the moving average of its weights.

    Args:
        examples: simulated ones, all of which an epoch uses.
        epochs: length of the training.
        seed: of initial weights, order and augmentation.
        real: examples that a third of each batch is drawn from.
        start: trained network to begin with.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = CropNetwork() if start is None else deepcopy(start).train()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    steps = max(1, round(epochs * len(examples.truth) / BATCH))

    def losses() -> Iterator[Tensor]:
        for _, chosen in zip(range(steps), batches(len(examples.truth), BATCH, rng), strict=False):
            batch = examples.select(chosen)
            if real is not None:
                batch = _mixed(batch, real, rng)
            batch = augmented(batch, rng)
            inputs = batch.inputs()
            pixels = inputs.pixels.contiguous(memory_format=torch.channels_last)
            yield loss_of(network(inputs._replace(pixels=pixels)), truth_of(batch))

    return optimised(network, losses(), steps, Schedule(RATE, WARMUP, EMA))


def optimised(network: N, losses: Iterable[Tensor], steps: int, schedule: Schedule) -> N:
    """Train a network and return the moving average of its weights.

    Args:
        network: network to train, in place.
        losses: loss of each step, computed when it is asked for.
        steps: number of losses.
        schedule: learning rate and average.
    """
    averaged = deepcopy(network)
    optimizer = torch.optim.AdamW(network.parameters(), lr=schedule.rate, weight_decay=WEIGHT_DECAY)
    for step, loss in enumerate(losses):
        for group in optimizer.param_groups:
            group["lr"] = learning_rate(step / steps, schedule.rate, schedule.warmup)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(network.parameters(), CLIP)
        optimizer.step()
        _average(averaged, network, ema_decay(step + 1, schedule.ema))
    return averaged.eval()


def _mixed(batch: Examples, real: Examples, rng: np.random.Generator) -> Examples:
    """Return a batch with a share of real examples."""
    count = round(_REAL_SHARE * len(batch.score))
    drawn = real.select(rng.integers(0, len(real.score), count))
    return Examples.concatenated([batch.select(np.arange(count, len(batch.score))), drawn])


@torch.no_grad()
def _average(averaged: nn.Module, network: nn.Module, decay: float) -> None:
    """Update the moving average of weights and batch statistics."""
    for mean, new in zip(averaged.state_dict().values(), network.state_dict().values(), strict=True):
        if mean.is_floating_point():
            mean.lerp_(new, 1 - decay)
        else:
            mean.copy_(new)


def batches(count: int, size: int, rng: np.random.Generator) -> Iterator[IntArray]:
    """Yield the indices of batches: every example once, in random order, again and again."""
    while True:
        order = rng.permutation(count)
        yield from (order[i : i + size] for i in range(0, max(count - size, 0) + 1, size))


def loss_of(outputs: Corrections, truth: Truth) -> Tensor:
    """Return the loss of a batch: what a vehicle is like counts where there is one."""
    found = truth.found
    turn = truth.turn_rad
    fronts = found & ((turn.abs() - np.pi / 2).abs() > _ACROSS_RAD)
    painted = found & torch.isfinite(truth.lab).all(1)
    near = functional.binary_cross_entropy_with_logits(
        outputs.near_front, (turn.abs() > np.pi / 2).float(), reduction="none"
    )
    terms = (
        functional.binary_cross_entropy_with_logits(outputs.found, found.float()),
        _mean(near, fronts),
        _mean(functional.cross_entropy(outputs.kind, truth.kind, reduction="none"), found),
        _mean(_length(outputs.lab - truth.lab.nan_to_num(), _LAB_SLACK), painted),
        _mean((outputs.size - truth.log_size).abs().sum(1), found),
    )
    return torch.stack([weight * term for weight, term in zip(_WEIGHTS, terms, strict=True)]).sum()


def _length(difference: Tensor, slack: float) -> Tensor:
    """Return lengths of differences (K, n), smooth at zero."""
    return (difference.square().sum(1) + slack**2).sqrt()


def _mean(values: Tensor, where: Tensor) -> Tensor:
    """Return the mean of values (K,) where a mask is true; 0 without any."""
    return (values * where).sum() / where.sum().clamp(min=1)


def write_network(network: nn.Module, path: Path) -> None:
    """Write the weights of a network as float16."""
    state = network.state_dict()
    halves = {name: state[name].half() if state[name].is_floating_point() else state[name] for name in sorted(state)}
    write_bytes(path, save({name: tensor.contiguous() for name, tensor in halves.items()}))
