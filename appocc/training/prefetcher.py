"""Batches on their way to the network: with the plans of their rigs, on its device, ahead of time on a GPU."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from itertools import islice
from typing import NamedTuple

import torch
from torch import Tensor

from appocc.models.base import BEVModel, ViewTransformPlan
from appocc.training.batch import Batch, Truth

_AHEAD = 2


class Fed(NamedTuple):
    """A batch on the device, and where its pictures' features go.

    Attributes:
        batch: the batch.
        plan: its plan.
        plan_s: seconds for which making the plan kept the network waiting.
    """

    batch: Batch
    plan: ViewTransformPlan
    plan_s: float


@contextmanager
def feed(
    batches: Iterator[Batch], model: BEVModel, device: torch.device, count: int | None = None
) -> Iterator[Iterator[Fed]]:
    """The (first `count`) batches as a network takes them; on a GPU a thread makes them ready while it computes.

    On the CPU a thread would only take time from the network.
    """
    ready = (_ready(batch, model, device) for batch in islice(batches, count))
    try:
        with closing(_ahead(ready) if device.type == "cuda" else ready) as fed:
            yield fed
    finally:
        close = getattr(batches, "close", None)
        if close is not None:
            close()


def _ready(batch: Batch, model: BEVModel, device: torch.device) -> Fed:
    """One batch with its plan; pictures in the layout that convolutions like."""
    start = time.perf_counter()
    plan = model.plan(batch.rigs).to(device)
    plan_s = time.perf_counter() - start
    count = batch.images.shape[:2]
    images = batch.images.flatten(0, 1).contiguous(memory_format=torch.channels_last)  # B*N 3 H W
    images = _moved(images, device).view(*count, *images.shape[1:])
    truth = Truth(*(_moved(part, device) for part in batch.truth))
    return Fed(batch._replace(images=images, truth=truth), plan, plan_s)


def _moved(tensor: Tensor, device: torch.device) -> Tensor:
    """On the device; pinned on its way to a GPU, so that nobody waits for the copy."""
    if device.type != "cuda":
        return tensor.to(device)
    return tensor.pin_memory().to(device, non_blocking=True)


def _ahead(items: Iterable[Fed]) -> Generator[Fed, None, None]:
    """The same items, made by a thread that is some ahead; its error is raised where the item is asked for."""
    made: queue.Queue[Fed | BaseException | None] = queue.Queue(_AHEAD)
    ended = threading.Event()

    def put(item: Fed | BaseException | None) -> None:
        while not ended.is_set():
            try:
                made.put(item, timeout=0.1)
                return
            except queue.Full:
                continue

    def work() -> None:
        try:
            for item in items:
                put(item._replace(plan_s=0.0))
                if ended.is_set():
                    return
            put(None)
        except BaseException as error:
            put(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    try:
        while (item := made.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        ended.set()
        thread.join()
