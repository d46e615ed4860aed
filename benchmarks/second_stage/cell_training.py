"""Training of the network of the second stage of cells."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from appocc.bevmap import LANE, ROAD
from appocc.geometry import wrap_angle
from appocc.inference.second_stage.cell_network import CORRECTED, PARTS, CellInputs, CellNetwork
from benchmarks.second_stage.cell_examples import CellExamples
from benchmarks.second_stage.training import Schedule, batches, optimised

BATCH, RATE, WARMUP, EMA = 4, 4e-3, 0.05, 0.995
# Weights of the losses of road and lane.
_WEIGHTS = (1.0, 2.0)
# Share of the training without doubtful logits and worn lines: the network first learns what a line is.
_EASY = 0.6
# Share of the examples in other colours, and of those with mixed channels, with all channels alike and with noise.
_TONED, _MIXED, _GREY, _NOISY = 0.6, 0.3, 0.1, 0.2
# Share of the examples with a sector that no camera sees, and its width.
_HIDDEN, _SECTOR_RAD = 0.25, (0.5, 5.5)
# Share of the examples whose logits are doubtful, as those of images unlike the training's: logit that those of lane
# fall back to, standard deviation of what is added to those of road, and cells between the nodes of these errors.
_DOUBTFUL, _NO_LANE, _ROAD_ERROR, _ERROR_CELLS = 0.6, -5.0, 2.0, (8, 50)
# Share of the examples with worn lines, the contrast that they keep (mean of an example, deviation in it), the
# least that can be seen, and the distance of the ground that shows where they are worn.
_WORN, _KEPT, _UNEVEN, _INVISIBLE, _BESIDE_CELLS = 0.5, (-0.2, 1.0), 0.4, 0.08, 4
# Tone: logarithms of gamma, of the gain of all channels, and of each (standard deviation); mixture and noise.
_GAMMA, _GAIN, _CHANNEL, _MIXTURE, _NOISE = 0.4, (-0.9, 0.4), 0.12, 0.4, 0.03
# Place of lane among the corrected classes.
_LINES = CORRECTED.index(LANE)


class CellBatch(NamedTuple):
    """Network inputs of B examples with their truth (B, 2, X, Y), and whether it is known, as numbers."""

    inputs: CellInputs
    truth: Tensor
    known: Tensor


def make_batch(
    examples: CellExamples, chosen: NDArray[np.int64], distance: Tensor, rng: Generator, easy: bool = False
) -> CellBatch:
    """Return a batch of some examples, augmented.

    Args:
        examples: examples of a square grid around the ego.
        chosen: (B,) indices.
        distance: distances of `cell_distances`.
        rng: of the augmentation.
        easy: whether no logits are doubtful and no lines worn.
    """
    turned = [_turned(examples, one, rng) for one in chosen.tolist()]
    for each in turned:
        if not easy:
            _wear(each, rng)
            _doubt(each, rng)
        _hide(each, rng)
    logits, rgb, seen, truth, known = (torch.from_numpy(np.stack(arrays)) for arrays in zip(*turned, strict=True))
    colours = torch.stack([_toned(each, rng) for each in rgb.float() / 255])
    inputs = CellInputs(logits.float(), colours, seen[:, None].float() / PARTS**2, distance)
    return CellBatch(inputs, truth.float(), known.float())


def _turned(examples: CellExamples, one: int, rng: Generator) -> CellExamples:
    """Return copies of the arrays of one example, mirrored along x and y or transposed at random."""
    logits, rgb, seen, truth, known = (array[one] for array in examples)
    maps = [logits, rgb.reshape(3, PARTS, PARTS, *rgb.shape[1:]), seen[None], truth, known]
    for axis in (-2, -1):
        if rng.random() < 0.5:
            maps = [np.flip(each, axis) for each in maps]
            maps[1] = np.flip(maps[1], axis - 2)
    if rng.random() < 0.5:
        maps = [each.swapaxes(-2, -1) for each in maps]
        maps[1] = maps[1].swapaxes(-4, -3)
    logits, parts, seen, truth, known = (np.array(each, order="C") for each in maps)
    return CellExamples(logits, parts.reshape(rgb.shape), seen[0], truth, known)


def _hide(example: CellExamples, rng: Generator) -> None:
    """Make a sector of an example unseen at random, as without a camera, in place."""
    if rng.random() > _HIDDEN:
        return
    x, y = (np.arange(cells) - (cells - 1) / 2 for cells in example.seen.shape)
    from_middle_rad = wrap_angle(np.arctan2(y, x[:, None]) - rng.uniform(-np.pi, np.pi))
    hidden = np.abs(from_middle_rad) < rng.uniform(*_SECTOR_RAD) / 2
    example.seen[hidden] = 0
    example.rgb[:, hidden] = 0


def _doubt(example: CellExamples, rng: Generator) -> None:
    """Make the logits of an example doubtful at random, so that the colours are looked at, in place."""
    if rng.random() > _DOUBTFUL:
        return
    cells = example.seen.shape
    kept = np.clip(_smooth(cells, rng) * rng.uniform(0.2, 1.0) + rng.uniform(-0.5, 1.0), 0, 1)
    example.logits[LANE] = _NO_LANE + kept * (example.logits[LANE] - _NO_LANE)
    example.logits[ROAD] *= np.float16(rng.uniform(0.3, 1.0))
    example.logits[ROAD] += (rng.uniform(0, _ROAD_ERROR) * _smooth(cells, rng)).astype(np.float16)


def _wear(example: CellExamples, rng: Generator) -> None:
    """Fade the lines of an example at random, in place; where nothing is left of one, it is none."""
    if rng.random() > _WORN:
        return
    lines = cv2.dilate(example.truth[_LINES].astype(np.uint8), np.ones((3, 3), np.uint8)).astype(np.bool_)
    away = np.array([[_BESIDE_CELLS, 0], [0, _BESIDE_CELLS]])[rng.integers(2)] * rng.choice([-1, 1])
    bare = np.roll(example.rgb, away, (1, 2)).astype(np.float32)
    fading = lines & np.roll(~lines & (example.seen > 0), away, (0, 1))
    kept = np.clip(rng.uniform(*_KEPT) + _UNEVEN * _smooth(lines.shape, rng), 0, 1)
    faded = bare + kept * (example.rgb - bare)
    example.rgb[:, fading] = faded[:, fading].round().astype(np.uint8)
    example.truth[_LINES] &= ~fading | (kept > _INVISIBLE)


def _smooth(cells: tuple[int, ...], rng: Generator) -> NDArray[np.float64]:
    """Return normal random numbers (X, Y) that change over several cells."""
    apart = rng.uniform(*_ERROR_CELLS)
    nodes = rng.standard_normal([max(2, round(count / apart) + 1) for count in cells])
    return np.asarray(cv2.resize(nodes, cells[::-1], interpolation=cv2.INTER_LINEAR))


def _toned(rgb: Tensor, rng: Generator) -> Tensor:
    """Return colours (27, X, Y) in the tone of another camera, at random."""
    if rng.random() > _TONED:
        return rgb
    gain = np.exp(rng.normal(0, _CHANNEL, (3, 1)) + rng.uniform(*_GAIN))
    mix = np.eye(3)
    kind = rng.random()
    if kind < _MIXED:
        mix = mix + _MIXTURE * rng.standard_normal((3, 3))
        mix /= np.maximum(mix.sum(axis=1, keepdims=True), 0.3)
    elif kind < _MIXED + _GREY:
        mix = np.full((3, 3), 1 / 3)
    channels = rgb.reshape(3, -1, *rgb.shape[1:]).pow(float(np.exp(rng.uniform(-_GAMMA, _GAMMA))))
    channels = torch.tensordot(torch.from_numpy((mix * gain.T).astype(np.float32)), channels, dims=1)
    if rng.random() < _NOISY:
        noise = np.float32(_NOISE * rng.random()) * rng.standard_normal(channels.shape, np.float32)
        channels = channels + torch.from_numpy(noise)
    toned: Tensor = channels.clamp(0, 1).flatten(0, 1)
    return toned


def train_cells(examples: CellExamples, epochs: float, distance: Tensor, seed: int) -> CellNetwork:
    """Return a trained network: the moving average of its weights.

    Args:
        examples: all of them are used in an epoch.
        epochs: length of the training.
        distance: distances of `cell_distances`.
        seed: of initial weights, order and augmentation.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = CellNetwork()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    steps = max(1, round(epochs * len(examples.seen) / BATCH))

    def losses() -> Iterator[Tensor]:
        order = batches(len(examples.seen), BATCH, rng)
        with ThreadPoolExecutor(1) as maker:

            def batch_of(step: int) -> Future[CellBatch]:
                return maker.submit(make_batch, examples, next(order), distance, rng, easy=step < _EASY * steps)

            coming = batch_of(0)
            for step in range(steps):
                batch = coming.result()
                coming = batch_of(step + 1)
                loss = cell_loss(network(batch.inputs), batch)
                yield loss
                if step % 50 == 49:
                    print(f"step {step + 1} of {steps}: loss {float(loss.detach()):.4f}", flush=True)

    return optimised(network, losses(), steps, Schedule(RATE, WARMUP, EMA))


def cell_loss(logits: Tensor, batch: CellBatch) -> Tensor:
    """Return the weighted mean cross-entropy of logits (B, 2, X, Y) over the known cells."""
    each = functional.binary_cross_entropy_with_logits(logits, batch.truth, reduction="none") * batch.known
    return (each.mean((0, 2, 3)) * each.new_tensor(_WEIGHTS)).sum()
