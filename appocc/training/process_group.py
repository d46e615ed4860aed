"""The processes of a training: one, or those that torchrun started."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import Tensor, distributed

from appocc.errors import DataError

# Others wait while the first one draws and writes.
_PATIENCE = timedelta(hours=1)


@dataclass(frozen=True)
class World:
    """This process among those of a training.

    Attributes:
        rank: its number; number 0 writes and speaks.
        size: how many there are.
        device: where it computes.
    """

    rank: int
    size: int
    device: torch.device

    @property
    def first(self) -> bool:
        """Whether it is the one that writes."""
        return self.rank == 0

    def mean(self, values: Tensor) -> Tensor:
        """Mean over the processes, the same in each."""
        if self.size > 1:
            distributed.all_reduce(values)
            values = values / self.size
        return values


@contextmanager
def joined(device: str) -> Iterator[World]:
    """Join the processes that torchrun started, if it did; `device` is auto, cpu or cuda.

    Raises:
        DataError: if a GPU is asked for and there is none.
    """
    there = torch.cuda.is_available()
    if device == "cuda" and not there:
        raise DataError("train.device: expected cpu or auto, got cuda, but torch finds no GPU here")
    on_gpu = there and device != "cpu"
    place = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0"))) if on_gpu else torch.device("cpu")
    if on_gpu:
        torch.cuda.set_device(place)
    if int(os.environ.get("WORLD_SIZE", "1")) == 1:
        yield World(0, 1, place)
        return
    distributed.init_process_group("nccl" if on_gpu else "gloo", timeout=_PATIENCE)
    try:
        yield World(distributed.get_rank(), distributed.get_world_size(), place)
    finally:
        distributed.destroy_process_group()
