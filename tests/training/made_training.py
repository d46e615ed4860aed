"""A network, samples and a configuration small enough to train in a second; pictures show what is true."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors.torch import save_file
from torch import Tensor, nn

from appocc.camera import CameraRig
from appocc.grid import BEVGrid
from appocc.models.base import DEPTH_BINS, BEVModel, ImageOutput, ModelOutput
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec
from appocc.training.batches.batch import Batch, Truth
from appocc.training.batches.packed_objects import COLUMNS
from appocc.training.config import Config
from appocc.training.loop import train
from appocc.training.process_group import ProcessGroup, join_process_group
from appocc.training.run import TrainingMonitor, TrainingSetup
from appocc.training.run_folder import RunFolder

SETTING = ModelSpec("tiny", ("CAM_FRONT",), BEVGrid(0.0, 3.2, -1.6, 1.6), width_px=64, height_px=64)
KINDS = 4


class TinyPlan(NamedTuple):
    seen: Tensor

    def to(self, device: torch.device) -> TinyPlan:
        return TinyPlan(self.seen.to(device))

    def for_export(self) -> TinyPlan:
        return self


class TinyModel(BEVModel):
    """Each eighth of the picture becomes a cell; it has what makes resuming hard: batch norm and dropout."""

    def __init__(self, appearance: bool = True) -> None:
        super().__init__()
        self.spec, self.appearance = SETTING, appearance
        stem = nn.Conv2d(3, 8, 3, padding=1, bias=False)
        self.trunk = nn.Sequential(stem, nn.BatchNorm2d(8), nn.ReLU(), nn.AvgPool2d(8), nn.Dropout(0.1))
        self.heads = nn.Conv2d(8, 6 if appearance else 3, 1)
        self.views = nn.Conv2d(8, DEPTH_BINS + KINDS, 1)

    def plan(self, rigs: Sequence[CameraRig]) -> TinyPlan:
        return TinyPlan(torch.ones(len(rigs), *SETTING.grid.shape, dtype=torch.bool))

    def forward(self, images: Tensor, plan: Any, past: Past | None = None) -> ModelOutput:
        assert images.flatten(0, 1).is_contiguous(memory_format=torch.channels_last)
        features = self.trunk(images[:, 0])
        answer, views = self.heads(features), self.views(features)[:, None]
        colour = answer[:, 3:].sigmoid() if self.appearance else None
        image_output = ImageOutput(views[:, :, :DEPTH_BINS], views[:, :, DEPTH_BINS:]) if self.training else None
        return ModelOutput(answer[:, :3], colour, image_output)


class Poison(NamedTuple):
    """Batches of training from one on have their pictures and true colours multiplied: by NaN, or by far too much."""

    first: int
    factor: float


class TinySamples:
    """Pictures of noise over squares of plain colour; the red ones are road, green vehicles, blue lanes."""

    def __init__(
        self, count: int = 24, size: int = 4, rank: int = 0, world_size: int = 1, poison: Poison | None = None
    ) -> None:
        self.count, self.size, self.rank, self.world_size, self.poison = count, size, rank, world_size, poison
        self.asked: list[int] = []

    def batches(self, start: int = 0, workers: int = 1, processes: bool = False) -> Iterator[Batch]:
        number = start
        while True:
            self.asked.append(number)
            first = (number * self.world_size + self.rank) * self.size
            batch = self.batch([(first + k) % self.count for k in range(self.size)], seed=number)
            yield self._poisoned(batch) if self.poison and number >= self.poison.first else batch
            number += 1

    def in_order(self, limit: int | None = None, threads: int = 1) -> Iterator[Batch]:
        own = list(range(min(self.count, limit or self.count)))[self.rank :: self.world_size]
        for first in range(0, len(own), self.size):
            yield self.batch(own[first : first + self.size], seed=0)

    def batch(self, numbers: list[int], seed: int) -> Batch:
        noise = torch.Generator().manual_seed(seed)
        squares = torch.stack([torch.rand(3, 8, 8, generator=torch.Generator().manual_seed(n)) for n in numbers])
        images = squares.repeat_interleave(8, 2).repeat_interleave(8, 3)
        images = 0.9 * images + 0.1 * torch.rand(images.shape, generator=noise)
        truth = Truth(
            (squares > 0.6).float(),
            torch.ones(squares.shape, dtype=torch.bool),
            squares,
            torch.ones(squares[:, 0].shape, dtype=torch.bool),
            4 + 40 * squares[:, :1],
            (squares[:, :1] * KINDS).long(),
            torch.full((len(numbers), 1, COLUMNS), torch.nan),
            torch.zeros(squares[:, 0].shape, dtype=torch.int64),
        )
        rig = CameraRig(())
        return Batch(images[:, None], (rig,) * len(numbers), truth, tuple(numbers))

    def _poisoned(self, batch: Batch) -> Batch:
        assert self.poison is not None
        truth = batch.truth._replace(appearance=batch.truth.appearance * self.poison.factor)
        return batch._replace(images=batch.images * self.poison.factor, truth=truth)


def save(path: Path, model: BEVModel, card: dict[str, str]) -> None:
    tensors = {name: value.contiguous() for name, value in model.state_dict().items()}
    save_file(tensors, path, {"card": json.dumps(card, sort_keys=True)})


def made_config(**more: Any) -> Config:
    """Twelve steps with two evaluations; keys with dots as `train__lr`."""
    values: dict[str, Any] = {
        "data": {"train": "none", "val": "none"},
        "train": {"steps": 12, "batch": 4, "lr": 0.02, "ema": 0.5, "threads": 1, "precision": "fp32"},
        "evaluate": {"every_steps": 5, "norm_batches": 3},
        "save": {"every_steps": 4},
    }
    for key, value in more.items():
        part, _, name = key.partition("__")
        if name:
            values.setdefault(part, {})[name] = value
        else:
            values[part] = value
    return Config.model_validate(values)


def made_setup(config: Config, processes: ProcessGroup | None = None, poison: Poison | None = None) -> TrainingSetup:
    torch.manual_seed(config.train.seed)
    rank, size = (processes.rank, processes.size) if processes else (0, 1)
    samples = TinySamples(size=config.train.batch, rank=rank, world_size=size, poison=poison)
    val = TinySamples(10, config.train.batch, rank, size)
    return TrainingSetup(TinyModel(config.appearance), samples, val, save)


def run(
    folder: Path,
    config: Config,
    monitor: TrainingMonitor | None = None,
    resume: bool = False,
    poison: Poison | None = None,
) -> TrainingSetup:
    """Train in a folder."""
    with join_process_group("cpu") as processes:
        setup = made_setup(config, processes, poison)
        train(setup, config, RunFolder(folder), processes, monitor or TrainingMonitor(), resume)
    return setup
