"""Batches of packed samples in an order that follows from a seed; any step at once, made ahead in the background."""

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
from appocc.training.augment import Augmentation, augmented
from appocc.training.batch import Batch, Truth
from appocc.training.packed_dataset import Pack
from appocc.training.reading import APPEARANCE_BIT, UNKNOWN_KIND, Sample, cropped

UNCHANGED = Augmentation()
_ORDER, _CHANGE = 0, 1  # what a generator is for

Item = TypeVar("Item")


class Loader:
    """Batches of one or several packs of the same setting.

    The samples of all packs, numbered through, are shuffled anew for each pass over them; the passes follow each
    other without a gap, so that every batch is full. Sample number k of this endless row, and what is changed of it,
    depends on the seed and k only: batch `step` of process `rank` is the samples
    k = (step * world + rank) * batch_size + 0, 1, ... A step is a forward pass: with accumulation, count those.
    """

    def __init__(
        self,
        packs: Sequence[Pack],
        batch_size: int,
        seed: int,
        augmentation: Augmentation = UNCHANGED,
        rank: int = 0,
        world: int = 1,
    ) -> None:
        """Begin with packs.

        Raises:
            DataError: if there are no samples, or the packs are of different settings.
        """
        self._packs = tuple(packs)
        self._ends = np.cumsum([len(pack) for pack in packs])
        if not len(self._ends) or not self._ends[-1]:
            raise DataError("expected packs with samples, got none")
        self.setting: ModelSpec = packs[0].setting
        for pack in packs:
            if pack.setting != self.setting:
                raise DataError(f"{pack.folder}: expected the setting of {packs[0].folder}, got another")
        if batch_size < 1 or not 0 <= rank < world:
            raise DataError(f"expected a batch size of 1 or more and rank < world, got {batch_size}, {rank}, {world}")
        self._size, self._seed, self._augmentation = batch_size, seed, augmentation
        self._rank, self._world = rank, world
        self._cameras = max(len(pack.channels) for pack in packs)
        self._order = lru_cache(maxsize=4)(self._shuffled)

    def __len__(self) -> int:
        """Number of samples of all packs."""
        return int(self._ends[-1])

    def batch(self, step: int) -> Batch:
        """The batch of a step."""
        first = (step * self._world + self._rank) * self._size
        numbers, samples = zip(*(self._drawn(k) for k in range(first, first + self._size)), strict=True)
        return collated(samples, numbers, self._cameras)

    def batches(self, start: int = 0, threads: int = 1) -> Iterator[Batch]:
        """The batches from a step on, without end; made ahead by threads, or when asked for where `threads` is 0."""
        return _ahead(self.batch, count(start), threads)

    def in_order(self, most: int | None = None, threads: int = 1) -> Iterator[Batch]:
        """Samples once each, unchanged, in the order of the packs; the last batch may be smaller.

        Args:
            most: how many of all processes together, the first; all where None.
            threads: as in `batches`.
        """
        own = range(len(self) if most is None else min(most, len(self)))[self._rank :: self._world]
        return _ahead(self._plain, (own[i : i + self._size] for i in range(0, len(own), self._size)), threads)

    def _plain(self, numbers: Sequence[int]) -> Batch:
        samples = [cropped(self._packed(number), self.setting.grid) for number in numbers]
        return collated(samples, numbers, self._cameras)

    def _drawn(self, k: int) -> tuple[int, Sample]:
        """Number and changed sample at place k of the endless row."""
        turn, place = divmod(k, len(self))
        number = int(self._order(turn)[place])
        rng = np.random.default_rng([self._seed, _CHANGE, k])
        return number, augmented(self._packed(number), self._augmentation, self.setting.grid, rng)

    def _shuffled(self, turn: int) -> IntArray:
        """The order of all samples in a pass over them."""
        return np.random.default_rng([self._seed, _ORDER, turn]).permutation(len(self))

    def _packed(self, number: int) -> Sample:
        pack = int(np.searchsorted(self._ends, number, "right"))
        return self._packs[pack].sample(number - int(self._ends[pack]) + len(self._packs[pack]))


def _ahead(job: Callable[[Item], Batch], items: Iterable[Item], threads: int) -> Iterator[Batch]:
    """Batches of the items in their order; up to two more than there are threads are made ahead."""
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


def collated(samples: Sequence[Sample], numbers: Sequence[int], cameras: int) -> Batch:
    """A batch of samples on the setting's grid; the pictures of living cameras come first.

    Pictures lie in memory as they are packed, with the channels last.

    Args:
        samples: of one size of pictures and one grid.
        numbers: of each in its pack, or in all packs together.
        cameras: N, the most that a sample has.
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
    rigs = tuple(_rig(sample) for sample in samples)
    return Batch(torch.from_numpy(images).permute(0, 1, 4, 2, 3), rigs, truth, tuple(numbers))


def _rig(sample: Sample) -> CameraRig:
    """The living cameras of a sample, in its order."""
    high, wide = sample.images.shape[1:3]
    k, poses = sample.intrinsic, sample.ego_from_cam
    living = np.flatnonzero(sample.alive)
    return CameraRig(tuple(Camera(sample.channels[n], wide, high, k[n].copy(), poses[n].copy()) for n in living))
