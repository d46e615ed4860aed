"""The process group of a training: one process, or those started by torchrun."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import Tensor, distributed

from appocc.errors import AppoccError, DataError

# The other processes wait while the main process draws curves and writes files.
_TIMEOUT = timedelta(hours=1)


@dataclass(frozen=True)
class ProcessGroup:
    """This process in the group of a training.

    Attributes:
        rank: index of this process; the main process has rank 0, writes files and reports.
        size: number of processes.
        device: device of this process.
    """

    rank: int
    size: int
    device: torch.device

    @property
    def is_main(self) -> bool:
        """Whether this is the main process."""
        return self.rank == 0

    @property
    def on_gpu(self) -> bool:
        """Whether the device is a GPU."""
        return self.device.type == "cuda"

    def mean(self, values: Tensor) -> Tensor:
        """Return the mean over the processes (all-reduce)."""
        if self.size > 1:
            distributed.all_reduce(values)
            values = values / self.size
        return values


@contextmanager
def join_process_group(device: str) -> Iterator[ProcessGroup]:
    """Join the processes started by torchrun, if any; `device` is auto, cpu or cuda.

    Raises:
        DataError: if cuda is requested and no GPU is available, or torchrun cannot restart processes as it is set up.
        AppoccError: if another process is lost in the block.
    """
    has_gpu = torch.cuda.is_available()
    if device == "cuda" and not has_gpu:
        raise DataError("train.device: expected cpu or auto, got cuda, but torch finds no GPU here")
    on_gpu = has_gpu and device != "cpu"
    own_device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0"))) if on_gpu else torch.device("cpu")
    if on_gpu:
        torch.cuda.set_device(own_device)
    if int(os.environ.get("WORLD_SIZE", "1")) == 1:
        yield ProcessGroup(0, 1, own_device)
        return
    _check_restarts()
    distributed.init_process_group("nccl" if on_gpu else "gloo", timeout=_TIMEOUT)
    try:
        yield ProcessGroup(distributed.get_rank(), distributed.get_world_size(), own_device)
    except RuntimeError as error:
        if not isinstance(error, distributed.DistError) and "gloo" not in str(error):
            raise
        reason = " ".join(str(error).split())[:200]
        raise AppoccError(f"lost another process of the training; --resume continues it ({reason})") from error
    finally:
        distributed.destroy_process_group()


def _check_restarts() -> None:
    """Check that processes that torchrun restarts find each other.

    Several launches of torchrun share a store, in which restarted processes read the addresses of those before them
    and wait forever (https://github.com/pytorch/pytorch/issues/135712).

    Raises:
        DataError: if that is so.
    """
    restarts = int(os.environ.get("TORCHELASTIC_MAX_RESTARTS", "0"))
    if restarts and os.environ.get("TORCHELASTIC_USE_AGENT_STORE") == "True":
        raise DataError(
            "torchrun --max-restarts: expected TORCH_DISABLE_SHARE_RDZV_TCP_STORE=1 in the environment of torchrun; "
            "without it, restarted processes wait for each other forever"
        )
