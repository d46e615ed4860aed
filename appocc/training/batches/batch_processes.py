"""Batches loaded ahead by processes, for a training loop that needs its interpreter to keep a GPU busy.

Arrays come through shared memory, one block for each batch. Not torch's `DataLoader`: its workers can abort when a
loader ends before its data do.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import secrets
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.process import BaseProcess
from multiprocessing.shared_memory import SharedMemory
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor

from appocc.errors import AppoccError
from appocc.models.memory import Past
from appocc.training.batches.batch import Batch, Truth

# Batches that each process loads ahead.
_AHEAD = 2
_ALIGNED_BYTES = 64


class _Stored(NamedTuple):
    """A batch in shared memory: pickled without its arrays, their places (start, stop) and the name of the block."""

    pickled: bytes
    places: list[tuple[int, int]]
    name: str


def batches_by_processes(job: Callable[[int], Batch], first: int, size: int) -> Iterator[Batch]:
    """Yield job(first), job(first + 1), ... without end, made by `size` processes.

    Raises:
        AppoccError: if a process is killed.
        Exception: as the job does.
    """
    context = _context()
    name = f"appocc-{os.getpid()}-{secrets.token_hex(2)}"
    workers: list[tuple[Connection, BaseProcess]] = []
    try:
        for number in range(size):
            ours, theirs = context.Pipe()
            process: BaseProcess = context.Process(target=_serve, args=(job, theirs, name), daemon=True)
            process.start()
            theirs.close()
            workers.append((ours, process))
            for ahead in range(_AHEAD):
                with suppress(OSError):
                    ours.send(first + number + ahead * size)
        for step in count(first):
            worker, _ = workers[(step - first) % size]
            batch = _received(worker)
            with suppress(OSError):  # a killed process is told when its next batch is due
                worker.send(step + _AHEAD * size)
            yield batch
    finally:
        for worker, process in workers:
            _end(worker, process)


def _context() -> ForkServerContext | SpawnContext:
    """Processes are forked from one that has imported this package, where the system can: else each imports it."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["appocc.training.batches.batch_loader"])
    return context


def _received(worker: Connection) -> Batch:
    try:
        stored = worker.recv()
    except (EOFError, OSError) as error:
        raise AppoccError(
            "a process that loads batches was killed (out of memory?): try a lower data.workers"
        ) from error
    if isinstance(stored, Exception):
        raise stored
    return _opened(stored)


def _end(worker: Connection, process: BaseProcess) -> None:
    """End a process and free the batches that it has loaded ahead."""
    with suppress(EOFError, OSError):
        worker.send(None)
        while isinstance(stored := worker.recv(), _Stored):
            _opened(stored)
    worker.close()
    process.join()


def _opened(stored: _Stored) -> Batch:
    """Copy a batch from shared memory, and free that."""
    block = SharedMemory(stored.name)
    data = np.array(block.buf)
    block.close()
    block.unlink()
    images, rigs, truth, number, past = pickle.loads(
        stored.pickled, buffers=[data[start:stop] for start, stop in stored.places]
    )
    linked = None if past is None else Past(*map(_tensor, past))  # type: ignore[arg-type]
    return Batch(torch.from_numpy(images).movedim(-1, 2), rigs, Truth(*map(torch.from_numpy, truth)), number, linked)


def _tensor(array: np.ndarray | None) -> Tensor | None:
    return None if array is None else torch.from_numpy(array)


# In a process -------------------------------------------------------------------------------------------------------


def _serve(job: Callable[[int], Batch], connection: Connection, name: str) -> None:
    """Load the batches that are asked for, until the parent asks for no more or dies; `name` begins their blocks'."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its processes
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    with suppress(EOFError, OSError):
        while (step := connection.recv()) is not None:
            try:
                connection.send(_stored(job(step), f"{name}-{step}"))
            except Exception as error:
                connection.send(error)
                return
    connection.close()


def _stored(batch: Batch, name: str) -> _Stored:
    """Copy a batch to a block of shared memory with a name."""
    past = None if batch.past is None else tuple(None if each is None else each.numpy() for each in batch.past)
    truth = tuple(each.numpy() for each in batch.truth)
    content = (batch.images.movedim(2, -1).numpy(), batch.rigs, truth, batch.number, past)  # images are contiguous so
    buffers: list[memoryview] = []
    pickled = pickle.dumps(content, protocol=5, buffer_callback=lambda buffer: buffers.append(buffer.raw()))
    places, stop = [], 0
    for buffer in buffers:
        start = -(-stop // _ALIGNED_BYTES) * _ALIGNED_BYTES
        stop = start + buffer.nbytes
        places.append((start, stop))
    block = SharedMemory(name, create=True, size=max(1, stop))
    shared = block.buf
    assert shared is not None
    for buffer, (start, stop) in zip(buffers, places, strict=True):
        shared[start:stop] = buffer
    del shared
    block.close()
    return _Stored(pickled, places, name)
