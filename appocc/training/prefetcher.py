"""Prefetcher: batches with their view-transform plans on the device, made ahead by a thread where one is free."""

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

from appocc.environment import cores
from appocc.models.base import BEVModel, ViewTransformPlan
from appocc.training.batch import Batch, Truth

_QUEUE_LENGTH = 2


class PreparedBatch(NamedTuple):
    """A batch on the device with its view-transform plan.

    Attributes:
        batch: the batch.
        plan: view-transform plan of its rigs.
        plan_s: seconds of the training loop spent on making the plan; 0 if a thread made it.
    """

    batch: Batch
    plan: ViewTransformPlan
    plan_s: float


@contextmanager
def prefetch(
    batches: Iterator[Batch], model: BEVModel, device: torch.device, count: int | None = None
) -> Iterator[Iterator[PreparedBatch]]:
    """Prepare the (first `count`) batches for a network; in a thread, while the network computes on other cores.

    If the network uses all cores, a thread would only take time from it.
    """
    prepared = (_prepare(batch, model, device) for batch in islice(batches, count))
    try:
        free = device.type == "cuda" or torch.get_num_threads() < cores()
        with closing(_prefetch_in_thread(prepared) if free else prepared) as ready:
            yield ready
    finally:
        close = getattr(batches, "close", None)
        if close is not None:
            close()


def _prepare(batch: Batch, model: BEVModel, device: torch.device) -> PreparedBatch:
    """Plan a batch and copy it to the device; the images are channels-last, the fast layout of convolutions."""
    start = time.perf_counter()
    plan = model.plan(batch.rigs).to(device)
    plan_s = time.perf_counter() - start
    count = batch.images.shape[:2]
    images = batch.images.flatten(0, 1).contiguous(memory_format=torch.channels_last)  # B*N 3 H W
    images = _to_device(images, device).view(*count, *images.shape[1:])
    truth = Truth(*(_to_device(part, device) for part in batch.truth))
    past = None if batch.past is None else batch.past.to(device)
    return PreparedBatch(batch._replace(images=images, truth=truth, past=past), plan, plan_s)


def _to_device(tensor: Tensor, device: torch.device) -> Tensor:
    """Copy a tensor to the device; to a GPU asynchronously from pinned memory."""
    if device.type != "cuda":
        return tensor.to(device)
    return tensor.pin_memory().to(device, non_blocking=True)


def _prefetch_in_thread(items: Iterable[PreparedBatch]) -> Generator[PreparedBatch, None, None]:
    """Yield the same items, made ahead by a thread; an error of the thread is raised at its item."""
    made: queue.Queue[PreparedBatch | BaseException | None] = queue.Queue(_QUEUE_LENGTH)
    ended = threading.Event()

    def put(item: PreparedBatch | BaseException | None) -> None:
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
