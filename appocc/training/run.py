"""What a training is made of, and what of it moves."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import torch

from appocc.errors import AppoccError
from appocc.models.base import BEVModel
from appocc.training.batch import Batch
from appocc.training.checkpoint import Progress
from appocc.training.config import Config
from appocc.training.process_group import World
from appocc.training.run_folder import RunFolder
from appocc.training.schedule import Budget


class TrainingError(AppoccError):
    """The training cannot go on; the last good checkpoint stays."""

    exit_code = 1


class StoppedError(AppoccError):
    """The training was asked to stop; its state is written."""

    exit_code = 130


class Samples(Protocol):
    """Samples in batches, those of this process among all that train together."""

    def batches(self, start: int = 0, threads: int = 1) -> Iterator[Batch]:
        """Changed samples without end, from batch number `start` on: batch number m is always the same."""
        ...

    def in_order(self, most: int | None = None, threads: int = 1) -> Iterator[Batch]:
        """Each sample once, unchanged; of all processes together the first `most` samples."""
        ...


class SaveWeights(Protocol):
    """Writes a network's weights with their card."""

    def __call__(self, path: Path, model: BEVModel, card: dict[str, str]) -> None:
        """Write the file, whole or not at all."""
        ...


@dataclass(frozen=True)
class Parts:
    """What a training is made of.

    Attributes:
        model: with its first weights, on the CPU.
        train: for training, changed as the configuration says.
        val: for validation, as they are.
        save: writes weights.
    """

    model: BEVModel
    train: Samples
    val: Samples
    save: SaveWeights


@dataclass
class Watcher:
    """Who looks on: told of steps and evaluations, and able to stop the training.

    Attributes:
        step: called with the share of the budget that is spent and a line about it.
        say: called with lines that should stay.
        running: whether steps are taken, or will be next.
        stop: set to end the training after this step (the next, if processes have to agree), with its state.
    """

    step: Callable[[float, str], None] = lambda share, text: None
    say: Callable[[str], None] = lambda text: None
    running: bool = False
    stop: bool = False


@dataclass
class Run:
    """A training under way: what moves, and what it needs."""

    config: Config
    parts: Parts
    world: World
    folder: RunFolder
    watcher: Watcher
    model: BEVModel
    average: BEVModel
    optimizer: torch.optim.Optimizer
    budget: Budget
    progress: Progress = field(default_factory=Progress)
    saved_at: float = field(default_factory=time.monotonic)
    drawn_at: float = field(default_factory=time.monotonic)
    agreed: bool = False  # all processes know of the wish to stop

    @property
    def stopping(self) -> bool:
        """Whether to stop now; nobody overwrites the wish, which a signal may utter at any moment."""
        return self.watcher.stop if self.world.size == 1 else self.agreed

    @property
    def share(self) -> float:
        """Share of the budget that is spent."""
        return self.budget.share(self.progress.step, self.progress.seconds)
