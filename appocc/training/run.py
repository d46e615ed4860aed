"""Parts and state of a training run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from appocc.errors import AppoccError
from appocc.models.base import BEVModel
from appocc.training.batches.batch import Batch
from appocc.training.checkpoint import TrainingProgress
from appocc.training.config import Config
from appocc.training.process_group import ProcessGroup
from appocc.training.run_folder import RunFolder
from appocc.training.schedule import Budget


class TrainingError(AppoccError):
    """The training failed; the last good checkpoint is kept."""

    exit_code = 1


class StoppedError(AppoccError):
    """The training was stopped on request; its checkpoint is written."""

    exit_code = 130


class BatchSource(Protocol):
    """Batches of samples for this process of the group."""

    def batches(self, start: int = 0, workers: int = 1, processes: bool = False) -> Iterator[Batch]:
        """Yield augmented batches without end, from index `start`; batch m is the same in every run."""
        ...

    def in_order(self, limit: int | None = None, threads: int = 1) -> Iterator[Batch]:
        """Yield each sample once, not augmented; the first `limit` samples over all ranks."""
        ...


class SaveWeights(Protocol):
    """Writer of weights with their model card."""

    def __call__(self, path: Path, model: BEVModel, card: dict[str, str]) -> None:
        """Write the file atomically."""
        ...


@dataclass(frozen=True, eq=False)
class TrainingSetup:
    """Network, data and weight writer of a training.

    Attributes:
        model: network with its initial weights, on the CPU.
        train: training samples, augmented as configured.
        val: validation samples, not augmented.
        save: writer of weights.
    """

    model: BEVModel
    train: BatchSource
    val: BatchSource
    save: SaveWeights


@dataclass
class TrainingMonitor:
    """Callbacks of a training and the request to stop it.

    Attributes:
        on_step: called with the spent share of the budget and a status line.
        on_message: called with messages that should stay visible.
        running: whether training steps are running or about to run.
        stop_requested: set it to stop the training after the current step and write a checkpoint; processes that
            have to agree stop when they next exchange metrics.
    """

    on_step: Callable[[float, str], None] = lambda share, text: None
    on_message: Callable[[str], None] = lambda text: None
    running: bool = False
    stop_requested: bool = False


class StepMetrics(NamedTuple):
    """Metrics of one step in this process, before they are copied to the host.

    Attributes:
        step: index of the step, from 1.
        names: names of the loss terms.
        values: (K + 2,) loss terms, total loss and gradient norm, on the device.
        samples: samples of this process.
        seconds: time since the metrics of the step before, evaluations and checkpoints not counted.
        waited_s: time spent waiting for data.
        plan_s: time spent on view-transform plans.
    """

    step: int
    names: tuple[str, ...]
    values: Tensor
    samples: int
    seconds: float
    waited_s: float
    plan_s: float


@dataclass(kw_only=True, eq=False)
class TrainingRun:
    """A training in progress: setup, state and schedule."""

    config: Config
    setup: TrainingSetup
    processes: ProcessGroup
    folder: RunFolder
    monitor: TrainingMonitor
    model: BEVModel
    ema_model: BEVModel
    optimizer: torch.optim.Optimizer
    budget: Budget
    progress: TrainingProgress = field(default_factory=TrainingProgress)
    pending: list[StepMetrics] = field(default_factory=list)
    status: str = ""  # samples per second and losses, as of the latest metrics on the host
    carried_s: float = 0.0  # time of the latest step after its metrics were taken
    saved_at: float = field(default_factory=time.monotonic)
    plotted_at: float = field(default_factory=time.monotonic)
    stop_agreed: bool = False  # all processes know of the request to stop

    @property
    def should_stop(self) -> bool:
        """Whether to stop now; a signal handler may set the request at any moment."""
        return self.monitor.stop_requested if self.processes.size == 1 else self.stop_agreed

    @property
    def share(self) -> float:
        """Spent share of the budget, 0..1."""
        return self.budget.share(self.progress.step, self.progress.seconds)
