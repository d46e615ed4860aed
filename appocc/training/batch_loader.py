"""Batch loader: augmented batches of packed samples, reproducible from the seed and loaded in background threads."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from itertools import count
from typing import TypeVar

import numpy as np
import torch

from appocc.camera import Camera, CameraRig
from appocc.checks import IntArray
from appocc.errors import DataError
from appocc.models.model_spec import ModelSpec
from appocc.training.augment import Augmentation, augment
from appocc.training.batch import Batch, Truth
from appocc.training.packed_dataset import PackedDataset
from appocc.training.reading import APPEARANCE_BIT, UNKNOWN_KIND, PackedSample, crop

NO_AUGMENTATION = Augmentation()
_ORDER, _AUGMENT = 0, 1  # streams of random numbers

Item = TypeVar("Item")


class BatchLoader:
    """Batches of one or several packed datasets of the same setting.

    All samples are shuffled in every epoch; epochs are concatenated to one endless sequence, so that every batch is
    full. Sample k of this sequence and its augmentation depend on the seed and k only: batch `step` of process
    `rank` holds the samples k = (step * world_size + rank) * batch_size + 0, 1, ... A step is one forward pass, also
    with gradient accumulation.
    """

    def __init__(
        self,
        datasets: Sequence[PackedDataset],
        batch_size: int,
        seed: int,
        augmentation: Augmentation = NO_AUGMENTATION,
        rank: int = 0,
        world_size: int = 1,
    ) -> None:
        """Load batches of packed datasets.

        Raises:
            DataError: if there are no samples, or the settings of the datasets differ.
        """
        self._datasets = tuple(datasets)
        self._ends = np.cumsum([len(dataset) for dataset in datasets])
        if not len(self._ends) or not self._ends[-1]:
            raise DataError("expected packed datasets with samples, got none")
        self.setting: ModelSpec = datasets[0].setting
        for dataset in datasets:
            if dataset.setting != self.setting:
                raise DataError(f"{dataset.folder}: expected the setting of {datasets[0].folder}, got another")
        if batch_size < 1 or not 0 <= rank < world_size:
            got = f"got {batch_size}, {rank}, {world_size}"
            raise DataError(f"expected a batch size of 1 or more and rank < world size, {got}")
        self._size, self._seed, self._augmentation = batch_size, seed, augmentation
        self._rank, self._world_size = rank, world_size
        self._cameras = max(len(dataset.channels) for dataset in datasets)
        self._order = lru_cache(maxsize=4)(self._permutation)

    def __len__(self) -> int:
        """Number of samples of all datasets."""
        return int(self._ends[-1])

    def batch(self, step: int) -> Batch:
        """Return the batch of a step."""
        first = (step * self._world_size + self._rank) * self._size
        numbers, samples = zip(*(self._augmented(k) for k in range(first, first + self._size)), strict=True)
        return collate(samples, numbers, self._cameras)

    def batches(self, start: int = 0, threads: int = 1) -> Iterator[Batch]:
        """Yield batches from a step on, without end; `threads` load ahead, 0 loads on request."""
        return _in_background(self.batch, count(start), threads)

    def in_order(self, limit: int | None = None, threads: int = 1) -> Iterator[Batch]:
        """Yield each sample once, not augmented, in the order of the datasets; the last batch may be smaller.

        Args:
            limit: number of samples over all processes, the first ones; None: all.
            threads: as in `batches`.
        """
        own = range(len(self) if limit is None else min(limit, len(self)))[self._rank :: self._world_size]
        return _in_background(
            self._not_augmented, (own[i : i + self._size] for i in range(0, len(own), self._size)), threads
        )

    def _not_augmented(self, numbers: Sequence[int]) -> Batch:
        samples = [crop(self._packed_sample(number), self.setting.grid) for number in numbers]
        return collate(samples, numbers, self._cameras)

    def _augmented(self, k: int) -> tuple[int, PackedSample]:
        """Return index and augmented sample at position k of the endless sequence."""
        epoch, position = divmod(k, len(self))
        number = int(self._order(epoch)[position])
        rng = np.random.default_rng([self._seed, _AUGMENT, k])
        return number, augment(self._packed_sample(number), self._augmentation, self.setting.grid, rng)

    def _permutation(self, epoch: int) -> IntArray:
        """Return the order of the samples in an epoch."""
        return np.random.default_rng([self._seed, _ORDER, epoch]).permutation(len(self))

    def _packed_sample(self, number: int) -> PackedSample:
        i = int(np.searchsorted(self._ends, number, "right"))
        return self._datasets[i].sample(number - int(self._ends[i]) + len(self._datasets[i]))


def _in_background(job: Callable[[Item], Batch], items: Iterable[Item], threads: int) -> Iterator[Batch]:
    """Yield the batches of the items in order; up to two more than there are threads are loaded ahead."""
    if threads < 1:
        yield from map(job, items)
        return
    pool = ThreadPoolExecutor(threads, "samples")
    waiting: deque[Future[Batch]] = deque()
    try:
        for item in items:
            waiting.append(pool.submit(job, item))
            if len(waiting) > threads + 1:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def collate(samples: Sequence[PackedSample], numbers: Sequence[int], cameras: int) -> Batch:
    """Collate samples on the grid of the setting to a batch; the images of present cameras come first.

    Images keep the memory layout of the packed dataset, channels last.

    Args:
        samples: samples of one image size and one grid.
        numbers: index of each sample in all packed datasets.
        cameras: N, largest number of cameras of a sample.
    """
    b, n, (high, wide) = len(samples), cameras, samples[0].images.shape[1:3]
    images = np.zeros((b, n, high, wide, 3), np.float32)
    depth = np.zeros((b, n, *samples[0].depth_m.shape[1:]), np.float32)
    kind = np.full(depth.shape, -1, np.int64)
    for i, sample in enumerate(samples):
        for slot, camera in enumerate(np.flatnonzero(sample.alive)):
            np.divide(sample.images[camera], np.float32(255), out=images[i, slot])
            depth[i, slot] = sample.depth_m[camera]
            kind[i, slot] = np.where(sample.kind[camera] == UNKNOWN_KIND, -1, sample.kind[camera].astype(np.int64))
    bits = np.arange(3, dtype=np.uint8)[:, None, None]
    occupancy = np.stack([sample.occupancy >> bits & 1 for sample in samples])
    known = np.stack([sample.known for sample in samples])
    appearance = np.stack([sample.appearance for sample in samples])
    truth = Truth(
        torch.from_numpy(occupancy.astype(np.float32)),
        torch.from_numpy((known[:, None] >> bits & 1).astype(np.bool_)),
        torch.from_numpy(appearance.astype(np.float32) / np.float32(255)),
        torch.from_numpy((known >> APPEARANCE_BIT & 1).astype(np.bool_)),
        torch.from_numpy(depth),
        torch.from_numpy(kind),
    )
    rigs = tuple(_camera_rig(sample) for sample in samples)
    return Batch(torch.from_numpy(images).permute(0, 1, 4, 2, 3), rigs, truth, tuple(numbers))


def _camera_rig(sample: PackedSample) -> CameraRig:
    """Return the cameras of a sample that have images, in the order of the sample."""
    high, wide = sample.images.shape[1:3]
    k, poses = sample.intrinsic, sample.ego_from_cam
    present = np.flatnonzero(sample.alive)
    return CameraRig(tuple(Camera(sample.channels[n], wide, high, k[n].copy(), poses[n].copy()) for n in present))
