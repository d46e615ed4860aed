"""Prefetcher: batches with their view-transform plans on the device, made ahead by a thread where one is free."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import fields, is_dataclass
from functools import partial
from itertools import islice
from typing import NamedTuple

import torch
from torch import Tensor

from appocc.environment import cores
from appocc.models.base import BEVModel, ViewTransformPlan
from appocc.training.batches.batch import Batch, Truth

_QUEUE_LENGTH = 2


class PreparedBatch(NamedTuple):
    """A batch on the device with its view-transform plan.

    Attributes:
        batch: the batch.
        plan: view-transform plan of its rigs.
        plan_s: seconds of the training loop spent on making the plan; 0 if a thread made it.
        ready: when a GPU has them, if a stream of its own makes them; else None.
    """

    batch: Batch
    plan: ViewTransformPlan
    plan_s: float
    ready: torch.cuda.Event | None = None


@contextmanager
def prefetch(
    batches: Iterator[Batch], model: BEVModel, device: torch.device, count: int | None = None
) -> Iterator[Iterator[PreparedBatch]]:
    """Prepare the (first `count`) batches for a network; in a thread, while the network computes on other cores.

    If the network uses all cores, a thread would only take time from it.
    """
    on_gpu = device.type == "cuda"
    prepare = partial(_prepare_on_stream, stream=torch.cuda.Stream(device)) if on_gpu else _prepare  # type: ignore[no-untyped-call]
    prepared = (prepare(batch, model, device) for batch in islice(batches, count))
    try:
        free = on_gpu or torch.get_num_threads() < cores()
        with closing(_prefetch_in_thread(prepared) if free else prepared) as ready:
            yield map(_awaited, ready) if on_gpu else ready
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
    images = unit_colours(_to_device(images, device)).view(*count, *images.shape[1:])
    truth = Truth(*(_to_device(part, device) for part in batch.truth))
    past = None if batch.past is None else batch.past.to(device)
    return PreparedBatch(batch._replace(images=images, truth=truth, past=past), plan, plan_s)


def _prepare_on_stream(
    batch: Batch, model: BEVModel, device: torch.device, stream: torch.cuda.Stream
) -> PreparedBatch:
    """Prepare a batch on a stream of its own: planning waits for the GPU, and must not wait for the network."""
    with torch.cuda.stream(stream):
        prepared = _prepare(batch, model, device)
        return prepared._replace(ready=stream.record_event())


def _awaited(prepared: PreparedBatch) -> PreparedBatch:
    """Let the stream of the network wait for a batch, and keep the memory of the batch until it is done."""
    assert prepared.ready is not None
    stream = torch.cuda.current_stream()
    stream.wait_event(prepared.ready)
    for tensor in _tensors(prepared):
        if tensor.is_cuda:
            tensor.record_stream(stream)
    return prepared


def _tensors(value: object) -> Iterator[Tensor]:
    """Yield the tensors in nested tuples and dataclasses."""
    if isinstance(value, Tensor):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from _tensors(part)
    elif is_dataclass(value):
        for field in fields(value):
            yield from _tensors(getattr(value, field.name))


def unit_colours(images: Tensor) -> Tensor:
    """Return images of a batch as float32, 0..1."""
    return images.float() / 255 if images.dtype == torch.uint8 else images


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
