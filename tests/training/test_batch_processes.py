from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch

from appocc.errors import AppoccError, DataError
from appocc.models.memory import Past
from appocc.training.batches.batch import Batch, Truth
from appocc.training.batches.batch_processes import batches_by_processes


def made_batch(step: int) -> Batch:
    """A batch whose values tell its step, with arrays of several types and an odd number of bytes."""
    images = torch.full((1, 2, 3, 3, 5), step, dtype=torch.uint8).movedim(2, -1).contiguous().movedim(-1, 2)
    truth = Truth(
        *(torch.full((1, 3), step + number, dtype=torch.float32) for number in range(6)), *[torch.ones(1)] * 2
    )
    motion, elapsed_s, linked = torch.full((2, 1, 2, 3), float(step)), torch.full((2, 1), 0.5), torch.ones(2, 1)
    return Batch(images, (), truth, (step,), Past(None, motion, elapsed_s, linked))


def failing(step: int) -> Batch:
    if step == 2:
        raise DataError("sample 2 is damaged")
    return made_batch(step)


def dying(step: int) -> Batch:
    if step == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return made_batch(step)


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    """No process and no shared memory outlives the batches."""
    yield
    assert not multiprocessing.active_children()
    assert not list(Path("/dev/shm").glob(f"appocc-{os.getpid()}-*"))


def test_batches_come_in_order_with_all_their_values() -> None:
    batches = batches_by_processes(made_batch, 5, 3)
    for step, batch in enumerate(islice(batches, 7), start=5):
        wanted = made_batch(step)
        assert batch.number == (step,)
        assert batch.images.dtype == torch.uint8
        assert torch.equal(batch.images, wanted.images)
        assert all(torch.equal(one, other) for one, other in zip(batch.truth, wanted.truth, strict=True))
        assert batch.past is not None
        assert batch.past.state is None
        np.testing.assert_array_equal(batch.past.past_from_now, np.full((2, 1, 2, 3), step))
    batches.close()  # type: ignore[attr-defined]


def test_an_error_in_a_process_reaches_the_loop() -> None:
    batches = batches_by_processes(failing, 0, 2)
    assert [next(batches).number for _ in range(2)] == [(0,), (1,)]
    with pytest.raises(DataError, match="sample 2 is damaged"):
        next(batches)


def test_a_killed_process_is_one_clear_error() -> None:
    batches = batches_by_processes(dying, 0, 2)
    assert next(batches).number == (0,)
    time.sleep(0.5)  # the process is gone before its next step is asked for
    assert [next(batches).number for _ in range(2)] == [(1,), (2,)]
    with pytest.raises(AppoccError, match="killed"):
        next(batches)
